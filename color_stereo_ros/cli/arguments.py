# SPDX-License-Identifier: Apache-2.0
# Copyright 2026 color_stereo_ros contributors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""Settings on command lines and in YAML files, both derived from the dataclasses of the core."""

import argparse

from ..core.settings import described, flat, Settings, updated
from ..parameters.files import PROJECTORS, read_settings, SENSORS


def add_settings_arguments(parser, groups=None, settings=Settings()):
    """
    Add `--config FILE` and one option for each setting, for example `--range.min_depth 0.3`.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Gets the arguments.
    groups : sequence of str, optional
        Only the settings of these groups, for example ('pattern',).
    settings : dataclass made of groups
        The settings of the core, or of a node.

    """
    section = parser.add_argument_group(
        'settings', 'the names, units and defaults of the ROS parameters')
    section.add_argument('--config', metavar='FILE', help='YAML file of settings, such as the '
                         'parameter file of a node; the options below override it')
    only_pattern = groups is not None and set(groups) == {'pattern'}
    parser.set_defaults(config_nodes=(*SENSORS, *PROJECTORS) if only_pattern else SENSORS)
    for name, default, meta in described(settings):
        if groups and name.partition('.')[0] not in groups:
            continue
        section.add_argument(
            f'--{name}', type=_parser(default), choices=meta['choices'], default=None,
            metavar=METAVARS[type(default)],
            help=f'{meta["description"]} ({_legal(default, meta)})'.replace('%', '%%'))


METAVARS = {bool: 'BOOL', int: 'N', float: 'X', str: 'NAME'}


def _legal(default, meta):
    """Return the legal values and the default as text."""
    unit = f' {meta["unit"]}' if meta['unit'] else ''
    if isinstance(default, bool):
        return f'true or false, default {str(default).lower()}'
    if meta['choices']:
        told = all(choice in meta['description'] for choice in meta['choices'])
        return ('' if told else f'one of {", ".join(meta["choices"])}; ') + f'default {default}'
    if isinstance(default, str):
        return f'default {default or "empty"}'
    return f'{meta["minimum"]} .. {meta["maximum"]}{unit}, default {default}'


class Help(argparse.HelpFormatter):
    """
    Names the settings once in the usage line, instead of all forty; the list follows anyway.

    Options that only serve another option are left out, too: their help begins with its name.

    """

    def add_usage(self, usage, actions, groups, prefix=None):
        """Add the usage line."""
        short = [action for action in actions if '.' not in action.dest
                 and not (action.help or '').startswith('with --')]
        if len(short) < len(actions):
            short.append(argparse.Action(['--SETTING'], 'setting', metavar='VALUE'))
        super().add_usage(usage, short, groups, prefix)


def _parser(default):
    return _boolean if isinstance(default, bool) else type(default)


def _boolean(text):
    if text.lower() not in ('true', 'false'):
        raise argparse.ArgumentTypeError(f'{text!r} is neither true nor false')
    return text.lower() == 'true'


def named(text):
    """Return the names in a list that is separated by commas."""
    return tuple(name.strip() for name in (text or '').split(',') if name.strip())


def given_settings(args, settings=Settings()):
    """Return what `--config` and the options set, a dict of flat names to values."""
    given = read_settings(args.config, settings, args.config_nodes) if args.config else {}
    options = {name: getattr(args, name, None) for name in flat(settings)}
    return given | {name: value for name, value in options.items() if value is not None}


def settings_from(args, settings=Settings()):
    """
    Return the settings of a command line; what it does not name is as in `settings`.

    Raises
    ------
    SettingsError
        For an unknown name, a wrong type, or a value outside its range.

    """
    return updated(settings, given_settings(args, settings))

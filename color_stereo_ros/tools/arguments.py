# SPDX-License-Identifier: Apache-2.0
"""Settings on command lines and in YAML files, both derived from the dataclasses of the core."""

import argparse
from pathlib import Path

import yaml

from ..core.settings import Settings, described, flat, suggestion, updated
from ..core.types import SettingsError


def add_settings_arguments(parser, groups=None, settings=Settings()):
    """
    Add `--config FILE` and one option for each setting, for example `--range.min_depth 0.3`.

    Parameters
    ----------
    parser : argparse.ArgumentParser
    groups : sequence of str, optional
        Only the settings of these groups, for example ('pattern',).
    settings : dataclass made of groups
        The settings of the core, or of a node.

    """
    section = parser.add_argument_group(
        'settings', 'the names, units and defaults of the ROS parameters')
    section.add_argument('--config', metavar='FILE', help='YAML file of parameters, as for '
                         '`ros2 run ... --params-file`; options below override it')
    for name, default, meta in described(settings):
        if groups and name.partition('.')[0] not in groups:
            continue
        unit = f', {meta["unit"]}' if meta['unit'] else ''
        section.add_argument(
            f'--{name}', type=_parser(default), choices=meta['choices'], default=None,
            metavar=None if meta['choices'] else type(default).__name__.upper(),
            help=f'{meta["description"]} (default {default}{unit})'.replace('%', '%%'))


def _parser(default):
    return _boolean if isinstance(default, bool) else type(default)


def _boolean(text):
    if text.lower() not in ('true', 'false'):
        raise argparse.ArgumentTypeError(f'{text!r} is neither true nor false')
    return text.lower() == 'true'


def given_settings(args, settings=Settings()):
    """Return what `--config` and the options set, a dict of flat names to values."""
    given = read_settings(args.config, settings) if args.config else {}
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


def read_settings(path, settings=Settings()):
    """
    Read settings from a YAML file of ROS parameters.

    Parameters
    ----------
    path : str or Path
        Parameters below `<node>: ros__parameters:`, nested or with dots, or without that head.
        Groups that `settings` does not have (such as `sync`) are passed over.
    settings : dataclass made of groups

    Returns
    -------
    values : dict
        Flat names to values.

    Raises
    ------
    SettingsError
        If the file is no YAML, is not made of names and values, or misspells a name.

    """
    try:
        content = yaml.safe_load(Path(path).read_text(encoding='utf-8'))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        reason = ' '.join(str(error).split())
        raise SettingsError(f'{path}: is no YAML file: {reason}') from error
    if not isinstance(content, dict):
        raise SettingsError(f'{path}: holds {type(content).__name__}, expected names and values')
    known = flat(settings)
    groups = {name.partition('.')[0] for name in known}
    values = {name: value for node in _parameters(content) for name, value in _flattened(node)
              if name.partition('.')[0] in groups}
    for name in values:
        if name not in known:
            raise SettingsError(f'{path}: unknown setting {name!r}{suggestion(name, known)}')
    return values


def _parameters(content):
    """Yield the dicts below every `ros__parameters`, or the content itself if there is none."""
    nodes = [value for value in content.values()
             if isinstance(value, dict) and 'ros__parameters' in value]
    if not nodes:
        yield content
    for node in nodes:
        if isinstance(node['ros__parameters'], dict):
            yield node['ros__parameters']


def _flattened(values, prefix=''):
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _flattened(value, f'{prefix}{name}.')
        else:
            yield f'{prefix}{name}', value


def settings_yaml(values, node='/**'):
    """Return flat names and values as the text of a ROS parameter file."""
    nested = {}
    for name, value in values.items():
        group, _, key = name.partition('.')
        nested.setdefault(group, {})[key] = value
    return yaml.safe_dump({node: {'ros__parameters': nested}}, sort_keys=False)

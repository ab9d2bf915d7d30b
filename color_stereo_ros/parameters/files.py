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
"""Settings in YAML files: the parameter files of the nodes, and the same groups without a head."""

from pathlib import Path
import sys

import yaml

from .groups import PatternNodeSettings, RangeNodeSettings
from ..core.settings import checked_value, described, flat, Settings, suggestion
from ..errors import SettingsError
from ..files.atomic import write_text
from ..files.yaml import load_yaml, UnreadableError

SENSORS = ('range_node', 'lifecycle_range_node')
"""Nodes whose parameters the settings of the core belong to."""
PROJECTORS = ('pattern_node',)
"""Nodes that know the settings of the pattern alone."""
OTHERS = ('sim_rig_node', *PROJECTORS)
"""Nodes of this package whose parameters say nothing about a measurement."""

PASSED_OVER = ('input', 'output', 'sync', 'capture', 'sim', 'qos_overrides', 'use_sim_time',
               'start_type_description_service')
"""Groups and parameters of the nodes that are no settings of the core."""
NODE_ONLY = ('health.covariance',)
"""Parameters of range_node in groups of the core."""

OF_PROJECTORS = ('pattern.frame',)
"""Parameters of pattern_node that are no settings of the core, beside its settings."""

CALIBRATION_FIELDS = ('camera_matrix', 'distortion_coefficients', 'projection_matrix')
"""Names by which a camera_info file is known."""


def read_settings(path, settings=Settings(), nodes=SENSORS):
    """
    Read settings from a YAML file.

    Parameters
    ----------
    path : str or Path
        Parameters below `<node>: ros__parameters:`, nested or with dots, or without that head.
        Parameters that only a node has (such as those of `sync`) are passed over.
    settings : dataclass made of groups
        The names that are legal; groups beyond those of the core are read if it has them.
    nodes : sequence of str
        The nodes whose parameters count; those of `/**` always do. A node by another name counts
        if it is the only one in the file: it may have been renamed.

    Returns
    -------
    values : dict
        Flat names to values; empty if the file says nothing.

    Raises
    ------
    SettingsError
        If the file cannot be read, is no YAML, belongs to other nodes or to something else,
        misspells a name, or holds a value outside its range.

    """
    values = {}
    for parameters in _parameters(path, _content(path), nodes):
        values |= dict(_flattened(parameters))
    known = flat(settings)
    return {name: _checked(path, settings, known, name, value) for name, value in values.items()
            if name in known or not _is_passed_over(name)}


def settings_text(values, node=None):
    """
    Return settings as the text of a YAML file.

    Parameters
    ----------
    values : dict
        Flat names to values.
    node : str, optional
        Name of the node, `/**` for all; without it the groups have no head.

    """
    nested = {}
    for name, value in values.items():
        group, _, key = name.partition('.')
        nested.setdefault(group, {})[key] = value
    content = nested if node is None else {node: {'ros__parameters': nested}}
    return yaml.safe_dump(content, sort_keys=False)


def _content(path):
    """Return the mapping that a file holds, {} if it is empty."""
    try:
        content = load_yaml(path)
    except UnreadableError as error:
        raise SettingsError(f'{path}: {error}') from error
    if content is None:
        return {}
    if not isinstance(content, dict):
        raise SettingsError(f'{path}: holds {type(content).__name__}, expected names and values')
    if any(name in content for name in CALIBRATION_FIELDS):
        raise SettingsError(f'{path}: is the calibration of a camera (camera_info), expected '
                            'settings')
    return content


def _parameters(path, content, nodes):
    """Return the parameters of every section that counts, the content if it has no sections."""
    sections = list(_sections(content))
    if not sections:
        return [content]
    found = [parameters for name, parameters in sections if name in ('*', '**', *nodes)]
    if not found and len(sections) == 1 and sections[0][0] not in (*SENSORS, *OTHERS):
        found = [sections[0][1]]
    if not found:
        others = ', '.join(dict.fromkeys(name for name, _ in sections))
        raise SettingsError(f'{path}: holds parameters of {others}, expected those of '
                            f'{" or ".join(nodes)}')
    return found


def _sections(content):
    """Yield (last part of the node's name, its parameters); namespaces may nest."""
    for name, value in content.items():
        if not isinstance(value, dict):
            continue
        if 'ros__parameters' in value:
            parameters = value['ros__parameters'] or {}
            yield str(name).rpartition('/')[2], (
                parameters if isinstance(parameters, dict) else {'ros__parameters': parameters})
        else:
            yield from _sections(value)


def _flattened(values, prefix=''):
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _flattened(value, f'{prefix}{name}.')
        else:
            yield f'{prefix}{name}', value


def _is_passed_over(name):
    """Return whether a name belongs to a node, and not to everybody who reads its file."""
    return name.partition('.')[0] in PASSED_OVER or name in (*NODE_ONLY, *OF_PROJECTORS)


def _checked(path, settings, known, name, value):
    if name not in known:
        raise SettingsError(f'{path}: unknown setting {name!r}{suggestion(name, known)}')
    try:
        return checked_value(settings, name, value)
    except SettingsError as error:
        raise SettingsError(f'{path}: {error}') from error


def parameter_file(node_name, settings):
    """
    Return the text of a parameter file (YAML, as `ros2 param dump` writes it).

    Parameters
    ----------
    node_name : str
        The name at the top of the file.
    settings : RangeNodeSettings or PatternNodeSettings
        The values that are written.

    """
    lines = [f'/**/{node_name}:', '  ros__parameters:']  # in any namespace
    group = None
    for name, _, meta in described(settings):
        prefix, _, key = name.partition('.')
        if prefix != group:
            group = prefix
            lines.append(f'    {group}:')
        lines.append(f'      {key}: {_yaml_value(flat(settings)[name])}{_comment(meta)}')
    return '\n'.join(lines) + '\n'


def _yaml_value(value):
    if isinstance(value, str):
        return f"'{value}'"
    return str(value).lower() if isinstance(value, bool) else str(value)


def _comment(meta):
    """Return the legal values of a field as a comment."""
    if meta['choices'] is not None:
        return f'  # {", ".join(meta["choices"])}'
    if meta['minimum'] is None:
        return ''
    return f'  # {meta["minimum"]} .. {meta["maximum"]} {meta["unit"]}'.rstrip()


def write_parameter_files(folder):
    """Write the shipped parameter files, which hold the defaults."""
    for name, settings in (('range_node', RangeNodeSettings()),
                           ('pattern_node', PatternNodeSettings())):
        write_text(Path(folder) / f'{name}.yaml', parameter_file(name, settings))


if __name__ == '__main__':
    write_parameter_files(sys.argv[1])

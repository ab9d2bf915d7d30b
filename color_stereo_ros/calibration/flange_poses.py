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
"""
Files of flange poses: one line or entry for each view of the board.

CSV, with or without a first line of names; separated by commas, semicolons, tabs or blanks:

    name, x, y, z, qx, qy, qz, qw
    view_001, 0.412, -0.103, 0.551, 0.0012, 0.9239, 0.0021, 0.3827

YAML: a list of such entries, or of `translation` and `rotation` (`position` and `orientation`)
with x, y, z and x, y, z, w, as ROS prints them. `name` belongs to the image of that name; without
names the order counts.

"""

import csv
from pathlib import Path
import re

import numpy as np

from .rigid import rotations_of
from ..errors import CalibrationError
from ..files.yaml import load_yaml, read_text, UnreadableError

FIELDS = 'x', 'y', 'z', 'qx', 'qy', 'qz', 'qw'
UNITS = {'m': 1.0, 'mm': 1e-3}
YAML_SUFFIXES = {'.yaml', '.yml', '.json'}
UNIT_LENGTH = 0.01  # chosen: quaternions with three digits are nearer to length 1
PARTS = (('translation', 'position'), ('rotation', 'orientation'))


def read_flange_poses(path, unit='m'):
    """
    Read poses of the flange in the base.

    Parameters
    ----------
    path : path-like
        See above.
    unit : str
        Of x, y, z: 'm' or 'mm'.

    Returns
    -------
    names : list of (str or None)
        None where the file has no names.
    poses : (R, t)
        base_from_flange, float64 (n, 3, 3) and (n, 3), m.

    Raises
    ------
    CalibrationError
        If the file cannot be read or holds something else; names the line or the entry.

    """
    path = Path(path)
    try:
        if path.suffix.lower() in YAML_SUFFIXES:
            rows = list(_of_yaml(load_yaml(path)))
        else:
            rows = list(_of_csv(read_text(path)))
    except (UnreadableError, CalibrationError) as error:
        raise CalibrationError(f'flange poses {path}: {error}') from error
    if not rows:
        raise CalibrationError(f'flange poses {path}: holds no pose')
    values = np.array([[row[field] for field in FIELDS] for _, _, row in rows], np.float64)
    try:
        rotations = rotations_of(_unit(values[:, 3:], [place for place, _, _ in rows]))
    except CalibrationError as error:
        raise CalibrationError(f'flange poses {path}: {error}') from error
    return [name for _, name, _ in rows], (rotations, UNITS[unit] * values[:, :3])


def _unit(quaternions, places):
    """Return quaternions of length 1."""
    lengths = np.linalg.norm(quaternions, axis=1)
    for place, length, values in zip(places, lengths, quaternions):
        if not abs(length - 1) < UNIT_LENGTH:
            text = ', '.join(f'{value:g}' for value in values)
            raise CalibrationError(f'{place}: the rotation ({text}) is no unit quaternion qx, qy, '
                                   f'qz, qw; its length is {length:.3g}')
    return quaternions / lengths[:, None]


def _of_csv(text):
    """Yield (place, name or None, dict of FIELDS) for each line."""
    separator = next((each for each in ',;\t' if each in text), None)
    fields = None
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.lstrip().startswith('#'):
            continue
        cells = (next(csv.reader([line], delimiter=separator)) if separator else line.split())
        cells = [cell.strip() for cell in cells if separator or cell.strip()]
        place = f'line {number}'
        if fields is None:
            heads = [cell.lower() for cell in cells]
            if set(FIELDS) <= set(heads):
                fields = heads
                continue
            fields = _unnamed(cells, place)
        if len(cells) != len(fields):
            raise CalibrationError(f'{place}: has {len(cells)} columns, expected {len(fields)}')
        row = dict(zip(fields, cells))
        yield place, row.get('name') or None, {field: _number(row[field], f'{place}, {field}')
                                               for field in FIELDS}


def _unnamed(cells, place):
    """Return the names of the columns of a file without a line of names."""
    if len(cells) == len(FIELDS):
        return list(FIELDS)
    if len(cells) == len(FIELDS) + 1:
        return ['name', *FIELDS]
    raise CalibrationError(f'{place}: has {len(cells)} columns, expected {", ".join(FIELDS)}, '
                           'or name and these')


def _of_yaml(content):
    """Yield (place, name or None, dict of FIELDS) for each entry of a list."""
    if isinstance(content, dict) and 'poses' in content:
        content = content['poses']
    if not isinstance(content, list):
        raise CalibrationError('is no list of poses')
    for number, entry in enumerate(content, 1):
        place = f'entry {number}'
        if isinstance(entry, list) and len(entry) == len(FIELDS):
            entry = dict(zip(FIELDS, entry))
        if not isinstance(entry, dict):
            raise CalibrationError(f'{place}: is no pose, expected {", ".join(FIELDS)}')
        name = entry.get('name')
        values = _as_fields(entry)
        missing = [field for field in FIELDS if field not in values]
        if missing:
            raise CalibrationError(f'{place}: has no {", ".join(missing)}')
        yield place, None if name is None else str(name), {
            field: _number(values[field], f'{place}, {field}') for field in FIELDS}


def _as_fields(entry):
    """Return the seven fields of an entry in either of the two forms."""
    entry = entry.get('pose') or entry.get('transform') or entry
    found = dict(entry)
    for names, prefix in zip(PARTS, ('', 'q')):
        part = next((entry[name] for name in names if isinstance(entry.get(name), dict)), {})
        found.update({f'{prefix}{axis}': value for axis, value in part.items()})
    return found


def _number(value, place):
    """Return a finite number."""
    text = str(value).strip()
    if not re.fullmatch(r'[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?', text):
        raise CalibrationError(f'{place}: {value!r} is no number')
    return float(text)


def matched(names, poses, views):
    """
    Bring poses into the order of the views.

    Parameters
    ----------
    names : list of (str or None)
        Of the images; None: the name is not known.
    poses : (R, t)
        Rotations (n, 3, 3) and translations (n, 3), m.
    views : list of str
        Names of the views of the board, in their order.

    Returns
    -------
    rows : list of (int or None)
        The row of the poses for each view; None where there is none.

    Raises
    ------
    CalibrationError
        If the names do not belong to the views, or the numbers differ where there are no names.

    """
    if any(name is None for name in names):
        if len(names) != len(views):
            raise CalibrationError(
                f'{len(names)} flange poses and {len(views)} pairs of images: without names there '
                'must be one pose for each pair, in the same order')
        return list(range(len(views)))
    stems = [Path(name).stem for name in names]
    doubled = {name for name in stems if stems.count(name) > 1}
    if doubled:
        raise CalibrationError(f'{min(doubled)}: has several flange poses')
    by_name = {name: row for row, name in enumerate(stems)}
    rows = [_row(by_name, view) for view in views]
    if all(row is None for row in rows):
        raise CalibrationError(f'no flange pose belongs to an image: the poses are named '
                               f'{stems[0]} .., the images {views[0]} ..')
    return rows


def _row(by_name, view):
    """Return the row of a view, by its name or by that name without the side."""
    stem = Path(view).stem
    bare = re.sub(r'(left|right)', '', stem, flags=re.IGNORECASE).strip(' _-.')
    return by_name.get(stem, by_name.get(bare))

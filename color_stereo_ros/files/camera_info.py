# SPDX-License-Identifier: Apache-2.0
"""The YAML files in which ROS keeps a camera_info: their text and their plain fields."""

import yaml

from .yaml import load_yaml, UnreadableError

# The field of a camera_info message (but in upper case where it is a matrix): its key in the file
PLAIN_KEYS = {'width': 'image_width', 'height': 'image_height',
              'distortion_model': 'distortion_model'}
MATRIX_KEYS = {'D': 'distortion_coefficients', 'K': 'camera_matrix',
               'R': 'rectification_matrix', 'P': 'projection_matrix'}
SHAPES = {'K': (3, 3), 'R': (3, 3), 'P': (3, 4)}


def read_camera_info(path):
    """
    Return the fields of a camera_info file, unchecked.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    fields : dict
        width, height, px; distortion_model; D, K, R and P as flat lists, row by row.

    Raises
    ------
    UnreadableError
        If the file cannot be read or a field is missing; the text does not name the file.

    """
    try:
        content = load_yaml(path)
    except TypeError as error:
        raise UnreadableError(f'cannot be read: {error}') from error
    if not isinstance(content, dict):
        raise UnreadableError(f'holds a {type(content).__name__}, expected the fields of '
                              'camera_info')
    return {**{field: _found(content, key) for field, key in PLAIN_KEYS.items()},
            **{field: _matrix_data(content, key) for field, key in MATRIX_KEYS.items()}}


def _found(content, key):
    if content.get(key) is None:
        raise UnreadableError(f'has no usable field {key!r}')
    return content[key]


def _matrix_data(content, key):
    field = _found(content, key)
    if not isinstance(field, dict) or 'data' not in field:
        raise UnreadableError(f'has no usable field {key!r}')
    return field['data']


def camera_info_text(name, fields):
    """
    Return the text of a camera_info file.

    Parameters
    ----------
    name : str
        Of the camera.
    fields : dict
        As `read_camera_info` returns them.

    Returns
    -------
    text : str
        YAML.

    """
    def matrix(field):
        values = list(fields[field])
        rows, columns = SHAPES.get(field, (1, len(values)))
        return {'rows': rows, 'cols': columns, 'data': values}

    return yaml.safe_dump({
        'image_width': fields['width'], 'image_height': fields['height'], 'camera_name': name,
        'camera_matrix': matrix('K'), 'distortion_model': fields['distortion_model'],
        'distortion_coefficients': matrix('D'), 'rectification_matrix': matrix('R'),
        'projection_matrix': matrix('P')}, sort_keys=False, default_flow_style=None)

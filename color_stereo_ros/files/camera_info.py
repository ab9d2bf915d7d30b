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
"""The files in which people keep a camera_info: their plain fields, and the text of ROS's."""

import re

import yaml

from .yaml import parse_documents, read_text, UnreadableError

MATRIX_KEYS = {'D': 'distortion_coefficients', 'K': 'camera_matrix',
               'R': 'rectification_matrix', 'P': 'projection_matrix'}
WINDOW = ('binning_x', 'binning_y', 'roi')
INI_TITLES = {'width': None, 'height': None, 'camera matrix': 'K', 'distortion': 'D',
              'rectification': 'R', 'projection': 'P'}
_HOW = ('StereoCalibration.from_arrays makes a stereo calibration of them, and its to_yaml writes '
        'two camera_info files')
FOREIGN = {
    'cam0': f'is a Kalibr camchain, which has no R and P: take intrinsics, distortion_coeffs and '
            f'T_cn_cnm1; {_HOW}',
    **dict.fromkeys(('M1', 'K1', 'cameraMatrix1'),
                    "holds OpenCV's matrices of both cameras: take them with R and T of the "
                    f'extrinsics; {_HOW}')}
"""Keys of files of other programs, and what their owner can do."""
SHAPES = {'K': (3, 3), 'R': (3, 3), 'P': (3, 4)}


def read_camera_info(path):
    """
    Return the fields of a camera_info file, unchecked.

    Read are the YAML files of ROS, also with OpenCV's first line and tags or without a
    distortion model, what `ros2 topic echo` prints, and the INI files of camera_calibration
    (ost.txt).

    Parameters
    ----------
    path : path-like
        Of the file.

    Returns
    -------
    fields : dict
        width, height, px; distortion_model; D, K, R and P as flat lists, row by row. Of a printed
        message also those of binning_x, binning_y and roi that it has.

    Raises
    ------
    UnreadableError
        If the file cannot be read or a field is missing; the text does not name the file.

    """
    try:
        text = read_text(path)
    except TypeError as error:
        raise UnreadableError(f'cannot be read: {error}') from error
    if re.search(r'^camera matrix\s*$', text, re.MULTILINE):
        return _from_ini(text)
    found = [_fields(content) for content in parse_documents(text)] or [_fields(None)]
    if any(fields != found[0] for fields in found):
        raise UnreadableError(f'holds {len(found)} different camera_infos, expected one')
    return found[0]


def _fields(content):
    """Return the fields of what a document holds."""
    if content is None:
        raise UnreadableError('is empty, expected the fields of camera_info')
    if not isinstance(content, dict):
        raise UnreadableError(f'holds a {type(content).__name__}, expected the fields of '
                              'camera_info')
    for key, text in FOREIGN.items():
        if key in content:
            raise UnreadableError(text)
    if 'image_width' not in content and 'width' in content:
        return _from_message(content)
    size = {'width': _found(content, 'image_width'), 'height': _found(content, 'image_height')}
    D, K, R, P = (_matrix_data(content, MATRIX_KEYS[field]) for field in 'DKRP')
    return {**size, 'distortion_model': _model(content, D), 'D': D, 'K': K, 'R': R, 'P': P}


def _from_message(content):
    """Return the fields of a printed message; ROS 1 writes its matrices in upper case."""
    D, K, R, P = (_found(content, field if field in content else field.lower())
                  for field in 'DKRP')
    window = {field: content[field] for field in WINDOW if field in content}
    for field, value in window.items():
        parts = value.items() if field == 'roi' and isinstance(value, dict) else [(field, value)]
        if not all(isinstance(name, str) and isinstance(part, int) for name, part in parts):
            raise UnreadableError(f'has no usable field {field!r}')
    return {'width': _found(content, 'width'), 'height': _found(content, 'height'),
            'distortion_model': _found(content, 'distortion_model'), 'D': D, 'K': K, 'R': R,
            'P': P, **window}


def _from_ini(text):
    """Return the fields of an INI file: a line with a title, then lines with its numbers."""
    found, numbers = {}, []
    for line in (line.strip() for line in text.splitlines()):
        if line in INI_TITLES:
            if line in found:
                raise UnreadableError(f'holds several cameras, expected one: {line!r} is there '
                                      'twice')
            found[line] = numbers = []
        elif line and line[0] not in '#[;':
            numbers += line.split()
    for title in INI_TITLES:
        if not found.get(title) and title != 'distortion':
            raise UnreadableError(f'has no usable field {title!r}')
    try:
        (width,), (height,) = ([int(value) for value in found[title]]
                               for title in ('width', 'height'))
    except ValueError as error:
        raise UnreadableError('has no width and height in whole pixels') from error
    fields = {field: found.get(title, []) for title, field in INI_TITLES.items() if field}
    return {'width': width, 'height': height, 'distortion_model': _model({}, fields['D']),
            **fields}


def _found(content, key):
    if content.get(key) is None:
        raise UnreadableError(f'has no usable field {key!r}')
    return content[key]


def _matrix_data(content, key):
    field = _found(content, key)
    if not isinstance(field, dict) or 'data' not in field:
        raise UnreadableError(f'has no usable field {key!r}')
    return field['data']


def _model(content, D):
    """Return the distortion model; older files have another key for it, or none."""
    for key in ('distortion_model', 'camera_model'):
        model = content.get(key)
        if model is not None and model != 'pinhole':
            return model
    # as ROS and OpenCV take it
    return 'rational_polynomial' if isinstance(D, list) and len(D) > 5 else 'plumb_bob'


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

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
"""Height fields: read from a file, or made of ribs, bosses, bores and pockets like a casting."""

from pathlib import Path

import numpy as np

from .errors import SceneError

FEATURES = ('boss', 'rib', 'bore', 'pocket', 'dome', 'roof', 'wave', 'noise')


def read_relief(node):
    """Return the checked fields of a height field; heights in m, towards the cameras."""
    form = {'size': node.get('size', [0.2, 0.2]).vector(2, 1e-4, 10.0),
            'resolution': node.get('resolution', 256).integer(4, 2048),
            'fillet': node.get('fillet', 0.0).number(0.0, 0.1),
            'features': [_read_feature(entry) for entry in node.get('features', []).items()]}
    if node.has('file'):
        form['file'] = str(node.get('file').existing_file())
        form['height'] = node.get('height', 0.01).number(-1.0, 1.0)
    return form


def _read_feature(node):
    node.only('kind', 'center', 'radius', 'height', 'from', 'to', 'width', 'depth', 'size',
              'amplitude', 'wavelength', 'direction', 'seed')
    feature = {'kind': node.get('kind').choice(FEATURES)}
    if feature['kind'] in ('boss', 'bore', 'pocket', 'dome', 'roof'):
        feature['center'] = node.get('center').vector(2)
    if feature['kind'] in ('boss', 'bore', 'dome'):
        feature['radius'] = node.get('radius').number(1e-5, 10.0)
    if feature['kind'] == 'rib':
        feature.update({name: node.get(name).vector(2) for name in ('from', 'to')},
                       width=node.get('width').number(1e-5, 1.0))
    if feature['kind'] in ('pocket', 'roof'):
        feature['size'] = node.get('size').vector(2, 1e-5, 10.0)
    if feature['kind'] in ('wave', 'noise'):
        feature.update(amplitude=node.get('amplitude').number(0.0, 1.0),
                       wavelength=node.get('wavelength').number(1e-4, 10.0),
                       direction=node.get('direction', 0.0).number(-360.0, 360.0),
                       seed=node.get('seed', 1).integer(0, 2**31 - 1))
    else:
        feature['height'] = node.get('height').number(-1.0, 1.0)
    return feature


def relief_heights(form):
    """Return heights, float64 (R, R), m, row 0 at the smallest y."""
    size, resolution = form['size'], form['resolution']
    y, x = np.meshgrid(*(np.linspace(-extent / 2, extent / 2, resolution)
                         for extent in size[::-1]), indexing='ij')
    heights = _from_file(form, resolution) if 'file' in form else np.zeros_like(x)
    for feature in form['features']:
        heights = _APPLY[feature['kind']](heights, x, y, feature)
    if form['fillet'] > 0:
        import cv2
        heights = cv2.GaussianBlur(heights, (0, 0), form['fillet'] * resolution / size[0])
    return heights


def _from_file(form, resolution):
    """Return the heights of an image (white = `height`) or of a .npy array in m."""
    import cv2

    from color_stereo_ros.files.image import read_image_as_is
    if Path(form['file']).suffix == '.npy':
        heights = _array(form['file'])
    else:
        picture = read_image_as_is(form['file'])
        picture = picture if picture.ndim == 2 else picture[..., 1]
        heights = form['height'] * picture / np.iinfo(picture.dtype).max
    return cv2.resize(heights, (resolution, resolution), interpolation=cv2.INTER_LINEAR)


def _array(path):
    """Return the numbers of a .npy file, float64."""
    try:
        return np.load(path).astype(np.float64)
    except (OSError, ValueError, EOFError) as error:
        raise SceneError(f'{path}: damaged, or no .npy array of numbers') from error


def _within(x, y, feature):
    return np.hypot(x - feature['center'][0], y - feature['center'][1]) <= feature['radius']


def _boss(heights, x, y, feature):
    return np.where(_within(x, y, feature), np.maximum(heights, feature['height']), heights)


def _bore(heights, x, y, feature):
    return np.where(_within(x, y, feature), np.minimum(heights, feature['height']), heights)


def _pocket(heights, x, y, feature):
    inside = ((np.abs(x - feature['center'][0]) <= feature['size'][0] / 2)
              & (np.abs(y - feature['center'][1]) <= feature['size'][1] / 2))
    return np.where(inside, feature['height'], heights)


def _rib(heights, x, y, feature):
    start, end = np.array(feature['from']), np.array(feature['to'])
    along = end - start
    share = ((x - start[0]) * along[0] + (y - start[1]) * along[1]) / max(along @ along, 1e-12)
    share = np.clip(share, 0, 1)
    away = np.hypot(x - start[0] - share * along[0], y - start[1] - share * along[1])
    return np.where(away <= feature['width'] / 2, np.maximum(heights, feature['height']), heights)


def _dome(heights, x, y, feature):
    away = np.hypot(x - feature['center'][0], y - feature['center'][1]) / feature['radius']
    cap = feature['height'] * np.sqrt(np.clip(1 - away * away, 0, None))
    return np.where(away <= 1, np.maximum(heights, cap), heights)


def _roof(heights, x, y, feature):
    """Raise a roof: highest along the middle, zero at the left and right ends of its size."""
    away = 2 * np.abs(x - feature['center'][0]) / feature['size'][0]
    inside = (away <= 1) & (np.abs(y - feature['center'][1]) <= feature['size'][1] / 2)
    return np.where(inside, np.maximum(heights, feature['height'] * (1 - away)), heights)


def _wave(heights, x, y, feature):
    angle = np.radians(feature['direction'])
    phase = 2 * np.pi * (x * np.cos(angle) + y * np.sin(angle)) / feature['wavelength']
    return heights + feature['amplitude'] * np.sin(phase)


def _noise(heights, x, y, feature):
    import cv2
    noise = np.random.default_rng(feature['seed']).standard_normal(heights.shape)
    step = abs(x[0, 1] - x[0, 0])
    noise = cv2.GaussianBlur(noise, (0, 0), max(feature['wavelength'] / 4 / step, 0.3))
    return heights + feature['amplitude'] * noise / noise.std()


_APPLY = {'boss': _boss, 'rib': _rib, 'bore': _bore, 'pocket': _pocket, 'dome': _dome,
          'roof': _roof, 'wave': _wave, 'noise': _noise}


def relief_mesh(form):
    """
    Return the triangles of a height field.

    Returns
    -------
    vertices : numpy.ndarray, float64, shape (V, 3)
        m; heights point to -z, at the cameras.
    faces : numpy.ndarray, int32, shape (F, 3)
    uv : numpy.ndarray, float64, shape (V, 2)

    """
    heights = relief_heights(form)
    rows, columns = heights.shape
    v, u = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing='ij')
    x, y = (u - 0.5) * form['size'][0], (v - 0.5) * form['size'][1]
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b = index[:-1, :-1].ravel(), index[:-1, 1:].ravel()
    c, d = index[1:, :-1].ravel(), index[1:, 1:].ravel()
    # This order turns the normals towards -z.
    faces = np.concatenate([np.column_stack([a, c, b]), np.column_stack([b, c, d])])
    vertices = np.column_stack([x.ravel(), y.ravel(), -heights.ravel()])
    return vertices, faces.astype(np.int32), np.column_stack([u.ravel(), v.ravel()])

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
Rectified pairs with truth, such as photographs of real rigs, beside OpenCV's matchers.

`python -m color_stereo_ros.evaluation.photographs FOLDER` reads all `*.npz` of a folder. Each
holds `left` and `right` (uint8, (H, W) or (H, W, 3) RGB, rectified), `truth` (disparity of the
left image, px, NaN = unknown), `limits` (smallest and largest disparity that is searched, px) and
`pattern` (JSON, settings that name the pattern as it is). Real rigs give such pairs where the
cameras saw a sequence: the whole sequence tells the truth, three of its images as red, green and
blue make a pair.

"""

import argparse
import json
from pathlib import Path
import sys

import numpy as np
from tqdm import tqdm

from . import opencv_matchers
from .metrics import RIGHT, share, SURE, z68
from ..core import ColorStereo, Settings, StereoCalibration
from ..core.cameras.rectification import Rectifier
from ..files.atomic import write_text

FOCAL, BASELINE = 1000.0, 0.1
"""Of the assumed rig, px and m: only disparities are compared."""
NEAREST = 0.2
"""Least disparity of the working range, px: a depth must be finite."""
COLUMNS = (('right', '{:.3f}'), ('density', '{:.3f}'), ('wrong', '{:.3f}'), ('hi', '{:.4f}'),
           ('median_px', '{:.3f}'), ('z68', '{:.2f}'))


def calibration_of(shape):
    """Return the StereoCalibration of rectified images of a shape (H, W)."""
    height, width = shape
    camera = np.array([[FOCAL, 0, (width - 1) / 2], [0, FOCAL, (height - 1) / 2], [0, 0, 1]])
    return StereoCalibration.from_arrays((width, height), camera, None, camera, None, np.eye(3),
                                         [-BASELINE, 0, 0])


def figures(result, truth):
    """
    Return by how much a result agrees with a truth.

    Parameters
    ----------
    result : RangeResult
        Its disparity, standard deviation and confidence are judged.
    truth : numpy.ndarray, float, shape (H, W)
        Disparity, px; NaN = unknown.

    Returns
    -------
    figures : dict
        `right`, `density` (shares of all pixels with truth), `wrong` (share of those with a range
        that are off by more than 1 px), `hi` (the same above a confidence of .9), `median_px`,
        `z68`. None where nothing can be said.

    """
    known = np.isfinite(truth)
    given = known & np.isfinite(result.disparity)
    error = np.abs(result.disparity - truth)
    off, sure = given & (error > RIGHT), given & (result.confidence > SURE)
    return {'right': share(given & ~off, known), 'density': share(given, known),
            'wrong': share(off, given), 'hi': share(off & sure, sure),
            'median_px': float(np.median(error[given])) if given.any() else None,
            'z68': z68(error, result.disparity_std, given)}


def measured(path, matchers):
    """
    Measure one pair.

    Parameters
    ----------
    path : path
        Of an .npz file.
    matchers : sequence of str
        Names of OpenCV's matchers, see `opencv_matchers.METHODS`.

    Returns
    -------
    rows : dict of str to dict
        By 'named', 'unknown' and the matchers; see `figures`.

    Raises
    ------
    ValueError
        If an array is missing.

    """
    with np.load(path) as arrays:
        missing = {'left', 'right', 'truth', 'limits', 'pattern'} - set(arrays)
        if missing:
            raise ValueError(f'{path} lacks {", ".join(sorted(missing))}')
        left, right, truth = arrays['left'], arrays['right'], arrays['truth']
        low, high = (float(each) for each in arrays['limits'])
        pattern = json.loads(str(arrays['pattern']))
    calibration = calibration_of(truth.shape)
    limits = {'range.min_depth': FOCAL * BASELINE / high,
              'range.max_depth': FOCAL * BASELINE / max(low, NEAREST)}
    rows = {}
    for name, kind in (('named', pattern), ('unknown', {'pattern.type': 'unknown'})):
        stereo = ColorStereo(calibration, Settings().updated({**limits, **kind}))
        rows[name] = figures(stereo.process(left, right), truth)
    colors = [image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)
              for image in (left, right)]
    pair = Rectifier(calibration).rectify(*colors)
    for name in matchers:
        found = opencv_matchers.match(name, pair, Settings().updated(limits).range)
        rows[name] = {**figures(found, truth), 'hi': None}  # OpenCV claims nothing
    return rows


def line(title, row):
    """Return one line of the table."""
    return f'{title:36}' + ''.join(
        f'{"-" if row[name] is None else form.format(row[name]):>11}' for name, form in COLUMNS)


def main(argv=None):
    """Print the table; return the exit status."""
    parser = argparse.ArgumentParser(
        prog='python -m color_stereo_ros.evaluation.photographs',
        description='Measure rectified pairs with truth beside the matchers of OpenCV.')
    parser.add_argument('folder', type=Path, metavar='FOLDER', help='holds the .npz files')
    parser.add_argument('names', nargs='*', metavar='NAME',
                        help='only files with it in their name')
    parser.add_argument('--matchers', default='sgbm,3way', metavar='A,B',
                        help='of OpenCV (default %(default)s)')
    parser.add_argument('--output', type=Path, metavar='FILE', help='write the figures as JSON')
    args = parser.parse_args(argv)
    paths = [path for path in sorted(args.folder.glob('*.npz'))
             if not args.names or any(name in path.stem for name in args.names)]
    if not paths:
        parser.error(f'{args.folder} holds no such .npz file')
    everything = {}
    print(f'{"":36}' + ''.join(f'{name:>11}' for name, _ in COLUMNS))
    for path in tqdm(paths, unit='pair', disable=None):
        rows = everything[path.stem] = measured(path, [
            name for name in args.matchers.split(',') if name])
        for name, row in rows.items():
            tqdm.write(line(f'{path.stem} {name}', row))
    for name in next(iter(everything.values())):
        right = [rows[name]['right'] for rows in everything.values()]
        print(f'mean of {len(right)} pairs, {name}: right {np.mean(right):.3f}')
    if args.output:
        write_text(args.output, json.dumps(everything, indent=1) + '\n')
    return 0


if __name__ == '__main__':
    sys.exit(main())

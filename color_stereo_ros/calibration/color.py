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
The colors of two cameras from images of a white card under frames of light.

Each camera sees white, black, red, green, blue, a mask and its complement. In this order follow
from these: dark level, response, gain field, white, crosstalk, chromatic aberration. All but the
first are measured in linear light above black, so that ambient light does not count.

"""

from dataclasses import dataclass

import cv2
import numpy as np

from .response import fit_response, Response
from ..core.color_calibration import CameraColor, ColorCalibration, ColorCorrection, linear
from ..errors import CalibrationError, ImageError

CHANNELS = 'red', 'green', 'blue'
FRAMES = 'white', 'black', *CHANNELS, 'mask', 'complement'
DARK = 'dark'
"""The frame that may be there in addition: the lens is covered."""
FULL_SCALE = 255.0
OVEREXPOSED = 250.0
"""DN: images above are of no use."""
_LEAST_LIGHT = 0.08
"""Least white above black of a pixel that counts, share of the brightest pixels' one."""
_LEAST_CONTRAST = 20.0
"""Least white above black of the brightest pixels, DN."""
_LEAST_LIT = 0.1
_MOST_OVEREXPOSED = 0.02
_DARK_PERCENTILE, _DARK_CELL = 2.0, 16
_GRID = 9, 7
_FULL_COVER = 0.8
_STEP = 3  # px between pixels that are read
_EDGE = 0.05
"""Least slope of the mask where aberration is read, share of white per px."""
_BLUR = 1.5
_MEAN = 3  # px


@dataclass(frozen=True, eq=False)
class CameraFindings:
    """What was found beside the CameraColor, for the report."""

    response: Response
    lit: float
    """Share of the pixels that the projector lights."""
    uneven: float
    """Ratio of the largest and the smallest factor of the gain field."""
    excess: np.ndarray
    """float64 (3,): white light less red, green and blue together, share of white."""


@dataclass(frozen=True, eq=False)
class ColorFindings:
    """A color calibration and what it gains."""

    calibration: ColorCalibration
    left: CameraFindings
    right: CameraFindings
    before: dict
    """Frame to the difference of the two cameras' mean colors, share of white (RMS)."""
    after: dict
    """The same in corrected images."""


def calibrate_color(left, right, focal_lengths=((), ())):
    """
    Return the ColorFindings of two cameras.

    Parameters
    ----------
    left, right : dict
        Names of `FRAMES` to raw images, RGB in DN, uint8 or float (H, W, 3); perhaps `DARK`.
    focal_lengths : sequence of two
        fx and fy of the left and the right camera, px; () = not known.

    Raises
    ------
    CalibrationError, ImageError
        If a frame is missing, too dark or overexposed, has another size, or frames do not belong
        together; the text names camera and frame.

    """
    cameras, findings = [], []
    for side, images, focal in zip(('left', 'right'), (left, right), focal_lengths):
        images = checked_frames(side, images)
        try:
            camera, found = calibrate_camera(images, focal)
        except CalibrationError as error:
            raise CalibrationError(f'{side}: {error}') from error
        cameras.append(camera)
        findings.append(found)
    calibration = ColorCalibration(*cameras)
    differences = color_differences(calibration, left, right)
    return ColorFindings(calibration, *findings, *differences)


def checked_frames(side, images):
    """Return the frames as float64 images, or raise what `calibrate_color` raises."""
    missing = [name for name in FRAMES if name not in images]
    if missing:
        raise CalibrationError(f'{side}: the frame {missing[0]!r} is missing; needed are '
                               f'{", ".join(FRAMES)}')
    shape = np.shape(images['white'])
    for name, image in images.items():
        if np.ndim(image) != 3 or np.shape(image)[2] != 3 or np.shape(image) != shape:
            raise ImageError(f'{side}: {name} has the shape {np.shape(image)}, expected '
                             f'{shape[:2]} and 3 colors as white has')
    return {name: np.asarray(image, np.float64) for name, image in images.items()}


def calibrate_camera(images, focal_length=()):
    """
    Return what is known of the colors of one camera.

    Parameters
    ----------
    images : dict
        Names of frames to float64 (H, W, 3), RGB, DN.
    focal_length : tuple
        fx and fy, px, or ().

    Returns
    -------
    camera : CameraColor
    findings : CameraFindings

    """
    height, width = images['white'].shape[:2]
    lit = lit_pixels(images)
    dark = dark_levels(images)
    levels = {name: (image - dark) / (FULL_SCALE - dark) for name, image in images.items()}
    response = camera_response(levels, lit)
    light = {name: linear(level, response.gamma, response.offset)
             for name, level in levels.items()}
    above = {name: light[name] - light['black'] for name in FRAMES}
    field, white, uneven = white_and_field(above['white'], lit)
    crosstalk, excess = crosstalk_of(above, lit)
    aberration = aberration_of(above, lit, crosstalk)
    camera = CameraColor((width, height), focal_length, dark, response.gamma, response.offset,
                         white, crosstalk, field, aberration)
    return camera, CameraFindings(response, float(lit.mean()), uneven, excess)


def lit_pixels(images):
    """Return the pixels that the projector lights and that are not overexposed, bool (H, W)."""
    contrast = (images['white'] - images['black']).min(axis=-1)
    most = float(np.percentile(contrast, 99))
    if most < _LEAST_CONTRAST:
        raise CalibrationError(f'white is {most:.0f} DN brighter than black in the weakest '
                               f'channel, expected at least {_LEAST_CONTRAST:.0f} DN: expose '
                               'longer, or darken the room')
    lit = contrast > _LEAST_LIGHT * most
    over = images['white'].max(axis=-1) >= OVEREXPOSED
    share = np.count_nonzero(over & lit) / max(np.count_nonzero(lit), 1)
    if share > _MOST_OVEREXPOSED:
        raise CalibrationError(f'white is overexposed in {share:.0%} of the lit pixels: expose '
                               'for a shorter time')
    for name in CHANNELS:
        brighter = (images[name][lit] > images['white'][lit] + 0.1 * most).mean()
        if brighter > 0.2:
            raise CalibrationError(f'{name} is brighter than white: are frames exchanged, or did '
                                   'the exposure change in between?')
    lit &= ~over
    if lit.mean() < _LEAST_LIT:
        raise CalibrationError(f'the projector lights {lit.mean():.0%} of the image, expected at '
                               f'least {_LEAST_LIT:.0%}: bring the card closer to the overlap of '
                               'projector and cameras')
    return lit


def dark_levels(images):
    """Return the signal of each channel without light, float64 (3,), DN."""
    if DARK in images:
        return images[DARK].mean(axis=(0, 1))
    black = images['black']
    size = tuple(max(1, count // _DARK_CELL) for count in black.shape[1::-1])
    cells = cv2.resize(black, size, interpolation=cv2.INTER_AREA).reshape(-1, 3)
    return np.percentile(cells, _DARK_PERCENTILE, axis=0)


def camera_response(levels, lit):
    """Return the Response of the three channels together."""
    names = 'mask', 'complement', 'white', 'black'
    # noise would bend what is no straight line; where the mask is even, a mean is a level
    means = {name: cv2.blur(levels[name], (_MEAN, _MEAN)) for name in names}
    steep = np.maximum(*(np.abs(cv2.Sobel(means['mask'], cv2.CV_64F, *order, scale=1 / 8)).max(
        axis=-1) for order in ((1, 0), (0, 1))))
    contrast = (means['white'] - means['black']).max(axis=-1)
    even = lit & (steep < _EDGE * contrast)
    even[::2] = even[:, ::2] = False
    return fit_response(*(means[name][even].ravel() for name in names))


def white_and_field(white, lit):
    """
    Return the gain field, the white of the camera, and how uneven the field is.

    The field holds differences of the channels only: what is common to them is the light of the
    projector on the card.

    Parameters
    ----------
    white : numpy.ndarray, float64, shape (H, W, 3)
        Linear light above black.
    lit : numpy.ndarray, bool, shape (H, W)
        Where the projector lights the card.

    Returns
    -------
    field : numpy.ndarray, float64, shape (7, 9, 3)
    white : numpy.ndarray, float64, shape (3,)
    uneven : float

    """
    height, width = lit.shape
    rows, columns = np.nonzero(lit[::_STEP, ::_STEP])
    logarithms = np.log(np.maximum(white[::_STEP, ::_STEP][rows, columns], 1e-6))
    x = 2 * _STEP * columns / (width - 1) - 1
    y = 2 * _STEP * rows / (height - 1) - 1
    degree = 4 if lit.mean() > _FULL_COVER else 2
    balance = logarithms - logarithms.mean(axis=1, keepdims=True)
    center = np.median(balance, axis=0)
    terms = polynomial(x, y, degree)
    coefficients = np.linalg.lstsq(terms, balance - center, rcond=None)[0]
    grid_x, grid_y = np.meshgrid(np.linspace(-1, 1, _GRID[0]), np.linspace(-1, 1, _GRID[1]))
    field = polynomial(grid_x.ravel(), grid_y.ravel(), degree) @ coefficients
    field -= field.mean(axis=1, keepdims=True)
    common = np.median(logarithms - terms @ coefficients, axis=0)
    seen = terms @ coefficients
    uneven = float(np.exp(np.percentile(seen, 99.5) - np.percentile(seen, 0.5)))
    return np.exp(field).reshape(_GRID[1], _GRID[0], 3), np.exp(common), uneven


def polynomial(x, y, degree):
    """Return the terms x^i y^j up to a degree, float64 (N, terms)."""
    return np.stack([x ** i * y ** j for i in range(degree + 1) for j in range(degree + 1 - i)],
                    axis=-1)


def crosstalk_of(above, lit):
    """
    Return the crosstalk matrix, and by what white exceeds the sum of the three lights.

    Parameters
    ----------
    above : dict
        Names to float64 (H, W, 3), linear light above black.
    lit : numpy.ndarray, bool, shape (H, W)
        Where the projector lights the card.

    Returns
    -------
    crosstalk : numpy.ndarray, float64, shape (3, 3)
        Share of each light (column) in each channel (row); rows add up to 1.
    excess : numpy.ndarray, float64, shape (3,)

    """
    white = above['white'][lit]
    shares = np.stack([np.median(above[name][lit] / white, axis=0) for name in CHANNELS], axis=1)
    sums = shares.sum(axis=1)
    crosstalk = shares / sums[:, None]
    if np.any(np.argmax(crosstalk, axis=1) != np.arange(3)) or np.linalg.cond(crosstalk) > 50:
        raise CalibrationError('the frames red, green and blue do not light mainly the channel '
                               'of that name: are frames or channels (RGB, BGR) exchanged? '
                               f'Shares per channel: {np.round(crosstalk, 2).tolist()}')
    return crosstalk, 1 - sums


def aberration_of(above, lit, crosstalk):
    """
    Return by how much red and blue are magnified more than green, float64 (2,).

    R(p) = G(p - a (p - c) - t): a from the edges of the mask by least squares; the shift t is
    that of the projector.

    """
    share = (above['mask'] / np.maximum(above['white'], 1e-6)) @ np.linalg.inv(crosstalk).T
    share = cv2.GaussianBlur(np.where(lit[..., None], share, 0.0), (0, 0), _BLUR)
    inside = cv2.erode(lit.astype(np.uint8), np.ones((15, 15), np.uint8), borderValue=0) > 0
    slope_x, slope_y = (cv2.Sobel(share[..., 1], cv2.CV_64F, *order, scale=1 / 8)
                        for order in ((1, 0), (0, 1)))
    used = inside & (np.hypot(slope_x, slope_y) > _EDGE)
    if np.count_nonzero(used) < 1000:
        return np.zeros(2)
    rows, columns = np.nonzero(used)
    x, y = columns - 0.5 * (lit.shape[1] - 1), rows - 0.5 * (lit.shape[0] - 1)
    slopes = np.stack([slope_x[used], slope_y[used]], axis=1)
    terms = np.column_stack([-(x * slopes[:, 0] + y * slopes[:, 1]), -slopes])
    found = [_robust(terms, (share[..., channel] - share[..., 1])[used]) for channel in (0, 2)]
    return np.array([solution[0] for solution in found])


def _robust(terms, values):
    """Return a least-squares solution in which outliers count little."""
    weight = np.ones(len(values))
    for _ in range(5):
        solution = np.linalg.lstsq(terms * weight[:, None], values * weight, rcond=None)[0]
        errors = np.abs(values - terms @ solution)
        weight = 1 / np.sqrt(1 + (errors / (2 * np.median(errors) + 1e-9)) ** 2)
    return solution


def color_differences(calibration, left, right):
    """
    Return by how much the colors of the two cameras differ under each light.

    Parameters
    ----------
    calibration : ColorCalibration
        Of the colors of both cameras.
    left, right : dict
        As `calibrate_color` takes them.

    Returns
    -------
    before, after : dict
        Frame to the root mean square, over the channels, of the difference of the mean colors.
        Each is a share of the sum of channels: brightness does not count.

    """
    correction = ColorCorrection(calibration)
    before, after = {}, {}
    for name in ('white', *CHANNELS):
        raw = [np.clip(np.rint(images[name]), 0, 255).astype(np.uint8)
               for images in (left, right)]
        blacks = [np.clip(np.rint(images['black']), 0, 255).astype(np.uint8)
                  for images in (left, right)]
        before[name] = _difference(raw, blacks)
        after[name] = _difference(correction.apply(*raw), correction.apply(*blacks))
    return before, after


def _difference(images, blacks):
    """Return the root mean square of the difference of two mean colors above black."""
    colors = [np.maximum(image.mean(axis=(0, 1)) - black.mean(axis=(0, 1)), 0)
              for image, black in zip(images, blacks)]
    shares = [color / max(color.sum(), 1e-6) for color in colors]
    return float(np.sqrt(np.mean((shares[0] - shares[1]) ** 2)))

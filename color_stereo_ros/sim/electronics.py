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
"""From radiance to the numbers of a single-chip camera."""

import cv2
import numpy as np

AUTO_EXPOSURE_SHARE = 0.84       # of full scale ...
AUTO_EXPOSURE_PERCENTILE = 99.0  # ... that this percentile of the brightest channel reaches
BAYER_CHANNELS = {'RGGB': (0, 1, 1, 2), 'BGGR': (2, 1, 1, 0),
                  'GRBG': (1, 0, 2, 1), 'GBRG': (1, 2, 0, 1)}


def exposures_for(radiances, cameras):
    """Return the exposure of each camera; automatic ones share the value that suits them all."""
    automatic = [(radiance * np.asarray(camera.sensitivity)).max(axis=-1).ravel()
                 for radiance, camera in zip(radiances, cameras) if camera.exposure == 0]
    common = _automatic_exposure(np.concatenate(automatic)) if automatic else 0.0
    return tuple(camera.exposure or common for camera in cameras)


def _automatic_exposure(signal):
    brightest = signal.max()
    if brightest <= 0:
        return 1.0
    lit = signal[signal > 0.02 * brightest]
    return AUTO_EXPOSURE_SHARE / np.percentile(lit, AUTO_EXPOSURE_PERCENTILE)


def expose(radiance, camera, exposure, seed):
    """
    Turn radiance into a raw image.

    Parameters
    ----------
    radiance : numpy.ndarray, float64, shape (H, W, 3)
        What arrives at the sensor, linear light.
    camera : Camera
        The simulated camera.
    exposure : float
        Share of full scale at radiance 1.
    seed : int
        Of the noise.

    Returns
    -------
    image : numpy.ndarray, shape (H, W, 3)
        RGB; (H, W) without demosaicing. uint8 up to 8 bits, 255 = white; uint16 above, the
        numbers of the converter.

    """
    generator = np.random.default_rng(seed)
    light = _optics(radiance, camera) * exposure
    signal = light @ _color_matrix(camera).T
    mosaic = signal if camera.bayer == 'none' else _mosaic(signal, camera.bayer)
    digital = _digitize(mosaic, camera, generator)
    if camera.bayer == 'none' or camera.demosaicing == 'none':
        return digital
    return _demosaic(digital, camera)


def _optics(radiance, camera):
    """Apply lens blur and vignetting."""
    light = radiance
    if camera.lens_blur > 0:
        light = cv2.GaussianBlur(light, (0, 0), camera.lens_blur)
    if camera.vignetting > 0:
        y, x = np.indices(camera.shape, np.float64)
        y = (y - camera.K[1, 2]) / camera.K[1, 1]
        x = (x - camera.K[0, 2] - camera.K[0, 1] * y) / camera.K[0, 0]
        square = x ** 2 + y ** 2
        natural = 1 / (1 + square) ** 2  # cos^4 of the angle to the axis
        light = light * (1 - camera.vignetting * (1 - natural))[..., None]
    return light


def _color_matrix(camera):
    """Return the matrix from light to the signals of R, G and B pixels."""
    mix = np.full((3, 3), camera.crosstalk) + np.eye(3) * (1 - 3 * camera.crosstalk)
    return np.asarray(camera.sensitivity)[:, None] * mix


def _mosaic(signal, layout):
    mosaic = np.empty(signal.shape[:2])
    for index, channel in enumerate(BAYER_CHANNELS[layout]):
        row, column = divmod(index, 2)
        mosaic[row::2, column::2] = signal[row::2, column::2, channel]
    return mosaic


def _digitize(signal, camera, generator):
    """Add noise, apply the response and quantize; signal 1 = full scale."""
    noisy = signal
    if camera.speckle > 0:
        noisy = noisy * (1 + camera.speckle * generator.standard_normal(signal.shape))
    electrons = np.clip(noisy, 0, 1.5) * camera.full_well
    electrons = electrons + np.sqrt(electrons) * generator.standard_normal(signal.shape)
    electrons = electrons + camera.read_noise * generator.standard_normal(signal.shape)
    highest = 2 ** camera.bits - 1
    dark = camera.dark_level / 255
    level = _response(electrons / camera.full_well, camera.response) + dark
    kind = np.uint8 if camera.bits <= 8 else np.uint16
    digital = np.clip(np.round(level * highest), 0, highest).astype(kind)
    return digital << max(0, 8 - camera.bits)  # few bits are the upper ones of a byte


def _response(level, response):
    if response == 'linear':
        return level
    positive = np.clip(level, 0, None)
    if response == 'srgb':
        return np.where(positive <= 0.0031308, 12.92 * positive,
                        1.055 * positive ** (1 / 2.4) - 0.055)
    return positive ** (1 / response)


def _demosaic(mosaic, camera):
    # OpenCV names a layout by the second row, second and third pixel.
    code = {'RGGB': 'BG', 'BGGR': 'RG', 'GRBG': 'GB', 'GBRG': 'GR'}[camera.bayer]
    suffix = '_EA' if camera.demosaicing == 'edge_aware' else ''
    return cv2.cvtColor(mosaic, getattr(cv2, f'COLOR_Bayer{code}2RGB{suffix}'))

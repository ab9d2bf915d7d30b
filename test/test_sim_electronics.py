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
"""The simulated cameras: exposure, color, noise, response, bits, mosaic."""

from dataclasses import replace

from color_stereo_ros.sim.electronics import BAYER_CHANNELS, expose, exposures_for

import cv2

import numpy as np

import pytest

from sim_scenes import CARD, QUIET, scene_of, SIZE, small_rig


def camera(**fields):
    return scene_of(CARD, rig=small_rig(**{**QUIET, 'dark_level': 0, 'sensitivity': [1, 1, 1],
                                           **fields})).rig.left


def flat(level):
    """Return an image of one radiance, a number or three."""
    return np.broadcast_to(np.asarray(level, float), (SIZE, SIZE, 3)).copy()


def test_full_scale_is_255_and_half_of_it_is_half():
    image = expose(flat([1.0, 0.5, 0.25]), camera(bayer='none'), 1.0, 0)
    assert image.dtype == np.uint8
    np.testing.assert_allclose(image.mean(axis=(0, 1)), [255, 128, 64], atol=1)


def test_exposure_scales_the_light():
    assert expose(flat(0.2), camera(bayer='none'), 2.0, 0).mean() == pytest.approx(102, abs=1)


def test_automatic_exposure_leaves_room_above_the_bright_parts_and_is_common_to_both_cameras():
    bright, dark = flat(0.1), flat(0.1)
    bright[:20] = 4.0
    cameras = camera(exposure='auto'), camera(exposure='auto')
    exposures = exposures_for((bright, dark), cameras)
    assert exposures[0] == exposures[1] == pytest.approx(0.84 / 4.0)


def test_a_fixed_exposure_stays():
    assert exposures_for((flat(1), flat(1)), (camera(exposure=0.3), camera(exposure=0.7))) == (
        0.3, 0.7)


def test_automatic_exposure_of_darkness_is_finite():
    assert exposures_for((flat(0),), (camera(exposure='auto'),)) == (1.0,)


def test_the_dark_level_is_what_a_camera_shows_without_light():
    assert (expose(flat(0), camera(dark_level=7), 1.0, 0) == 7).all()


def test_sensitivity_scales_each_channel():
    image = expose(flat(0.8), camera(bayer='none', sensitivity=[1.0, 0.75, 0.5]), 1.0, 0)
    np.testing.assert_allclose(image.mean(axis=(0, 1)), [204, 153, 102], atol=1)


def test_crosstalk_lets_each_channel_see_the_other_colors():
    image = expose(flat([1.0, 0, 0]), camera(bayer='none', crosstalk=0.1), 1.0, 0)
    np.testing.assert_allclose(image.mean(axis=(0, 1)), [0.8 * 255, 25.5, 25.5], atol=1)


def test_vignetting_is_the_fourth_power_of_the_cosine():
    image = expose(flat(1.0), camera(bayer='none', vignetting=1.0, bits=16), 0.9, 0)
    tangent = np.hypot(*(2 * [SIZE / 2 - 0.5])) / 120
    expected = np.cos(np.arctan(tangent)) ** 4
    assert image[0, 0, 0] / image[48, 48, 0] == pytest.approx(expected, rel=2e-3)


def test_lens_blur_spreads_a_point_by_its_standard_deviation():
    point = flat(0)
    point[48, 48] = 1.0
    image = expose(point, camera(bayer='none', lens_blur=2.0, bits=16), 1.0, 0)[..., 0].astype(
        float)
    columns = np.arange(SIZE) - 48
    assert np.sqrt((image.sum(axis=0) * columns ** 2).sum() / image.sum()) == pytest.approx(
        2.0, abs=0.1)


@pytest.mark.parametrize('layout', sorted(BAYER_CHANNELS))
def test_the_mosaic_shows_the_named_color_at_each_of_the_four_places(layout):
    image = expose(flat([0.8, 0.4, 0.2]), camera(bayer=layout, demosaicing='none'), 1.0, 0)
    assert image.ndim == 2
    levels = {'R': 204, 'G': 102, 'B': 51}
    for index, letter in enumerate(layout):
        assert (image[index // 2::2, index % 2::2] == levels[letter]).all()


@pytest.mark.parametrize('layout', sorted(BAYER_CHANNELS))
@pytest.mark.parametrize('demosaicing', ['bilinear', 'edge_aware'])
def test_demosaicing_restores_a_uniform_color(layout, demosaicing):
    image = expose(flat([0.8, 0.4, 0.2]), camera(bayer=layout, demosaicing=demosaicing), 1.0, 0)
    inner = image[2:-2, 2:-2].astype(int)
    assert np.abs(inner - (204, 102, 51)).max() <= 1


def test_shot_noise_grows_with_the_root_of_the_light():
    noisy = camera(bayer='none', full_well=1000, bits=16)
    for level in (0.1, 0.4, 0.9):
        electrons = expose(flat(level), noisy, 1.0, 5) / 65535 * 1000
        assert electrons.std() == pytest.approx(np.sqrt(level * 1000), rel=0.03)


def test_read_noise_does_not_depend_on_the_light():
    noisy = camera(bayer='none', full_well=1e7, read_noise=1e5, bits=16, dark_level=20)
    dark = expose(flat(0.0), noisy, 1.0, 5).std() / 65535
    assert dark == pytest.approx(0.01, rel=0.05)


def test_speckle_is_a_share_of_the_light():
    noisy = camera(bayer='none', speckle=0.06, bits=16)
    for level in (0.2, 0.7):
        image = expose(flat(level), noisy, 1.0, 5) / 65535
        assert image.std() / level == pytest.approx(0.06, rel=0.03)


def test_noise_of_neighbors_is_independent():
    image = expose(flat(0.5), camera(bayer='none', speckle=0.06, bits=16), 1.0, 5)[..., 1]
    noise = image - image.mean()
    correlation = (noise[:, 1:] * noise[:, :-1]).mean() / noise.var()
    assert abs(correlation) < 0.05


def test_gamma_and_srgb_are_the_known_curves():
    for response, expected in ((2.2, 0.2 ** (1 / 2.2)), ('srgb', 1.055 * 0.2 ** (1 / 2.4) - 0.055),
                               ('linear', 0.2)):
        image = expose(flat(0.2), camera(bayer='none', response=response), 1.0, 0)
        assert image.mean() == pytest.approx(255 * expected, abs=1)


def test_srgb_is_linear_near_black():
    image = expose(flat(0.002), camera(bayer='none', response='srgb', bits=16), 1.0, 0)
    # shot noise of 1e7 electrons is 0.0001 of full scale here
    assert image.mean() / 65535 == pytest.approx(12.92 * 0.002, rel=0.01)


@pytest.mark.parametrize('bits, dtype, white', [
    (4, np.uint8, 240), (8, np.uint8, 255), (12, np.uint16, 4095), (16, np.uint16, 65535)])
def test_bits_say_how_many_steps_there_are(bits, dtype, white):
    ramp = np.repeat(np.linspace(0, 1.2, SIZE)[None, :, None], SIZE, axis=0) * np.ones(3)
    image = expose(ramp, camera(bayer='none', bits=bits), 1.0, 0)
    assert image.dtype == dtype and image.max() == white
    assert len(np.unique(image)) <= 2 ** bits


def test_more_light_than_the_well_holds_is_white():
    assert (expose(flat(5.0), camera(), 1.0, 0) == 255).all()


def test_demosaicing_needs_no_more_than_eight_or_sixteen_bits():
    image = expose(flat(0.5), camera(bits=12), 1.0, 0)
    assert image.dtype == np.uint16
    assert image[5:-5, 5:-5].mean() == pytest.approx(0.5 * 4095, rel=0.01)


def test_the_same_seed_repeats_the_noise():
    noisy = replace(camera(), speckle=0.05)
    first, again, other = (expose(flat(0.5), noisy, 1.0, seed) for seed in (1, 1, 2))
    assert (first == again).all() and (first != other).any()


def test_the_bilinear_mosaic_is_that_of_opencv():
    light = cv2.resize(np.random.default_rng(0).random((12, 12, 3)), (SIZE, SIZE))
    raw = expose(light, camera(demosaicing='none'), 1.0, 0)
    full = expose(light, camera(), 1.0, 0)
    np.testing.assert_array_equal(full, cv2.cvtColor(raw, cv2.COLOR_BayerRGGB2RGB))

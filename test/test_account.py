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
"""The account of a measurement: shares that add up, and doubts only where something is wrong."""

from dataclasses import replace
from types import SimpleNamespace

from color_stereo_ros.cli import main as cli
from color_stereo_ros.core import (
    ColorStereo, PatternSettings, Settings, Status, StereoCalibration)
from color_stereo_ros.core.account import (
    doubt_about_projector, doubts_about_features, doubts_about_images, doubts_about_result,
    exposure_of, main_reason, rows_in_words, status_shares)
from color_stereo_ros.core.patterns.feature_size import feature_size_in, FIELDS
from color_stereo_ros.core.projector import Reason, Track
from color_stereo_ros.files.image import write_image

import cv2

import numpy as np

from projected import projector

import pytest

from ros_rig import calibration, PAPER, scene

from surface_pairs import exposed, photographed

SHAPE = 6, 8
SURFACE = {**PAPER, 'matching.method': 'surface'}


@pytest.fixture(scope='module')
def stereo():
    return ColorStereo(calibration(), Settings().updated(SURFACE))


@pytest.fixture
def pair(tmp_path):
    """Return the arguments of `color_stereo process` for a pair of images of the tiny rig."""
    def written(left, right, yamls=('left.yaml', 'right.yaml')):
        calibration().to_yaml(tmp_path / 'left.yaml', tmp_path / 'right.yaml')
        write_image(tmp_path / 'left.png', left)
        write_image(tmp_path / 'right.png', right)
        options = [word for name, value in SURFACE.items() for word in (f'--{name}', str(value))]
        return ['process', str(tmp_path / 'left.png'), str(tmp_path / 'right.png'),
                '--calibration', *(str(tmp_path / name) for name in yamls),
                '--output', str(tmp_path / 'out'), *options]
    return written


def gray(image):
    return np.repeat(image.mean(axis=2, keepdims=True), 3, axis=2).astype(np.uint8)


def test_the_shares_of_the_status_add_up_to_one():
    status = np.full(SHAPE, Status.DARK, np.uint8)
    status[0] = Status.VALID
    status[1, :4] = Status.OUT_OF_RANGE
    shares = status_shares(status)
    assert list(shares) == [code.label for code in Status]
    assert shares['valid'] == 8 / 48 and shares['out of range'] == 4 / 48
    assert sum(shares.values()) == pytest.approx(1, abs=1e-12)


def test_the_main_reason_is_the_largest_share_without_a_range():
    status = np.full(SHAPE, Status.VALID, np.uint8)
    status[0] = Status.SATURATED
    status[1, 0] = Status.DARK
    assert main_reason(status_shares(status)) == '16.7% saturated: a color channel is overexposed'


def lit(level, clipped=0.0):
    """Return an image whose brightest surfaces have a level, DN, and a share of 255."""
    image = np.zeros((100, 100, 3), np.uint8)
    image[:50, :, 1] = np.linspace(20, level, 100).astype(np.uint8)
    image[:round(50 * clipped)] = 255
    return image


@pytest.mark.parametrize('left, right, factor, words', [
    (lit(95), lit(90), 2.1, 'raise exposure by 2.1, white card at 200'),
    (lit(200), lit(190), 1, 'exposure is good: the brightest surfaces read'),
    (lit(250), lit(250, 0.02), 1, 'exposure is good'),
    (lit(120), lit(120, 0.2), 1 / 1.4, 'lower exposure by 1.4 and look again, white card at 200: '
     '20% of the lit pixels are overexposed'),
    (lit(0) * 0, lit(0) * 0, 1, 'nothing is lit')])
def test_advice_on_the_exposure_brings_a_white_card_to_200(left, right, factor, words):
    exposure = exposure_of(left, right, 254)
    assert exposure.factor == pytest.approx(factor, rel=0.02)
    assert words in exposure.sentence()


def test_advice_that_is_followed_is_not_given_again():
    image = lit(60).astype(float)
    factor = exposure_of(image.astype(np.uint8), image.astype(np.uint8), 254).factor
    brighter = np.clip(image * factor, 0, 255).astype(np.uint8)
    assert exposure_of(brighter, brighter, 254).factor == 1


def test_rows_are_told_in_a_few_words(stereo):
    left, right = scene()
    alignment = stereo.process(left, right).alignment
    told = {rows_in_words(SimpleNamespace(alignment=each)) for each in (
        None, alignment.but(covariance=np.eye(7) * 1e6), alignment.but(
            coefficients=np.zeros(7), covariance=np.eye(7) * 1e-6, applied=np.zeros(7)),
        alignment.but(coefficients=np.array([0.2, 0, 0, 0, 0, 0, 0]), searched='',
                      covariance=np.eye(7) * 1e-6, applied=np.array([0.2, 0, 0, 0, 0, 0, 0])))}
    assert told == {'rows are not looked at', 'rows are not known: the pattern does not show them',
                    'rows agree', 'rows differ by 0.20 px (top left), and are corrected'}


def test_a_good_pair_raises_no_doubt(stereo):
    left, right = scene()
    assert not doubts_about_images(left, right)
    assert not doubts_about_result(stereo, left, right, stereo.process(left, right))


def test_a_dark_pair_is_not_called_gray():
    black = np.full((*SHAPE, 3), 3, np.uint8)
    assert not doubts_about_images(black, black + 1)


@pytest.mark.parametrize('side', ['left', 'right'])
def test_a_gray_image_is_named(side):
    images = dict(zip(('left', 'right'), scene()))
    images[side] = gray(images[side])
    (doubt,) = doubts_about_images(**images)
    assert doubt.startswith(f'the {side} image is gray')


def test_two_gray_images_are_no_doubt():
    assert not doubts_about_images(*(gray(image) for image in scene()))


def test_gray_images_whose_columns_alternate_look_like_raw_bayer_data():
    left, right = (gray(image) for image in scene())
    for image in (left, right):
        image[:, ::2] //= 3
    (doubt,) = doubts_about_images(left, right)
    assert doubt.endswith('raw Bayer data without demosaicing')


def test_colors_that_come_again_under_a_pattern_that_never_repeats_are_a_doubt(stereo):
    left, right = scene()
    result = replace(stereo.process(left, right), rival_share=0.71)
    (doubt,) = doubts_about_result(stereo, left, right, result)
    assert doubt.startswith('the pattern repeats') and '71% of the lit surface' in doubt


def test_identical_images_are_noticed():
    left, _ = scene()
    assert 'identical' in doubts_about_images(left, left.copy())[0]


def test_swapped_images_are_noticed(stereo):
    left, right = scene()
    doubts = doubts_about_result(stereo, right, left, stereo.process(right, left))
    assert 'left and right image swapped?' in doubts[0]


def test_images_without_any_match_are_not_called_swapped(stereo):
    left, right = scene(seed=1)[0], scene(seed=2)[1]
    result = stereo.process(left, right)
    assert not [doubt for doubt in doubts_about_result(stereo, left, right, result)
                if 'swapped' in doubt]


def test_too_few_ranges_are_a_doubt_with_the_main_reason(stereo):
    black = np.zeros_like(scene()[0])
    (doubt,) = doubts_about_result(stereo, black, black, stereo.process(black, black))
    assert doubt.startswith('hardly any pixel has a range; 100.0% dark: too little pattern light')


def seen_by_a_single_chip(size, kind):
    """Return what a camera with a mosaic sees of structures of a size, px."""
    image = exposed(photographed(np.zeros((240, 320)), size, kind), np.random.default_rng(1))
    mosaic = image[..., 1].copy()
    mosaic[::2, ::2], mosaic[1::2, 1::2] = image[::2, ::2, 0], image[1::2, 1::2, 2]
    return cv2.cvtColor(mosaic, cv2.COLOR_BayerBG2RGB)


@pytest.mark.parametrize('kind', FIELDS)
@pytest.mark.parametrize('size', [4.0, 6.0, 9.0, 14.0])
def test_the_size_of_the_structures_is_seen_in_the_image(kind, size):
    found = feature_size_in(seen_by_a_single_chip(size, kind), PatternSettings(type=kind))
    assert found == pytest.approx(size, abs=0.5, rel=0.1)


def test_no_size_is_told_of_what_shows_none():
    image = seen_by_a_single_chip(6.0, 'hue_field')
    assert feature_size_in(image, PatternSettings(type='sine')) is None
    assert feature_size_in(gray(image), PatternSettings()) is None
    assert feature_size_in(np.zeros_like(image), PatternSettings()) is None


def test_structures_that_are_too_small_are_a_doubt_with_the_value_to_set():
    pattern = PatternSettings(feature_size=9.0)
    small, large = (SimpleNamespace(image=seen_by_a_single_chip(size, pattern.type))
                    for size in (3.0, 6.0))
    (doubt,) = doubts_about_features(pattern, small)
    assert 'too small in the image' in doubt
    value = float(doubt.split('set pattern.feature_size to ')[1].split()[0])
    assert value == pytest.approx(12, abs=3)  # 4 / 3 of 9
    assert not doubts_about_features(pattern, large)


def test_process_prints_the_shares_with_their_meaning(pair, capsys):
    assert cli.main(pair(*scene())) == 0
    said = capsys.readouterr()
    assert '%  valid          the pixel has a range' in said.out
    shares = [float(line.split('%')[0]) for line in said.out.splitlines()
              if line.startswith('   ') and '%' in line]
    assert sum(shares) == pytest.approx(100, abs=0.5)
    assert 'Depths: median 0.36 m' in said.out
    assert said.err == ''


def test_process_warns_of_what_is_wrong_with_a_pair(pair, capsys):
    left, right = scene()
    assert cli.main(pair(right, left)) == 0
    assert 'warning: left and right image swapped?' in capsys.readouterr().err
    assert cli.main(pair(gray(left), right)) == 0
    assert 'warning: the left image is gray' in capsys.readouterr().err


def test_process_says_when_the_calibrations_are_swapped(pair, capsys):
    assert cli.main(pair(*scene(), yamls=('right.yaml', 'left.yaml'))) == 1
    assert 'left and right camera swapped?' in capsys.readouterr().err


def test_the_swapped_order_of_a_parallel_rig_is_refused_by_its_baseline():
    rig = calibration()
    with pytest.raises(ValueError, match='swapped'):
        StereoCalibration(rig.right, rig.left)


@pytest.mark.parametrize('model, changes, shown, told', [
    (None, {}, True, False), (projector(), {'agreeing': True, 'explains': False}, False, True),
    (projector(), {'agreeing': True}, True, False), (projector(), {}, False, True),
    (None, {'reason': Reason.ABSENT}, False, False), (None, {'reason': Reason.ABSENT}, True, True),
    (None, {'reason': Reason.MIRRORED}, False, True), (None, {'reason': Reason.FLAT}, True, False),
    (None, {'reason': Reason.MIRRORED, 'held': True}, True, False)])
def test_what_should_be_looked_after_at_the_projector_is_told(model, changes, shown, told):
    track = Track(model).but(**changes)
    assert doubt_about_projector(track, shown) == (track.sentence() if told else None)

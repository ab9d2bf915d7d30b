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
"""Views that differ in blur, color, compression and hot pixels: what is measured and mended."""

import math

from color_stereo_ros.core import ColorStereo
from color_stereo_ros.core.compiled import Arena
from color_stereo_ros.core.pipeline import Stopwatch
from color_stereo_ros.core.rows.alignment import Alignment
from color_stereo_ros.core.status import Status
from color_stereo_ros.core.surface import even
from color_stereo_ros.core.surface.gains import blocks_differ
from color_stereo_ros.core.surface.pair_model import worst_part
from color_stereo_ros.core.surface.planes import PlaneField
from color_stereo_ros.core.surface.raw_faults import (
    Looker, quantization, step_of, without_hot_pixels)
from color_stereo_ros.core.surface.texture import TextureSearch
from color_stereo_ros.core.surface.tuning import PERIODIC, TUNING
from color_stereo_ros.core.surface.unlike import LINEAR
import cv2
import numpy as np
import pytest
from surface_pairs import exposed, photographed, plane, rig, surface_settings

WIDTH, HEIGHT = 320, 240
TRUTH = plane(WIDTH, HEIGHT, 25.0, 0.03)
GRAY = np.full((HEIGHT, WIDTH, 3), 0.4)
BACKGROUND = np.array([0.020, 0.014, 0.014]), np.array([0.014, 0.014, 0.022])


def pair(left=lambda light: light, right=lambda light: light, seed=3):
    """Return a pair of a leaning plane; what is given changes the light of a view."""
    rng = np.random.default_rng(seed)
    return (exposed(left(photographed(-TRUTH)), rng),
            exposed(right(photographed(0 * TRUTH)), rng))


def sensor(**changes):
    """Return a sensor for `TRUTH`."""
    return ColorStereo(rig(WIDTH, HEIGHT), surface_settings(15, 35, **changes),
                       rectified_input=True)


@pytest.fixture(scope='module')
def usual():
    return sensor()


def blurred(sigma_x, sigma_y):
    """Return a function that blurs light."""
    return lambda light: cv2.GaussianBlur(light, (0, 0), sigmaX=sigma_x, sigmaY=sigma_y,
                                          borderType=cv2.BORDER_REPLICATE)


def look(image):
    """Return the Look of an image."""
    image = np.ascontiguousarray(image)
    return Looker(*image.shape[:2], TUNING).look(image, np.zeros_like(image))[0]


def share_right(result):
    """Return the share of the inner pixels that are right within .5 px."""
    with np.errstate(invalid='ignore'):
        right = np.abs(result.disparity - TRUTH) < 0.5
    return right[12:-12, 48:-12].mean()


def found(stereo, images, monkeypatch):
    """Return all that is evened out in a pair, Unlikeness each, and the result."""
    seen = []
    monkeypatch.setattr(even, 'apply', lambda each, *rest, apply=even.apply: (
        seen.append(each), apply(each, *rest)))
    return seen, stereo.process(*images)


@pytest.mark.parametrize('side', ['left', 'right'])
def test_crosstalk_that_leaves_one_camera_a_tenth_of_its_contrast(usual, side):
    mixed = np.full((3, 3), 0.3) + 0.7 * np.eye(3)
    images = pair(**{side: lambda light: light @ (mixed / mixed.sum(axis=0))})
    views = usual._method.views
    result = usual.process(*images)
    assert share_right(result) > 0.9
    least, most = sorted(view.contrast(48) for view in (views.left, views.right))
    assert most / least < TUNING.views.unlike_contrast


def mixed_by(share):
    """Return a function from light to signals whose channels hold so much of each other one."""
    matrix = np.full((3, 3), share) + (1 - 3 * share) * np.eye(3)
    return lambda light: light @ matrix


@pytest.mark.parametrize('share, raised', [(0.29, False), (0.31, True)])
def test_crosstalk_of_both_cameras_leaves_ranges_that_are_right_and_sure(usual, share, raised):
    result = usual.process(*pair(mixed_by(share), mixed_by(share)))
    assert usual._method.views.raised == raised
    assert share_right(result) > 0.94
    sure = result.confidence > 0.9
    inner = np.s_[12:-12, 48:-12]
    assert sure[inner].mean() > 0.6
    assert (np.abs(result.disparity - TRUTH) > 1)[sure].mean() < 0.015


def test_raised_colors_are_like_those_without_crosstalk(usual):
    views = usual._method.views
    clean = views.load(*pair(), np.zeros(7)).left.u.copy()
    views.load(*pair(mixed_by(0.3), mixed_by(0.3)), np.zeros(7))
    before = views.left.variance.copy()
    assert views.raise_faint_colors() is not None
    inner = views.grid.inner
    likeness = np.corrcoef(clean[inner].ravel(), views.left.u[inner].ravel())[0, 1]
    assert likeness > 0.85
    factor = TUNING.views.usual_contrast / views.contrasts[1]
    np.testing.assert_allclose(views.left.variance[inner], np.minimum(
        before[inner] * factor ** 2, 0.5 * TUNING.views.silent_variance), rtol=1e-4)


def test_colors_that_go_back_are_the_same_bytes(usual):
    views = usual._method.views
    views.load(*pair(mixed_by(0.3), mixed_by(0.3)), np.zeros(7))
    views.evened = 2.0
    known, before = views.copied()
    kept = views.raise_faint_colors()
    views.noise_weight, views.evened = 7.0, 9.0
    views.lower_colors(kept)
    assert not views.raised and (views.noise_weight, views.evened) == known
    assert all(np.array_equal(*each) for each in zip(before, views.colors()))


def test_a_gray_pattern_with_a_tint_is_not_the_pattern_in_faint_colors(usual):
    rng = np.random.default_rng(5)
    speckle = cv2.GaussianBlur(rng.normal(size=(HEIGHT, WIDTH)), (0, 0), 1.0)
    gray = np.clip(0.4 + 0.6 * speckle, 0.05, 0.9)[..., None]
    images = [exposed(np.repeat(gray, 3, axis=2) * (1.05, 1.0, 0.95), np.random.default_rng(seed))
              for seed in (1, 2)]
    usual.process(*images)
    assert not usual._method.views.raised


def test_usual_colors_are_not_raised(usual):
    usual.process(*pair())
    assert not usual._method.views.raised


def test_equal_views_stay_as_they_are(usual, monkeypatch):
    seen, result = found(usual, pair(), monkeypatch)
    assert not seen
    other = sensor(matching__blur_matching=False).process(*pair())
    np.testing.assert_array_equal(result.disparity, other.disparity)


@pytest.mark.parametrize('sigma', [1.5, 2.0, 3.0])
@pytest.mark.parametrize('side', ['left', 'right'])
def test_blur_of_one_view_is_recovered(usual, monkeypatch, side, sigma):
    seen, result = found(usual, pair(**{side: blurred(sigma, sigma)}), monkeypatch)
    total = sum(each.blur[:, 0] for each in seen)
    expected = sigma ** 2 * (1 if side == 'left' else -1)
    np.testing.assert_allclose(total, expected, rtol=0.25)
    assert share_right(result) > 0.95


def test_blur_that_was_evened_out_is_doubted(usual):
    views = usual._method.views
    sharp = usual.process(*pair())
    assert views.evened == 0
    found = []
    for sigma in (2.0, 3.0):
        result = usual.process(*pair(right=blurred(sigma, sigma)))
        assert views.evened == pytest.approx(sigma ** 2, rel=0.25)
        found.append((np.median(result.confidence), np.nanmedian(result.disparity_std)))
    assert np.median(sharp.confidence) > found[0][0] > found[1][0] > 0.9
    assert np.nanmedian(sharp.disparity_std) < found[0][1] < found[1][1]
    usual.process(*pair())
    assert views.evened == 0


@pytest.mark.parametrize('sigma', [0.0, 1.0, 3.0])
def test_sharpness_is_that_of_the_sharpest_edges(sigma):
    step = np.zeros((HEIGHT, WIDTH, 3))
    for start in range(20, WIDTH, 40):
        step[:, start:start + 20] = 200
    step[:, :30] = np.linspace(0, 200, 30)[:, None]  # slow changes do not count
    image = np.rint(blurred(sigma, sigma)(step) if sigma else step).astype(np.uint8)
    # the largest change is that from half a pixel before a step to 1.5 px behind it
    expected = sum(math.erf(x / (sigma * math.sqrt(2))) for x in (0.5, 1.5)) / 2 if sigma else 1
    assert look(image).sharpness == pytest.approx(expected, abs=0.08)
    assert look(image[:, :8]).sharpness == look(0 * image).sharpness == 1


def test_blur_of_both_views_is_doubted(usual):
    views = usual._method.views
    usual.process(*pair())
    assert views.common_blur == 0
    found = []
    for sigma in (2.0, 3.0):
        images = pair(left=blurred(sigma, sigma), right=blurred(sigma, sigma))
        result = usual.process(*images)
        assert views.common_blur == pytest.approx(sigma ** 2, rel=0.4)
        assert share_right(result) > 0.95
        found.append(np.median(result.confidence))
    assert found[0] > found[1] > 0.8
    usual.process(*pair(right=blurred(3.0, 3.0)))
    assert views.common_blur == 0  # that of one view is evened out


def test_blur_makes_doubtful_nodes_less_doubtful():
    stereo = sensor()
    trust, unlike = stereo._method.trust, TUNING.unlike
    stereo.process(*pair())
    before = np.array([-0.5, 0.4, 3.5], np.float32)
    for excess in (1.0, 4.0, 9.0):
        verdict = trust.verdict
        verdict.log_odds[8, 8:11] = before
        trust.doubt_blur(excess, verdict)
        doubtful, even, sure = verdict.log_odds[8, 8:11]
        assert -0.5 < doubtful <= unlike.even_odds + 1e-6
        assert even > 0.4 and sure < 3.5


def test_blur_that_makes_colors_match_everywhere_is_evened_out_first(usual, monkeypatch):
    coarse = type(usual._method.coarse)
    share, asked = coarse.rival_share, []

    def rivals(search):
        asked.append(share(search))
        return 0.3 if len(asked) == 1 else asked[-1]

    monkeypatch.setattr(coarse, 'rival_share', rivals)
    result = usual.process(*pair(left=blurred(3.0, 3.0)))
    assert len(asked) > 1 and result.rival_share == 0
    assert not usual._method.brightness.active
    assert share_right(result) > 0.95


def test_rivals_that_blur_does_not_explain_leave_the_views_as_they_are(usual, monkeypatch):
    monkeypatch.setattr(type(usual._method.coarse), 'rival_share', lambda search: 0.3)
    images = pair(left=blurred(3.0, 3.0))
    views = usual._method.views
    result = usual.process(*images)
    assert result.rival_share == 0.3
    found = views.left.u.copy(), views.right.u.copy()
    monkeypatch.setattr(type(usual._method), 'blur_explains_rivals', lambda method, views: False)
    usual.process(*images)
    for each, view in zip(found, (views.left, views.right)):
        np.testing.assert_array_equal(each, view.u)


def unevenly_blurred(sigma):
    """Return a function that blurs light; sigma: a function of y and x, -1 .. 1, to px."""
    def blur(light):
        height, width = light.shape[:2]
        wanted = sigma(np.linspace(-1, 1, height)[:, None], np.linspace(-1, 1, width)[None])
        steps = np.arange(0, 4.25, 0.25)
        images = [blurred(step, step)(light) if step else light for step in steps]
        return sum(np.maximum(0, 1 - np.abs(wanted - step) / 0.25)[..., None] * image
                   for step, image in zip(steps, images))
    return blur


@pytest.mark.parametrize('sigma, curved', [
    (lambda y, x: 0 * y + 2.2 * (1 + x) / 2, True),
    (lambda y, x: 3 * np.hypot(y, x) / 1.5, True), (lambda y, x: 0 * (x + y) + 2, False)])
def test_blur_that_grows_to_a_border_or_into_corners_is_evened_out(
        usual, monkeypatch, sigma, curved):
    seen, result = found(usual, pair(right=unevenly_blurred(sigma)), monkeypatch)
    assert any(each.blur.shape[1] > LINEAR for each in seen) is curved
    clean = share_right(usual.process(*pair()))
    assert share_right(result) > clean - 0.04


def test_the_worst_part_shows_what_a_quartile_of_the_whole_image_hides(usual):
    usual.process(*pair())
    views, pair_tuning = usual._method.views, TUNING.pair
    grid = views.grid
    planes = PlaneField(grid, 1.0, True, Arena())
    planes.misfit[grid.inner] = 0.1 * pair_tuning.quartile
    planes.misfit[grid.inner][:, -grid.columns // 4:] = 5 * pair_tuning.quartile
    assert worst_part(views, planes, TUNING) == pytest.approx(5)
    planes.misfit[grid.inner][::3, ::2] = np.nan  # a part keeps the rest of its nodes
    assert worst_part(views, planes, TUNING) == pytest.approx(5)
    planes.misfit[grid.inner][:, -grid.columns // 4:] = np.nan
    assert worst_part(views, planes, TUNING) == pytest.approx(0.1)


def test_dark_places_of_compressed_pairs_are_no_part_of_it():
    usual = sensor()
    usual.process(*pair())
    views = usual._method.views
    grid = views.grid
    planes = PlaneField(grid, 1.0, True, Arena())
    planes.misfit[grid.inner] = 0.1 * TUNING.pair.quartile
    planes.misfit[grid.inner][:, -grid.columns // 4:] = 5 * TUNING.pair.quartile
    views.left.s[grid.inner][:, -grid.columns // 4:] = 0.5 * TUNING.raw.least_light
    assert worst_part(views, planes, TUNING) == pytest.approx(5)
    views.compressed = True
    assert worst_part(views, planes, TUNING) == pytest.approx(0.1)


@pytest.mark.parametrize('cycles, slow', [(1, True), (4, False)])
def test_slow_colors_are_averaged_and_not_evened_out_where_nothing_is_known(cycles, slow):
    """A field of gains is a surface there; where colors change faster it is one of gains."""
    method = sensor(pattern__type='unknown')._method.other
    phase = 2 * np.pi * cycles * np.arange(WIDTH + 60) / WIDTH
    colors = 0.35 + 0.2 * np.cos(phase[:, None] + np.array([0, 2.1, 4.2]))
    light = np.broadcast_to(colors, (HEIGHT, WIDTH + 60, 3))
    rng = np.random.default_rng(2)
    method.measure(exposed(light[:, :WIDTH], rng), exposed(light[:, 25:WIDTH + 25], rng),
                   Stopwatch(), Alignment.unknown((WIDTH, HEIGHT)))
    assert (method.in_force is method.slow) is slow
    assert method.evening_in_force.on is not slow
    assert bool(method.views.noise_weight < 1 / 9) is slow  # .15 and more of single nodes


@pytest.mark.parametrize('more', [True, False])
def test_slow_colors_are_averaged_unless_the_search_for_texture_finds_more(monkeypatch, more):
    stereo = sensor(pattern__type='sine', pattern__cycles=1)
    method = stereo._method
    monkeypatch.setattr(type(method), 'detail_shown', lambda *rest: (False, True))
    monkeypatch.setattr(TextureSearch, 'finds_more', lambda *rest: more)
    weights, average = [], type(method.views).average
    monkeypatch.setattr(type(method.views), 'average', lambda views, *rest: (
        weights.append(views.noise_weight), average(views, *rest)))
    light = np.broadcast_to(0.35 + 0.2 * np.cos(
        2 * np.pi * np.arange(WIDTH + 60)[:, None] / WIDTH + np.array([0, 2.1, 4.2])),
        (HEIGHT, WIDTH + 60, 3))
    rng = np.random.default_rng(2)
    stereo.process(exposed(light[:, :WIDTH], rng), exposed(light[:, 25:WIDTH + 25], rng))
    assert method.brightness.seeded is more
    assert (method.in_force is method.detailed) is more
    assert bool(method.views.noise_weight == weights[0]) is more


def test_motion_of_one_camera_is_told_from_a_lens_out_of_focus(usual, monkeypatch):
    seen, _ = found(usual, pair(right=lambda light: cv2.blur(light, (7, 1))), monkeypatch)
    along, across = sum(each.blur[:, 0] for each in seen)
    assert along == pytest.approx(-4.0, rel=0.4)  # (7^2 - 1) / 12
    assert abs(across) < 0.5


@pytest.mark.parametrize('side', ['left', 'right'])
def test_motion_along_a_diagonal_is_evened_out_along_it(usual, monkeypatch, side):
    kernel = np.eye(7) / 7  # variance and covariance (7^2 - 1) / 12 px^2
    images = pair(**{side: lambda light: cv2.filter2D(light, -1, kernel,
                                                      borderType=cv2.BORDER_REPLICATE)})
    seen, result = found(usual, images, monkeypatch)
    assert share_right(result) > 0.95
    expected = 4.0 * (1 if side == 'left' else -1)
    assert sum(each.oblique for each in seen) == pytest.approx(expected, rel=0.3)
    np.testing.assert_allclose(sum(each.blur[:, 0] for each in seen), expected, rtol=0.3)


@pytest.mark.parametrize('covariance', [[[3.0, 2.0], [2.0, 1.4]], [[3.0, -2.0], [-2.0, 1.4]],
                                        [[9.0, 0.0], [0.0, 0.01]], [[0.1, 0.05], [0.05, 0.1]]])
@pytest.mark.parametrize('step_x', [1, 2])
def test_an_oblique_kernel_has_the_covariance_asked_for(covariance, step_x):
    kernel = even.oblique_kernel(np.array(covariance), step_x, TUNING.unlike)
    reach = len(kernel) // 2
    y, x = np.mgrid[-reach:reach + 1, -reach:reach + 1] * np.array([2, step_x])[:, None, None]
    assert kernel.sum() == pytest.approx(1, abs=1e-5)
    moments = [[(kernel * a * b).sum() for b in (x, y)] for a in (x, y)]
    np.testing.assert_allclose(moments, covariance, atol=1e-4)


def test_blur_is_not_evened_out_where_it_is_switched_off():
    images = pair(right=blurred(3.0, 3.0))
    assert share_right(sensor(matching__blur_matching=False).process(*images)) < 0.5


@pytest.mark.parametrize('sigma', [2.0, 3.0])
def test_blur_of_one_view_is_recovered_where_brightness_counts(monkeypatch, sigma):
    images = pair(right=blurred(sigma, sigma))
    seen, result = found(sensor(pattern__type='unknown'), images, monkeypatch)
    np.testing.assert_allclose(sum(each.blur[:, 0] for each in seen), -sigma ** 2, rtol=0.25)
    plain = sensor(pattern__type='unknown', matching__blur_matching=False).process(*images)
    assert share_right(result) > max(0.9, share_right(plain))


def test_noise_of_the_colors_of_a_gray_pattern_is_not_evened_out(monkeypatch):
    rng = np.random.default_rng(3)
    images = [exposed(np.repeat(photographed(shift)[..., :1], 3, axis=2), rng)
              for shift in (-TRUTH, 0 * TRUTH)]
    seen, result = found(sensor(pattern__type='unknown'), images, monkeypatch)
    assert not seen and share_right(result) > 0.9


def test_a_field_of_gains_is_recovered(usual, monkeypatch):
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    x = (2 * x / WIDTH - 1)[..., None]
    log_gain = 0.3 + 0.5 * x * np.array([1.0, 0.0, -1.0])
    seen, result = found(usual, pair(right=lambda light: light * np.exp(-log_gain) / 2),
                         monkeypatch)
    slope = sum(each.gain[:, 1] for each in seen) @ even.GAUGES
    np.testing.assert_allclose(slope, [0.5, 0.0, -0.5], atol=0.05)
    assert share_right(result) > 0.98


def test_bands_of_a_one_chip_projector_are_removed(usual, monkeypatch):
    row = np.arange(HEIGHT)[:, None, None]
    gain = 1 + 0.2 * np.sin(2 * np.pi * (row / 60 + np.array([0.0, 1 / 3, 2 / 3])))
    seen, result = found(usual, pair(right=lambda light: light * gain), monkeypatch)
    measured = sum(each.bands[0] + each.bands[1] for each in seen if each.bands)
    centers = (np.arange(HEIGHT // 4) * 4 + 1.5)[:, None]
    true = -np.log(1 + 0.2 * np.sin(2 * np.pi * (centers / 60 + np.array([0.0, 1 / 3, 2 / 3]))))
    true -= true.mean(axis=1, keepdims=True)
    inner = np.s_[5:-5]
    assert np.sqrt(np.mean((measured[:len(true)] - true)[inner] ** 2)) < 0.04
    assert share_right(result) > 0.98


@pytest.mark.parametrize('change', [
    lambda light: light ** (1 / 2.2),
    lambda light: light @ (0.1 * np.ones((3, 3)) + 0.7 * np.eye(3)),
    lambda light: light @ (0.25 * np.ones((3, 3)) + 0.25 * np.eye(3)),
    lambda light: light * [1.0, 1.0, 0.3]], ids=['gamma', 'crosstalk', 'strong crosstalk', 'blue'])
def test_one_camera_of_other_colors_costs_no_ranges(usual, change):
    assert share_right(usual.process(*pair(right=change))) > 0.97


@pytest.mark.parametrize('exposures', [(2.5, 2.5), (1.0, 2.5), (2.5, 1.0)])
def test_a_saturated_channel_costs_no_ranges(usual, exposures):
    left, right = (lambda light, times=times: times * light for times in exposures)
    images = pair(left, right)
    clipped = [np.mean(image.max(axis=2) == 255) for image in images]
    assert np.array_equal(np.array(clipped) > 0.5, np.array(exposures) > 1)
    assert share_right(usual.process(*images)) > 0.97


def test_white_that_is_saturated_has_no_ranges(usual):
    white = np.zeros((HEIGHT, WIDTH, 1))
    white[80:160, 80:240] = 2
    images = pair(*(lambda light: white + light,) * 2)
    result = usual.process(*images)
    assert np.isnan(result.disparity[95:145, 130:200]).mean() > 0.9
    assert (result.status[95:145, 130:200] == Status.SATURATED).mean() > 0.9


def test_two_scenes_are_not_made_alike(usual, monkeypatch):
    left, _ = pair()
    _, right = pair(right=lambda light: light[::-1, ::-1])
    seen, result = found(usual, (left, right), monkeypatch)
    assert not seen
    assert np.isfinite(result.disparity).mean() < 0.02


def compressed(image, quality):
    """Return what JPEG 4:2:0 makes of an RGB image."""
    options = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_SAMPLING_FACTOR,
               cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420]
    return np.ascontiguousarray(cv2.imdecode(
        cv2.imencode('.jpg', image[..., ::-1], options)[1], cv2.IMREAD_COLOR)[..., ::-1])


@pytest.mark.parametrize('quality', [95, 85, 60, 40])
def test_compression_is_seen_and_costs_few_ranges(usual, quality):
    images = pair()
    assert not any(look(image).subsampled for image in images)
    images = [compressed(image, quality) for image in images]
    assert all(look(image).subsampled for image in images)
    assert share_right(usual.process(*images)) > 0.95


def test_brightness_counts_where_compression_has_taken_chroma(usual):
    images = pair()
    usual.process(*images)
    assert not usual._method.brightness.active
    usual.process(*(compressed(image, 60) for image in images))
    assert usual._method.brightness.active


@pytest.mark.parametrize('quality', [85, 60])
@pytest.mark.parametrize('side', [0, 1])
def test_compression_of_one_view_costs_no_more_than_that_of_both(usual, side, quality):
    images = list(pair())
    images[side] = compressed(images[side], quality)
    assert share_right(usual.process(*images)) > 0.95
    views = usual._method.views
    assert views.compressed
    assert views.quantization == quantization(images[side], TUNING.raw)


@pytest.mark.parametrize('quality', [95, 85])
def test_a_compressed_dark_background_does_not_decide_about_the_colors(usual, quality):
    lit = np.zeros((HEIGHT, WIDTH), bool)
    lit[60:180, 120:240] = True
    row, column = np.mgrid[:HEIGHT, :WIDTH]
    moved = lit[row, np.clip(np.rint(column + TRUTH).astype(int), 0, WIDTH - 1)]
    left, right = (lambda light, seen=seen, dim=dim: np.where(seen[..., None], light, dim)
                   for seen, dim in zip((lit, moved), BACKGROUND))
    images = [compressed(image, quality) for image in pair(left, right)]
    result = usual.process(*images)
    assert (np.abs(result.disparity - TRUTH)[70:170, 135:225] < 0.5).mean() > 0.78


@pytest.mark.parametrize('quality, step', [(95, 1), (85, 4), (60, 10), (40, 15)])
def test_the_quantization_is_read_from_the_image(quality, step):
    # quality 50: 11, 12, 12, 10 and 14; above, (100 - quality) / 50 of it, below 50 / quality
    light = 0.3 + 0.5 * photographed(0 * TRUTH)  # no channel is clipped
    image = exposed(light, np.random.default_rng(5))
    assert quantization(image, TUNING.raw) == 1
    assert step <= quantization(compressed(image, quality), TUNING.raw) <= 1.25 * step
    assert quantization(image[:7], TUNING.raw) == 1


@pytest.mark.parametrize('step', [1, 3, 7, 20])
def test_steps_are_scored_as_by_their_naive_twin(step):
    rng = np.random.default_rng(step)
    for count, spread in ((0, 1), (20, 50), (400, 3), (1500, 12), (3000, 60)):
        values = np.abs(step * np.rint(rng.normal(0, spread, count)) + rng.normal(0, 0.3, count))
        values = values.astype(np.float32)
        assert step_of(values, TUNING.raw) == naive_step_of(values, TUNING.raw)


def naive_step_of(values, tuning):
    """Return what `step_of` returns, one step after the other."""
    found, best = 1, tuning.periodic
    for step in range(2, tuning.largest_quantization + 1):
        large = values[values > tuning.beyond_zero * step]
        if np.count_nonzero(large > 2 * tuning.beyond_zero * step) < tuning.least_values:
            break
        score = np.cos(large * np.float32(2 * np.pi / step)).mean()
        if score > best:
            found, best = step, score
    return found


def test_a_half_dark_image_has_the_noise_of_its_light(usual):
    dark = np.ones((HEIGHT, WIDTH, 1))
    dark[HEIGHT // 2:] = 0.01
    scales = []
    for change in (lambda light: light, lambda light: dark * light):
        method = usual._method
        match = method.match
        images = [compressed(image, 60) for image in pair(left=change, right=change)]
        pair_model, _ = match(*images, np.zeros(7), Stopwatch())
        scales.append(pair_model.scale)
    assert scales[1] == pytest.approx(scales[0], rel=0.3)
    assert scales[0] > 2 * TUNING.pair.scale_limits[0]


@pytest.mark.parametrize('quality', [95, 85, 60])
def test_the_dark_level_of_compressed_images_is_one_of_all_channels(usual, monkeypatch, quality):
    lit = np.arange(WIDTH)[:, None] > WIDTH // 2
    found = []
    views = usual._method.views
    monkeypatch.setattr(type(views.left), 'fill', lambda view, dark, *rest: found.append(dark))
    images = pair(left=lambda light: 0.4 * lit * light, right=lambda light: 0.4 * lit * light)
    views.load(*(compressed(cv2.add(image, (5, 5, 5, 0)), quality) for image in images),
               np.zeros(7))
    assert views.compressed
    assert np.ptp(found) == 0
    assert found[0][0] == pytest.approx(5, abs=1)


def test_images_without_color_are_not_compressed():
    noise = np.random.default_rng(1).normal(90, 5, (HEIGHT, WIDTH, 1))
    gray = np.broadcast_to(noise, (HEIGHT, WIDTH, 3)).astype(np.uint8)
    assert not look(gray).subsampled
    assert not look(np.zeros((HEIGHT, WIDTH, 3), np.uint8)).subsampled
    assert not look(np.zeros((4, 9, 3), np.uint8)).subsampled


def test_hot_pixels_are_replaced_and_nothing_else():
    rng = np.random.default_rng(5)
    image = exposed(GRAY + 0.2 * photographed(0 * TRUTH), rng)
    assert not look(image).hot
    hot = image.copy()
    spots = np.zeros(image.shape[:2], bool)
    spots[4:-4, 4:-4] = rng.random((HEIGHT - 8, WIDTH - 8)) < 0.01
    hot[spots] = 255
    assert look(hot).hot
    mended = without_hot_pixels(hot, TUNING.raw).astype(int)
    alone = spots & (cv2.boxFilter(spots.astype(np.float32), -1, (7, 7), normalize=False) < 1.5)
    assert np.abs(mended - image)[alone].max() < 40
    touched = cv2.dilate((hot != image).any(axis=2).astype(np.uint8), np.ones((3, 3)))
    np.testing.assert_array_equal(mended[touched == 0], image[touched == 0])


def median_error(result):
    """Return the median of the errors of the inner pixels, px."""
    return float(np.nanmedian(np.abs(result.disparity - TRUTH)[12:-12, 48:-12]))


def shaded(light):
    """Return light behind a lens that shades red on one side and blue on the other."""
    x = np.linspace(-1, 1, WIDTH)[None, :, None]
    return light * np.exp(0.06 * x * np.array([1.0, 0.0, -1.0]))


def test_small_gains_are_evened_out_where_the_colors_of_an_aperiodic_pattern_change_slowly():
    rng = np.random.default_rng(5)
    left, right = (photographed(shift, feature_size=24.0) for shift in (-TRUTH, 0 * TRUTH))
    errors = [median_error(sensor(matching__color_matching=on).process(
        exposed(left, rng), exposed(shaded(right), rng))) for on in (False, True)]
    assert errors[1] < 0.6 * errors[0]


def test_a_named_slow_pattern_on_print_is_as_good_as_an_unknown_one():
    rng = np.random.default_rng(5)
    x = np.arange(WIDTH)[None, :, None]
    images = []
    for shift, change in ((-TRUTH, lambda light: light), (0 * TRUTH, shaded)):
        sine = 0.5 + 0.4 * np.cos(2 * np.pi * ((x + shift[..., None]) / WIDTH
                                               + np.arange(3) / 3))
        print_ = 0.5 + 0.5 * photographed(shift)[..., :1]
        images.append(exposed(change(sine * print_), rng))
    named, unknown = (sensor(pattern__type=name).process(*images) for name in ('sine', 'unknown'))
    assert share_right(named) > share_right(unknown) - 0.005 > 0.9
    assert median_error(named) < 1.1 * median_error(unknown)
    np.testing.assert_allclose(np.nanmedian(named.disparity_std),
                               np.nanmedian(unknown.disparity_std), rtol=0.1)


def test_blocks_tell_other_cameras_from_other_parts_of_the_pattern():
    tuning = type(TUNING.views)(**{
        **{name: getattr(TUNING.views, name) for name in TUNING.views.__dataclass_fields__},
        'balance_blocks': PERIODIC['views.balance_blocks'].value})
    levels = [(np.zeros(3, np.float32), np.ones(3, np.float32))] * 2
    column = np.arange(WIDTH)[:, None]
    waves, ramp = (np.broadcast_to(90 * (1 + 0.8 * np.cos(
        2 * np.pi * (column / period + np.arange(3) / 3))), (HEIGHT, WIDTH, 3))
        for period in (16, 2 * WIDTH))
    for light, differ in ((waves, True), (ramp, False)):
        images = [np.rint(light * gain).astype(np.uint8) for gain in (1.0, [0.8, 1.0, 1.0])]
        assert blocks_differ(levels, tuning, images) == differ
    assert not blocks_differ(levels, tuning, [np.rint(waves).astype(np.uint8)] * 2)

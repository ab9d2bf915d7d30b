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
"""Light of the simulated rig: the projector, distorted lenses, bounces, ambient, materials."""

from color_stereo_ros.core.cameras.lenses import LENSES
from color_stereo_ros.errors import ImageError
from color_stereo_ros.sim import Renderer
from color_stereo_ros.sim.materials import MATERIALS, texture_image
from color_stereo_ros.sim.projection import pattern_light, pattern_stack, projector_coordinates
from color_stereo_ros.sim.transport import _averaged, _render, pixel_index, View

import cv2

import numpy as np

import pytest

from sim_scenes import BALL, CARD, scene_of, SIZE, small_rig, smooth_pattern, uniform

DISTORTIONS = [
    ('plumb_bob', [-0.25, 0.08, 0.001, -0.0015, 0.02]),
    ('plumb_bob', [0.15, -0.05, -0.001, 0.001]),
    ('rational_polynomial', [0.1, -0.2, 0.001, 0.0005, 0.05, 0.2, -0.1, 0.02]),
    ('equidistant', [0.05, -0.01, 0.003, 0.0])]


def left_radiance(scene, pattern, samples=4, **options):
    renderer = Renderer(scene, samples=samples, **{'indirect': False, **options})
    return renderer.radiance(scene.rig.left, pattern)


def undistorted(image, camera):
    """Return an image undistorted by OpenCV; NaN where there is no image."""
    size = (camera.width, camera.height)
    library = cv2.fisheye if camera.distortion_model == 'equidistant' else cv2
    maps = library.initUndistortRectifyMap(camera.K, camera.D, np.eye(3), camera.K, size,
                                           cv2.CV_32FC1)
    inside = cv2.remap(np.ones(image.shape[:2]), *maps, cv2.INTER_LINEAR)
    return np.where((inside == 1)[..., None], cv2.remap(image, *maps, cv2.INTER_CUBIC), np.nan)


@pytest.mark.parametrize('model, coefficients', DISTORTIONS)
def test_a_distorted_camera_undistorted_by_opencv_agrees_with_a_straight_one(model, coefficients):
    pattern = smooth_pattern(96, 128)
    straight = left_radiance(scene_of(CARD, BALL), pattern)
    scene = scene_of(CARD, BALL, rig=small_rig(distortion_model=model, distortion=coefficients))
    distorted = left_radiance(scene, pattern)
    restored = undistorted(distorted, scene.rig.left)
    inside = np.isfinite(restored).all(axis=-1)
    assert inside.mean() > 0.8
    scale = straight.mean()
    # the pattern's edges are about as wide as a pixel, so interpolation leaves some error
    assert np.median(np.abs(restored - straight)[inside]) < 0.02 * scale
    assert np.abs(restored - straight)[inside].mean() < 0.03 * scale
    assert np.abs(distorted - straight).mean() > 0.05 * scale


@pytest.mark.parametrize('model, coefficients', [DISTORTIONS[0], DISTORTIONS[3]])
def test_skew_moves_what_a_camera_sees(model, coefficients):
    pattern = smooth_pattern(96, 128)
    lens = {'distortion_model': model, 'distortion': coefficients}
    straight = left_radiance(scene_of(CARD, BALL, rig=small_rig(**lens)), pattern)
    scene = scene_of(CARD, BALL, rig=small_rig(skew=9.0, **lens))
    camera, skewed = scene.rig.left, left_radiance(scene, pattern)
    assert scene.rig.calibration.left.K[0, 1] == 9.0
    y, x = np.indices(camera.shape, np.float32)
    # u = fx x + s y + cx
    moved = x + np.float32(9.0) * (y - np.float32(camera.K[1, 2])) / np.float32(camera.K[1, 1])
    inside = cv2.remap(np.ones(camera.shape), moved, y, cv2.INTER_LINEAR) == 1
    restored = cv2.remap(skewed, moved, y, cv2.INTER_CUBIC)
    assert inside.mean() > 0.9
    assert np.median(np.abs(restored - straight)[inside]) < 0.02 * straight.mean()
    assert np.abs(skewed - straight).mean() > 0.05 * straight.mean()


@pytest.mark.parametrize('model', LENSES)
def test_a_camera_without_coefficients_has_a_calibration_of_its_model(model):
    calibration = scene_of(rig=small_rig(distortion_model=model)).rig.calibration
    assert calibration.left.distortion_model == model
    assert calibration.left.D.size == LENSES[model].lengths[-1] and not calibration.left.D.any()


def test_a_distorted_camera_agrees_with_a_straight_one_to_a_small_part_of_a_pixel():
    coefficients = [-0.25, 0.08, 0.001, -0.0015, 0.02]
    ramp = uniform(0)
    ramp[..., 0] = np.arange(256)
    projector = {'field_of_view': 80}  # the card is lit beyond the borders of the image
    straight = left_radiance(scene_of(CARD, rig=small_rig(projector)), ramp, samples=6)
    scene = scene_of(CARD, rig=small_rig(projector, distortion=coefficients))
    restored = undistorted(left_radiance(scene, ramp, samples=6), scene.rig.left)
    slope = np.gradient(straight[..., 0], axis=1)
    error = (restored - straight)[..., 0] / np.where(np.abs(slope) > 1e-9, slope, np.nan)
    inner = error[10:-10, 10:-10]
    assert np.isfinite(inner).mean() > 0.95
    assert abs(np.nanmedian(inner)) < 0.01
    assert np.nanpercentile(np.abs(inner), 95) < 0.15


def test_the_table_of_direct_light_agrees_with_mitsubas_own_projector():
    scene = scene_of({**CARD, 'rotation': [10, 20, 0]}, BALL, rig=small_rig({'blur': 0}))
    pattern, camera = smooth_pattern(96, 128), scene.rig.left
    renderer = Renderer(scene, samples=4, indirect=False)
    mine = renderer.radiance(camera, pattern)
    view = View.of(camera, 4)
    lit = renderer.world.lit_by(renderer.world.pattern_projector(
        pattern_light(scene.rig.projector, pattern)))
    values = _render(renderer.world, lit, view, camera.pose, {'type': 'direct'}, 5)
    theirs = _averaged(values[:, :3], pixel_index(camera, view.centers()), camera)[0]
    theirs = theirs.reshape(mine.shape)
    assert mine.mean() == pytest.approx(theirs.mean(), rel=2e-3)
    assert np.median(np.abs(mine - theirs)) < 0.01 * mine.mean()


def test_a_white_card_across_the_projector_is_lit_evenly_and_by_its_albedo():
    rig = small_rig({'position': [0, 0, 0], 'rotation': [0, 0, 0], 'field_of_view': 80})
    light = left_radiance(scene_of({**CARD, 'material': {'color': 0.5}}, rig=rig), uniform(255))
    # E = power / z^2 and L = albedo E / pi, all over the card
    np.testing.assert_allclose(light, 0.5 / np.pi / 0.4 ** 2, rtol=2e-3)


def test_a_pixel_of_the_pattern_lights_the_place_that_the_projection_says():
    scene = scene_of(CARD, rig=small_rig({'blur': 0}))
    pattern = uniform(0)
    pattern[120:128, 90:98] = 255
    light = left_radiance(scene, pattern).sum(axis=-1)
    v, u = np.indices(light.shape)
    center = np.array([(light * u).sum(), (light * v).sum()]) / light.sum()
    camera, projector = scene.rig.left, scene.rig.projector
    ray = np.array([(center[0] - camera.K[0, 2]) / camera.K[0, 0],
                    (center[1] - camera.K[1, 2]) / camera.K[1, 1], 1]) @ camera.pose.rotation.T
    point = camera.pose.position + ray * 0.4 / ray[2]
    column, row, _, _ = projector_coordinates(projector, point[None])
    assert column[0] * 256 - 0.5 == pytest.approx(93.5, abs=0.15)
    assert row[0] * 256 + 96 - 0.5 == pytest.approx(123.5, abs=0.15)


def test_gamma_and_black_level_turn_values_into_light():
    projector = scene_of(CARD, rig=small_rig({'gamma': 2.0, 'black_level': 0.1})).rig.projector
    light = pattern_light(projector, np.array([[[0, 51, 255]]], np.uint8))
    np.testing.assert_allclose(light[0, 0], [0.1, 0.1 + 0.9 * 0.04, 1.0], rtol=1e-5)


def test_the_projector_is_sharp_in_its_focus_only():
    rig = small_rig({'aperture': 0.01, 'focus': 0.4, 'blur': 0.3})
    projector = scene_of(CARD, rig=rig).rig.projector
    assert projector.blur_at(0.4, 256) == pytest.approx(0.3)
    # f A |1/z - 1/z_f| / 4, with f = 128 / tan 23 deg
    disk = 128 / np.tan(np.radians(23)) * 0.01 * (1 / 0.3 - 1 / 0.4)
    assert projector.blur_at(0.3, 256) == pytest.approx(np.hypot(0.3, disk / 4))
    step = uniform(0)
    step[:, 128:] = 255
    depth = np.array([0.3, 0.4], np.float32)
    stack, level_of = pattern_stack(projector, step, depth)
    near, sharp = (stack[int(round(float(level)))][96, :, 0] for level in level_of(depth))
    assert np.abs(np.diff(sharp)).max() > 1.5 * np.abs(np.diff(near)).max()


def test_light_adds_up():
    scene = scene_of(CARD, BALL, ambient=0.3, indirect=False)
    pattern = smooth_pattern(96, 128) // 2
    renderer = Renderer(scene, samples=2)
    one, two, none = (renderer.radiance(scene.rig.left, image)
                      for image in (pattern, 2 * pattern, 0 * pattern))
    np.testing.assert_allclose(two - none, 2 * (one - none), atol=1e-5)
    assert none.min() > 0


def test_a_closed_white_surrounding_gives_the_radiance_of_ambient_light_times_albedo():
    card = {**CARD, 'material': {'color': 0.5}}
    light = left_radiance(scene_of(card, ambient=0.6), uniform(0), samples=6)
    np.testing.assert_allclose(light.mean(), 0.3, rtol=0.01)


def test_a_concave_corner_gathers_bounced_light_and_a_card_alone_has_none():
    walls = [{'shape': 'plane', 'position': [side * 0.08, 0, 0.38], 'rotation': [0, side * 40, 0],
              'size': [0.22, 0.4]} for side in (-1, 1)]
    white = uniform(255, 256, 256)
    corner, alone = scene_of(*walls), scene_of(CARD)
    extra = left_radiance(corner, white, samples=2, indirect=True) - left_radiance(
        corner, white, samples=2)
    assert 0.05 < extra.mean() / left_radiance(corner, white, samples=2).mean() < 0.6
    none = left_radiance(alone, white, samples=2, indirect=True) - left_radiance(
        alone, white, samples=2)
    assert np.abs(none).max() < 1e-6


def test_a_red_wall_bounces_red_light():
    wall = {'shape': 'plane', 'position': [0.08, 0, 0.35], 'rotation': [0, 70, 0],
            'size': [0.2, 0.4], 'material': {'color': [0.8, 0.02, 0.02]}}
    scene = scene_of({**CARD, 'size': [0.3, 0.3]}, wall)
    white = uniform(255, 256, 256)
    bounced = left_radiance(scene, white, samples=2, indirect=True) - left_radiance(
        scene, white, samples=2)
    card = bounced[:, :40].mean(axis=(0, 1))
    assert card[0] > 5 * card[1]


@pytest.mark.parametrize('name', sorted(MATERIALS))
def test_every_material_reflects_some_light_and_not_more_than_it_gets(name):
    light = left_radiance(scene_of({**CARD, 'material': name}), uniform(255, 256, 256), samples=1)
    assert light.min() >= 0 and 0.01 < light.mean() < 6
    assert np.isfinite(light).all()


def test_dark_plastic_is_much_darker_than_white_cardboard():
    dark, white = (np.median(left_radiance(
        scene_of({**CARD, 'material': name}), uniform(255, 256, 256), samples=1))
        for name in ('dark_plastic', 'white_cardboard'))
    assert dark < 0.15 * white


def test_polished_metal_shows_a_highlight_that_moves_with_the_camera():
    scene = scene_of({**CARD, 'material': 'polished_brass'})
    renderer = Renderer(scene, samples=2, indirect=False)
    columns = []
    for camera in (scene.rig.left, scene.rig.right):
        light = renderer.radiance(camera, uniform(255, 256, 256)).sum(axis=-1)
        ray = np.unravel_index(np.argmax(cv2.blur(light, (7, 7))), light.shape)[1]
        columns.append(ray)
        assert light.max() > 5 * np.median(light)
    assert abs(columns[0] - columns[1]) > 10


@pytest.mark.parametrize('pattern', ['checker', 'stripes', 'grain', 'speckle', 'print'])
def test_a_texture_prints_with_the_contrast_that_was_asked_for(pattern):
    albedo = texture_image({'pattern': pattern, 'scale': 12.0, 'contrast': 0.5}, (0.8, 0.6, 0.4))
    assert albedo.shape[2] == 3 and albedo.dtype == np.float32
    assert albedo.max() <= 0.8 + 1e-6 and albedo.min() >= 0.5 * 0.4 - 1e-6
    assert albedo.std(axis=(0, 1)).min() > 0.01


def test_a_printed_texture_shows_in_the_image():
    checker = {'color': 0.8, 'texture': {'pattern': 'checker', 'scale': 40, 'contrast': 1.0}}
    light = left_radiance(scene_of({**CARD, 'material': checker}), uniform(255, 256, 256))
    assert light.min() < 0.05 * light.max()


def test_a_texture_from_a_file_is_the_picture(tmp_path):
    picture = np.zeros((8, 8, 3), np.uint8)
    picture[:, 4:] = (0, 0, 255)  # OpenCV writes BGR: the right half is red
    cv2.imwrite(str(tmp_path / 'half.png'), picture)
    albedo = texture_image({'pattern': 'image', 'contrast': 1.0, 'file': tmp_path / 'half.png'},
                           (0.5, 0.5, 0.5))
    np.testing.assert_allclose(albedo[100, 10], 0, atol=1e-6)
    np.testing.assert_allclose(albedo[100, -10], [0.5, 0, 0], atol=1e-6)


def test_a_cached_rendering_equals_a_fresh_one(tmp_path):
    scene, pattern = scene_of(CARD, BALL, ambient=0.1), smooth_pattern(96, 128)
    fresh = Renderer(scene, samples=2).render(pattern, seed=3)
    Renderer(scene, samples=2, cache=tmp_path).render(pattern, seed=3)
    cached = Renderer(scene, samples=2, cache=tmp_path)
    again = cached.render(pattern, seed=3)
    assert cached._world is None, 'the scene was not needed a second time'
    np.testing.assert_array_equal(again.left_rgb, fresh.left_rgb)
    np.testing.assert_array_equal(again.right_rgb, fresh.right_rgb)
    np.testing.assert_array_equal(again.truth.depth, fresh.truth.depth)
    assert not list(tmp_path.rglob('.*')), 'no temporary file is left'


def test_the_cache_tells_scenes_apart_that_differ_in_one_number(tmp_path):
    first, second = (scene_of({**CARD, 'position': [0, 0, z]}) for z in (0.4, 0.41))
    assert first.fingerprint != second.fingerprint
    depths = [Renderer(scene, samples=1, cache=tmp_path).truth((64, 64)).depth.mean()
              for scene in (first, second)]
    assert depths == pytest.approx([0.4, 0.41])


def test_the_same_seed_gives_the_same_bytes_and_another_one_other_noise():
    scene, pattern = scene_of(CARD), smooth_pattern(96, 128)
    one, same, other = (Renderer(scene, samples=1, indirect=False).render(pattern, seed=seed)
                        for seed in (1, 1, 2))
    assert one.left_rgb.tobytes() == same.left_rgb.tobytes()
    assert one.right_rgb.tobytes() == same.right_rgb.tobytes()
    assert one.left_rgb.tobytes() != other.left_rgb.tobytes()


@pytest.mark.parametrize('pattern', [np.zeros((4, 4), np.uint8), np.zeros((4, 4, 3)), None])
def test_a_pattern_that_is_no_color_image_is_refused(pattern):
    with pytest.raises(ImageError, match='expected uint8'):
        Renderer(scene_of(CARD)).render(pattern)


def test_left_and_right_may_differ_in_everything():
    rig = small_rig()
    rig['right'] = {'sensitivity': [1.0, 0.25, 0.5], 'dark_level': 20, 'exposure': 0.1,
                    'focal': 100, 'distortion': [0.1, 0, 0, 0], 'demosaicing': 'edge_aware'}
    rig['left'] = {'exposure': 0.1}
    rendering = Renderer(scene_of(CARD, rig=rig), samples=2, indirect=False).render(
        uniform(128, 256, 256))
    left, right = (image[30:60, 30:60].astype(float).mean(axis=(0, 1))
                   for image in (rendering.left_rgb, rendering.right_rgb))
    assert (right[1] - 20) / (left[1] - 2) == pytest.approx(0.25, abs=0.05)
    assert rendering.calibration.right.K[0, 0] == 100
    assert rendering.calibration.left.K[0, 0] == 120
    assert rendering.left_rgb.shape == (SIZE, SIZE, 3)

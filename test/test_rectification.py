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
"""Rectification: points land where the projection says, and outside is known as outside."""

from dataclasses import replace

from color_stereo_ros.core import ColorStereo, ImageError, Settings, StereoCalibration
from color_stereo_ros.core.cameras.lenses import Lens, LENSES
from color_stereo_ros.core.cameras.rectification import (
    FAR_OUTSIDE, inside_image, raw_coordinates, Rectifier)
import cv2
import numpy as np
import pytest
from scenes import paper_settings, parallel_rig

SIZE = (160, 120)
K = np.array([[150.0, 0, 78.0], [0, 152.0, 61.0], [0, 0, 1]])
MODELS = {
    'plumb_bob': [-0.25, 0.08, 0.002, -0.001, 0.0],
    'rational_polynomial': [-0.25, 0.08, 0.002, -0.001, 0.0, 0.05, 0.01, 0.0],
    'equidistant': [0.05, -0.02, 0.003, -0.001],
}


def rig(model, turn=0.3):
    """Return a verged rig with lens distortion."""
    rotation, _ = cv2.Rodrigues(np.array([0.0, turn, 0.02]))
    return StereoCalibration.from_arrays(SIZE, K, MODELS[model], K, MODELS[model], rotation,
                                         -rotation @ [0.1, 0, 0.01], distortion_model=model)


def raw_pixel(camera, point):
    """Return the raw pixel of a point in physical camera coordinates, by OpenCV's projection."""
    point = np.asarray(point, float).reshape(1, 1, 3)
    if camera.distortion_model == 'equidistant':
        return cv2.fisheye.projectPoints(point, np.zeros(3), np.zeros(3), camera.K.copy(),
                                         camera.D.copy())[0].ravel()
    return cv2.projectPoints(point, np.zeros(3), np.zeros(3), camera.K.copy(),
                             camera.D.copy())[0].ravel()


@pytest.mark.parametrize('model', MODELS)
def test_rectified_pixels_are_taken_from_where_the_lens_puts_them(model):
    camera = rig(model).left
    x, y = raw_coordinates(camera)
    for row, column in ((10, 20), (60, 80), (110, 140)):
        ray = np.linalg.solve(camera.P[:, :3] @ camera.R, [column, row, 1.0])
        expected = raw_pixel(camera, ray)
        np.testing.assert_allclose((x[row, column], y[row, column]), expected, atol=2e-3)


class Derived(Lens):
    """A lens that knows its distortion alone."""

    def __init__(self, lens):
        """Take the distortion of another lens."""
        self.lengths, self.distort = lens.lengths, lens.distort


@pytest.mark.parametrize('model', MODELS)
def test_what_a_lens_derives_from_its_distortion_equals_opencv(model):
    camera, lens = rig(model).left, LENSES[model]
    derived = Derived(lens)
    for ours, opencv in zip(derived.rectifying_map(camera), lens.rectifying_map(camera)):
        assert ours.dtype == np.float32 and ours.shape == (120, 160)
        np.testing.assert_allclose(ours, opencv, atol=1e-3)
    pixels = np.random.default_rng(1).uniform((0, 0), (159, 119), (50, 2))
    np.testing.assert_allclose(derived.undistort(pixels, K, camera.D),
                               lens.undistort(pixels, K, camera.D), atol=1e-6)


@pytest.mark.parametrize('model', LENSES)
@pytest.mark.parametrize('zeros', [False, True])
def test_a_lens_without_distortion_is_a_pinhole_or_a_fisheye(model, zeros):
    lens = LENSES[model]
    D = np.zeros(lens.lengths[-1] if zeros else 0)
    rays = np.random.default_rng(1).uniform(-0.5, 0.5, (20, 2))
    distorted = lens.distort(rays, D)
    radius = np.linalg.norm(rays, axis=1)
    expected = np.arctan(radius) if model == 'equidistant' else radius
    np.testing.assert_allclose(np.linalg.norm(distorted, axis=1), expected, atol=1e-12)
    np.testing.assert_allclose(
        lens.undistort(distorted @ K[:2, :2].T + K[:2, 2], K, D), rays, atol=1e-9)


def test_a_lens_that_knows_nothing_of_itself_chooses_the_views_of_a_pinhole_pair():
    left, right = rig('plumb_bob').left, rig('plumb_bob').right
    rotation, translation = rig('plumb_bob').right_from_left
    straight = StereoCalibration.from_arrays(SIZE, K, [], K, [], rotation, translation)
    views = Lens().rectified_views(left, right, rotation, translation.reshape(3, 1))
    for (R, P), camera in zip(views, (straight.left, straight.right)):
        np.testing.assert_array_equal(R, camera.R)
        np.testing.assert_array_equal(P, camera.P)


SKEWED = {side: np.array([[150.0, skew, 78.0], [0, 152.0, 61.0], [0, 0, 1]])
          for side, skew in (('left', -1.4), ('right', 4.3))}


def skewed_rig(model):
    """Return a verged rig whose cameras have skew."""
    rotation, translation = rig(model).right_from_left
    return StereoCalibration.from_arrays(
        SIZE, SKEWED['left'], MODELS[model], SKEWED['right'], MODELS[model], rotation, translation,
        distortion_model=model)


@pytest.mark.parametrize('side', ['left', 'right'])
@pytest.mark.parametrize('model', MODELS)
def test_skew_moves_the_raw_pixels(model, side):
    camera = getattr(skewed_rig(model), side)
    straight = replace(camera, K=np.array([[150.0, 0, 78.0], [0, 152.0, 61.0], [0, 0, 1]]))
    x, y = raw_coordinates(camera)
    for row, column in ((10, 20), (60, 80), (110, 140)):
        ray = np.linalg.solve(camera.P[:, :3] @ camera.R, [column, row, 1.0])
        u, v = raw_pixel(straight, ray)
        # [fx s cx] (x, y, 1): s y with y = (v - cy) / fy
        u += SKEWED[side][0, 1] * (v - 61.0) / 152.0
        np.testing.assert_allclose((x[row, column], y[row, column]), (u, v), atol=2e-3)


@pytest.mark.parametrize('model', MODELS)
def test_a_lens_undoes_the_skew(model):
    lens, K_skewed = LENSES[model], SKEWED['right']
    D = np.array(MODELS[model])
    rays = np.random.default_rng(1).uniform(-0.4, 0.4, (50, 2))
    pixels = lens.distort(rays, D) @ K_skewed[:2, :2].T + K_skewed[:2, 2]
    np.testing.assert_allclose(lens.undistort(pixels, K_skewed, D), rays, atol=1e-6)
    np.testing.assert_allclose(Derived(lens).undistort(pixels, K_skewed, D), rays, atol=1e-6)
    camera = skewed_rig(model).right
    for ours, opencv in zip(Derived(lens).rectifying_map(camera), lens.rectifying_map(camera)):
        np.testing.assert_allclose(ours, opencv, atol=1e-3)


@pytest.mark.parametrize('method', ['surface', 'paper'])
@pytest.mark.parametrize('model', MODELS)
def test_a_card_seen_by_skewed_cameras_is_where_it_is(model, method):
    K_of = {side: np.array([[300.0, skew, 160.0 + shift], [0, 300, 119.0 + shift], [0, 0, 1]])
            for side, skew, shift in (('left', -1.4, 0.0), ('right', 4.3, 1.5))}
    cameras = [replace(camera, K=K_of[camera.name], D=0.4 * np.array(MODELS[model]),
                       distortion_model=model)
               for camera in (parallel_rig(320, 240, 300.0).left,
                              parallel_rig(320, 240, 300.0).right)]
    calibration = StereoCalibration(*cameras)
    geometry = calibration.geometry
    images = [card(camera, shift) for camera, shift in zip(cameras, (0.0, geometry.baseline))]
    limits = {'range.min_depth': 0.35, 'range.max_depth': 0.8, 'matching.method': method}
    depth = ColorStereo(calibration, Settings().updated(limits)).process(*images).depth
    for rows in (slice(0, 50), slice(95, 145), slice(190, 240)):
        assert np.nanmedian(depth[rows]) == pytest.approx(0.5, abs=2e-4)


def card(camera, shift):
    """Return what a camera with R = I sees of a colored card at Z = 0.5 m; shift: its X, m."""
    pixels = np.indices((camera.height, camera.width))[::-1].reshape(2, -1).T.astype(float)
    K_camera, lens = camera.K, LENSES[camera.distortion_model]
    y = (pixels[:, 1] - K_camera[1, 2]) / K_camera[1, 1]
    x = (pixels[:, 0] - K_camera[0, 2] - K_camera[0, 1] * y) / K_camera[0, 0]
    rays = lens.undistort(np.stack([x, y], axis=1), np.eye(3), camera.D)
    place = (rays * 0.5 + [shift, 0]) * 1200 + 500
    field = cv2.GaussianBlur(np.random.default_rng(5).normal(size=(1000, 1000, 2)).astype(
        np.float32), (0, 0), 8)
    hue = np.arctan2(field[..., 0], field[..., 1])
    colors = np.stack([110 + 90 * np.cos(hue + turn) for turn in (0, 2.1, 4.2)], axis=-1)
    place = place.reshape(camera.height, camera.width, 2).astype(np.float32)
    return np.rint(cv2.remap(colors.astype(np.float32), place, None, cv2.INTER_LINEAR,
                             borderMode=cv2.BORDER_REFLECT)).astype(np.uint8)


@pytest.mark.parametrize('model', MODELS)
def test_a_point_is_seen_in_the_same_rectified_row(model):
    calibration = rig(model)
    point = np.array([0.02, 0.03, 0.6])
    rotation, translation = calibration.right_from_left
    images = [spot(camera, position) for camera, position in (
        (calibration.left, point), (calibration.right, rotation @ point + translation))]
    pair = Rectifier(calibration).rectify(*images)
    (row_left, column_left), (row_right, column_right) = (
        centroid(image) for image in (pair.left, pair.right))
    geometry = calibration.geometry
    depth = (calibration.left.R @ point)[2]
    assert row_left == pytest.approx(row_right, abs=0.1)
    assert column_left - column_right == pytest.approx(
        geometry.focal_baseline / depth + geometry.principal_offset, abs=0.1)


def spot(camera, point):
    """Return a raw image with a smooth bright spot where the camera sees the point."""
    x, y = raw_pixel(camera, point)
    columns, rows = np.arange(SIZE[0]), np.arange(SIZE[1])[:, None]
    brightness = 250 * np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / (2 * 3.0 ** 2))
    return np.repeat(np.rint(brightness).astype(np.uint8)[..., None], 3, axis=2)


def centroid(image):
    """Return the (row, column) of the center of brightness."""
    weight = image[..., 0].astype(float)
    rows, columns = np.indices(weight.shape)
    return (weight * rows).sum() / weight.sum(), (weight * columns).sum() / weight.sum()


def test_an_ideal_rig_is_not_changed():
    image = np.random.default_rng(1).integers(0, 256, (24, 64, 3), np.uint8)
    pair = Rectifier(parallel_rig()).rectify(image, image)
    np.testing.assert_array_equal(pair.left, image)
    np.testing.assert_array_equal(pair.right, image)
    assert pair.left_inside.all() and pair.right_inside.all()


def test_rectified_input_is_passed_on_unchanged():
    image = np.random.default_rng(1).integers(0, 256, (SIZE[1], SIZE[0], 3), np.uint8)
    pair = Rectifier(rig('plumb_bob'), rectified_input=True).rectify(image, image)
    np.testing.assert_array_equal(pair.left, image)
    assert pair.left_inside.all() and pair.right_inside.all()


def test_pixels_without_a_raw_pixel_are_marked_and_black():
    cameras = [replace(camera, P=camera.P + np.array([[0, 0, 40.0, 0], [0] * 4, [0] * 4]))
               for camera in (rig('plumb_bob').left, rig('plumb_bob').right)]
    white = np.full((SIZE[1], SIZE[0], 3), 255, np.uint8)
    pair = Rectifier(StereoCalibration(*cameras)).rectify(white, white)
    outside = ~pair.left_inside
    assert outside.any() and not outside.all()
    assert (pair.left[pair.left_inside] >= 240).all()
    assert (pair.left[:, :20] == 0).all() and outside[:, :20].all()


def test_rays_behind_the_raw_camera_are_far_outside():
    camera = rig('plumb_bob').left
    turned = camera.R @ cv2.Rodrigues(np.array([0.0, 1.8, 0.0]))[0]
    behind = type(camera)('left', *SIZE, camera.distortion_model, camera.D, camera.K, turned,
                          camera.P)
    x, _ = raw_coordinates(behind)
    assert (x == FAR_OUTSIDE).any()


def test_a_mirrored_part_of_the_map_is_outside():
    columns, rows = np.meshgrid(np.arange(10.0), np.arange(8.0))
    inside = inside_image(9.0 - columns, rows, 10, 8)
    assert not inside.any()
    assert inside_image(columns, rows, 10, 8).all()


@pytest.mark.parametrize('image, message', [
    (None, 'left image is a NoneType, expected a numpy array'),
    ([[0]], 'left image is a list'),
    (np.zeros((24, 64, 3), np.float32), 'left image has dtype float32, expected uint8'),
    (np.zeros((24, 64, 3), np.uint16), 'left image has dtype uint16, expected uint8'),
    (np.zeros((24, 63), np.uint8), r'left image has shape \(24, 63\), expected \(24, 64, 3\)'),
    (np.zeros((24, 64), np.int16), 'left image has dtype int16, expected uint8 or uint16'),
    (np.zeros((64, 24, 3), np.uint8), r'left image has shape \(64, 24, 3\), expected'),
    (np.zeros((24, 64, 4), np.uint8), r'left image has shape \(24, 64, 4\), expected'),
    (np.zeros((0, 0, 3), np.uint8), r'left image has shape \(0, 0, 3\), expected'),
])
def test_a_wrong_image_is_refused_by_name_and_value(image, message):
    stereo = ColorStereo(parallel_rig(), paper_settings())
    good = np.zeros((24, 64, 3), np.uint8)
    with pytest.raises(ImageError, match=message):
        stereo.process(image, good)
    with pytest.raises(ImageError, match=message.replace('left', 'right', 1)):
        stereo.process(good, image)


def test_images_need_not_be_contiguous():
    calibration = parallel_rig()
    image = np.random.default_rng(1).integers(0, 256, (24, 64, 3), np.uint8)
    bgr = np.ascontiguousarray(image[..., ::-1])
    pair = Rectifier(calibration).rectify(bgr[..., ::-1], bgr[..., ::-1])
    np.testing.assert_array_equal(pair.left, image)

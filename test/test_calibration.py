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
"""Calibrations: read, written, derived, and refused with field and value."""

from types import SimpleNamespace

from color_stereo_ros.core import CalibrationError, ColorStereo, Settings, StereoCalibration
from color_stereo_ros.core.cameras.calibration import CameraModel
from color_stereo_ros.core.cameras.common_view import with_common_view
from color_stereo_ros.core.cameras.rectification import Rectifier
import cv2
import numpy as np
import pytest
from scenes import SCENES
import yaml

SIZE = (640, 480)
K = np.array([[600.0, 0, 310.0], [0, 605.0, 250.0], [0, 0, 1]])
D = [-0.21, 0.09, 0.001, -0.0005, -0.01]
RATIONAL = [-0.21, 0.09, 0.001, -0.0005, -0.01, 0.1, 0.05, 0.002]
FISHEYE = [0.05, -0.01, 0.003, -0.001]


def camera_info(**changes):
    """Return a left CameraInfo-like object of a rectified pair; changes replace fields."""
    fields = {'width': 640, 'height': 480, 'distortion_model': 'plumb_bob', 'd': [0.0] * 5,
              'k': [600.0, 0, 320, 0, 600, 240, 0, 0, 1],
              'r': [1.0, 0, 0, 0, 1, 0, 0, 0, 1],
              'p': [600.0, 0, 320, 0, 0, 600, 240, 0, 0, 0, 1, 0]}
    return SimpleNamespace(**{**fields, **changes})


def replaced(values, index, value):
    """Return a copy of a list with one element replaced."""
    values = list(values)
    values[index] = value
    return values


LEFT = camera_info()
RIGHT = camera_info(p=[600.0, 0, 330, -60.0, 0, 600, 240, 0, 0, 0, 1, 0])


def verged(angle_left=0.1, angle_right=-0.25, D_left=(), D_right=(), model=None):
    """Return a rig whose cameras turn in by different angles and tilt a little."""
    rotation, _ = cv2.Rodrigues(np.array([0.01, angle_right - angle_left, -0.02]))
    camera_in_left = np.array([0.2, 0.004, 0.03])
    return StereoCalibration.from_arrays(SIZE, K, D_left, K, D_right, rotation,
                                         -rotation @ camera_in_left, distortion_model=model)


def test_the_shared_rig_is_read_from_yaml():
    folder = SCENES / 'solids_hue1'
    geometry = StereoCalibration.from_yaml(folder / 'left.yaml', folder / 'right.yaml').geometry
    assert (geometry.width, geometry.height) == (512, 512)
    assert geometry.baseline == pytest.approx(0.2, abs=1e-12)
    assert geometry.principal_offset == pytest.approx(54.38025665 - 456.61974335, abs=1e-6)


def test_rectification_from_arrays_reproduces_the_shared_rig():
    folder = SCENES / 'solids_hue1'
    stored = StereoCalibration.from_yaml(folder / 'left.yaml', folder / 'right.yaml')
    rotation, translation = stored.right_from_left
    derived = StereoCalibration.from_arrays((512, 512), stored.left.K, stored.left.D,
                                            stored.right.K, stored.right.D, rotation, translation)
    # OpenCV 4 counts the last pixel differently when it fits the focal length to the image.
    tolerance = 1e-6 if cv2.__version__ >= '5' else 0.5
    for side in ('left', 'right'):
        np.testing.assert_allclose(getattr(derived, side).R, getattr(stored, side).R, atol=1e-9)
        np.testing.assert_allclose(getattr(derived, side).P, getattr(stored, side).P,
                                   atol=tolerance)


def test_right_from_left_returns_the_motion_it_was_built_from():
    rotation, _ = cv2.Rodrigues(np.array([0.01, -0.35, -0.02]))
    translation = -rotation @ [0.2, 0.004, 0.03]
    calibration = StereoCalibration.from_arrays(SIZE, K, D, K, D, rotation, translation)
    found_rotation, found_translation = calibration.right_from_left
    np.testing.assert_allclose(found_rotation, rotation, atol=1e-9)
    np.testing.assert_allclose(found_translation, translation, atol=1e-9)


@pytest.mark.parametrize('coefficients, model', [
    ((), 'plumb_bob'), (D[:4], 'plumb_bob'), (D, 'plumb_bob'),
    (RATIONAL, 'rational_polynomial'), (FISHEYE, 'equidistant')])
def test_a_point_lies_in_the_same_row_of_both_rectified_images(coefficients, model):
    calibration = verged(D_left=coefficients, D_right=coefficients, model=model)
    rotation, translation = calibration.right_from_left
    in_left = np.array([0.05, -0.08, 0.9])
    in_right = rotation @ in_left + translation
    u_left, v_left = project(calibration.left, in_left)
    u_right, v_right = project(calibration.right, in_right)
    geometry = calibration.geometry
    depth = (calibration.left.R @ in_left)[2]
    assert v_left == pytest.approx(v_right, abs=1e-6)
    assert u_left - u_right == pytest.approx(
        geometry.focal_baseline / depth + geometry.principal_offset, abs=1e-6)


def project(camera, point):
    """Return the rectified pixel of a point in physical camera coordinates."""
    u, v, w = camera.P[:, :3] @ camera.R @ point
    return u / w, v / w


def test_more_than_five_coefficients_mean_the_rational_model():
    assert verged(D_left=RATIONAL).left.distortion_model == 'rational_polynomial'
    assert verged(D_left=D).left.distortion_model == 'plumb_bob'


def test_verged_cameras_have_different_principal_points():
    assert abs(verged().geometry.principal_offset) > 50


def test_camera_info_is_read_like_yaml():
    calibration = StereoCalibration.from_camera_info(LEFT, RIGHT)
    assert calibration.geometry.baseline == pytest.approx(0.1)
    assert calibration.geometry.principal_offset == -10
    assert calibration.left.K.dtype == np.float64 and calibration.left.K.shape == (3, 3)


def test_an_empty_distortion_means_none():
    info = camera_info(d=[])
    assert StereoCalibration.from_camera_info(info, RIGHT).left.D.size == 0


def test_writing_and_reading_changes_nothing(tmp_path):
    calibration = verged(D_left=D, D_right=D)
    paths = tmp_path / 'left.yaml', tmp_path / 'right.yaml'
    calibration.to_yaml(*paths)
    again = StereoCalibration.from_yaml(*paths)
    for side in ('left', 'right'):
        for field in 'DKRP':
            np.testing.assert_array_equal(getattr(getattr(again, side), field),
                                          getattr(getattr(calibration, side), field))
    assert sorted(path.name for path in tmp_path.iterdir()) == ['left.yaml', 'right.yaml']


def test_arrays_of_a_camera_cannot_be_changed():
    with pytest.raises(ValueError, match='read-only'):
        StereoCalibration.from_camera_info(LEFT, RIGHT).left.K[0, 0] = 1.0


@pytest.mark.parametrize('changes, message', [
    ({'k': [0.0] * 9}, r'left K\[0\] = 0.0 px.*not calibrated'),
    ({'k': replaced(LEFT.k, 4, -600.0)}, r'left K\[4\] = -600.0 px'),
    ({'k': replaced(LEFT.k, 2, float('nan'))}, r'left K\[2\] = nan is not a finite number'),
    ({'k': replaced(LEFT.k, 8, 0.0)}, 'left K = .* is no camera matrix'),
    ({'k': LEFT.k[:8]}, 'left K has 8 values, expected 9'),
    ({'k': 'abc'}, "left K = 'abc' is no list of numbers"),
    ({'d': [0.0] * 5 + [0.1]}, r'left D\[5\] = 0.1, but distortion_model plumb_bob has 5 coeff.*'
     'is it rational_polynomial'),
    ({'d': [0.0] * 14 + [0.1], 'distortion_model': 'rational_polynomial'},
     r'left D\[14\] = 0.1, but distortion_model rational_polynomial has 14 coefficients'),
    ({'d': [0.0] * 4 + [1e-3], 'distortion_model': 'equidistant'}, r'left D\[4\] = 0.001, but'),
    ({'d': [float('inf')] * 5}, r'left D\[0\] = inf'),
    ({'distortion_model': 'fov'}, "left distortion_model = 'fov' is unknown, expected one of pl"),
    ({'distortion_model': 'fisheye'}, 'fisheye.* is unknown.*ROS calls the same model equidis'),
    ({'distortion_model': 'radtan'}, 'radtan.* is unknown.*ROS calls the same model plumb_bob'),
    ({'distortion_model': 'x' * 100000},
     r"left distortion_model = 'x+\.\.\. \(100000 characters\) \.\.\.x+' is unknown"),
    ({'distortion_model': ''}, "left distortion_model = '' is unknown.*rectified already need P"),
    ({'r': [0.0] * 9}, 'left R = .* is not a rotation'),
    ({'r': [1, 0, 0, 0, 1, 0, 0, 0, -1]}, 'left R = .* determinant -1'),
    ({'r': LEFT.r[:4]}, 'left R has 4 values, expected 9'),
    ({'p': replaced(LEFT.p, 0, 0.0)}, r'left P\[0\] = 0.0 px'),
    ({'p': replaced(LEFT.p, 5, -1.0)}, r'left P\[5\] = -1.0 px'),
    ({'p': replaced(LEFT.p, 10, 2.0)}, r'left P\[8..11\] = '),
    ({'p': replaced(LEFT.p, 1, 0.5)}, 'left P.* has no skew'),
    ({'p': LEFT.p[:11]}, 'left P has 11 values, expected 12'),
    ({'p': replaced(LEFT.p, 3, -61.0)}, r'left P\[3\] = -61.0 px m, expected 0.*swapped'),
    ({'p': replaced(LEFT.p, 3, -60.0)}, r'left P\[3\] = -60.0 px m and right P\[3\] = '
     '-60.0 px m: no baseline between them'),
    ({'p': replaced(LEFT.p, 3, -60 + 1e-9)}, 'no baseline between them'),
    ({'p': replaced(LEFT.p, 7, 5.0)}, r'left P\[7\] = 5.0 px m'),
    ({'width': 0}, 'left width = 0 px is not an image size'),
    ({'height': -480}, 'left height = -480 px is not an image size'),
    ({'width': 640.5}, 'left width = 640.5 px is not an image size'),
    ({'width': 3, 'height': 3}, 'left width = 3 px is not an image size, expected 8 .. 32766 px'),
    ({'width': 2, 'height': 2000}, 'left width = 2 px is not'),
    ({'width': 64, 'height': 1}, 'left height = 1 px is not'),
    ({'width': 32767}, 'left width = 32767 px is not'),
    ({'width': 10 ** 400}, r'left width = 10+\.\.\. \(401 characters\) \.\.\.0+ px is not'),
    ({'width': '640'}, "left width = '640' px is not"),
    ({'width': 1280}, 'left width x height = 1280 x 480 px, right = 640 x 480 px'),
])
def test_an_impossible_left_camera_is_refused(changes, message):
    with pytest.raises(CalibrationError, match=message):
        StereoCalibration.from_camera_info(camera_info(**changes), RIGHT).check_raw()


@pytest.mark.parametrize('changes', [
    {'distortion_model': '', 'd': []}, {'distortion_model': 'none'}, {'distortion_model': 'fov'},
    {'d': [float('nan')]}, {'r': [0.0] * 9}, {'k': [0.0] * 9}, {'k': [float('nan')] * 9},
    {'distortion_model': '', 'd': [], 'r': [0.0] * 9, 'k': [0.0] * 9}])
def test_rectified_images_need_p_alone(changes):
    calibration = StereoCalibration.from_camera_info(camera_info(**changes), RIGHT)
    assert calibration.geometry == StereoCalibration.from_camera_info(LEFT, RIGHT).geometry
    image = np.random.default_rng(1).integers(0, 256, (480, 640, 3), np.uint8)
    pair = Rectifier(calibration, rectified_input=True).rectify(image, image)
    np.testing.assert_array_equal(pair.left, image)
    with pytest.raises(CalibrationError, match='left '):
        Rectifier(calibration)
    with pytest.raises(CalibrationError, match='left '):
        calibration.right_from_left


DUST = 1e-14


@pytest.mark.parametrize('field, index', [
    *(('k', index) for index in (1, 3, 6, 7)), *(('p', index) for index in (1, 4, 8, 9, 11)),
    ('p', 3), ('p', 7)])
@pytest.mark.parametrize('dust', [DUST, -DUST, 5e-7])
def test_rounding_errors_where_a_zero_belongs_are_no_reason_to_refuse(field, index, dust):
    def dusty(info):
        values = getattr(info, field)
        changes = {field: replaced(values, index, values[index] + dust)}
        return SimpleNamespace(**{**vars(info), **changes})

    exact = StereoCalibration.from_camera_info(LEFT, RIGHT)
    for pair in ((dusty(LEFT), RIGHT), (LEFT, dusty(RIGHT)), (dusty(LEFT), dusty(RIGHT))):
        found = StereoCalibration.from_camera_info(*pair)
        found.check_raw()
        np.testing.assert_array_equal(found.left.K, exact.left.K)
        np.testing.assert_array_equal(found.left.P[:, :3], exact.left.P[:, :3])
        assert found.geometry.baseline == pytest.approx(0.1, abs=1e-8)


@pytest.mark.parametrize('field, index, value', [('k', 8, 1 + DUST), ('p', 10, 1 - DUST)])
def test_rounding_errors_where_a_one_belongs_are_no_reason_to_refuse(field, index, value):
    info = camera_info(**{field: replaced(getattr(LEFT, field), index, value)})
    found = StereoCalibration.from_camera_info(info, RIGHT)
    found.check_raw()
    assert getattr(found.left, field.upper())[2, 2] == 1


@pytest.mark.parametrize('dust', [DUST, -DUST])
def test_a_baseline_of_rounding_errors_is_none(dust):
    info = camera_info(p=replaced(RIGHT.p, 3, dust))
    with pytest.raises(CalibrationError, match='the pair has no baseline'):
        StereoCalibration.from_camera_info(LEFT, info)


@pytest.mark.parametrize('left, right', [(-30.0, -90.0), (60.0, 0.0), (30.0, -30.0)])
def test_a_third_camera_may_be_the_reference(left, right):
    infos = [camera_info(p=replaced(replaced(info.p, 3, shift), 7, 12.0))
             for info, shift in ((LEFT, left), (RIGHT, right))]
    geometry = StereoCalibration.from_camera_info(*infos).geometry
    assert geometry == StereoCalibration.from_camera_info(LEFT, RIGHT).geometry


@pytest.mark.parametrize('model, given, taken', [
    ('plumb_bob', [], []), ('plumb_bob', [0.1], [0.1, 0, 0, 0]),
    ('plumb_bob', [0.1, 0.2], [0.1, 0.2, 0, 0]), ('plumb_bob', [0.1] * 5, [0.1] * 5),
    ('plumb_bob', [0.1] * 5 + [0.0] * 9, [0.1] * 5), ('plumb_bob', [0.0] * 9, [0.0] * 5),
    ('plumb_bob', [0.1] * 5 + [1e-14], [0.1] * 5),
    ('rational_polynomial', [0.1] * 5, [0.1] * 5 + [0.0] * 3),
    ('rational_polynomial', [0.1] * 9, [0.1] * 9 + [0.0] * 3),
    ('rational_polynomial', [0.1] * 14 + [0.0] * 2, [0.1] * 14),
    ('equidistant', [0.1] * 2, [0.1, 0.1, 0, 0]), ('equidistant', [0.1] * 4 + [0.0], [0.1] * 4)])
def test_missing_coefficients_are_zero_and_zeros_at_the_end_do_not_matter(model, given, taken):
    camera = StereoCalibration.from_camera_info(
        camera_info(distortion_model=model, d=given), RIGHT).left
    camera.check_raw()
    assert camera.D.tolist() == taken


@pytest.mark.parametrize('index, value, message', [
    (3, 0.0, r'right P\[3\] = 0.0 px m: the pair has no baseline'),
    (3, 60.0, r'right P\[3\] = 60.0 px m is positive.*swapped'),
    (3, -60000.0, 'baseline of 100 m, outside 0.001 .. 5.0 m: given in millimeters'),
    (3, -0.06, 'baseline of 0.0001 m, outside'),
    (7, -60.0, r'right P\[7\] = -60.0 px m: cameras above one another'),
    (0, 610.0, r'left P\[0\] = 600.0 px and right P\[0\] = 610.0 px.*focal length fx'),
    (5, 590.0, r'left P\[5\] = 600.0 px and right P\[5\] = 590.0 px.*focal length fy'),
    (6, 241.0, r'left P\[6\] = 240.0 px and right P\[6\] = 241.0 px.*principal row cy'),
])
def test_an_impossible_pair_is_refused(index, value, message):
    with pytest.raises(CalibrationError, match=message):
        StereoCalibration.from_camera_info(LEFT, camera_info(p=replaced(RIGHT.p, index, value)))


@pytest.mark.parametrize('down', [-60.0, 60.0])
def test_exactly_vertical_stereo_is_named(down):
    info = camera_info(p=replaced(replaced(RIGHT.p, 3, 0.0), 7, down))
    with pytest.raises(CalibrationError, match='Vertical stereo is not supported: turn both'):
        StereoCalibration.from_camera_info(LEFT, info)
    with pytest.raises(CalibrationError, match='Vertical stereo is not supported: turn both'):
        StereoCalibration.from_arrays(SIZE, K, D, K, D, np.eye(3), [0, down / 600, 0])


@pytest.mark.parametrize('changes, message', [
    ({'binning_x': 2}, 'left binning_x = 2 is not supported, expected 0 or 1'),
    ({'binning_y': 4}, 'left binning_y = 4 is not supported'),
    ({'roi': SimpleNamespace(x_offset=0, y_offset=16)}, r'left roi = 0 x 0 px at \(0, 16\)'),
    ({'roi': SimpleNamespace(x_offset=0, y_offset=0, width=320, height=480)},
     r'left roi = 320 x 480 px at \(0, 0\) is not supported, expected the whole image')])
def test_binned_and_cut_images_are_refused(changes, message):
    with pytest.raises(CalibrationError, match=message):
        StereoCalibration.from_camera_info(camera_info(**changes), RIGHT)


def test_the_whole_image_may_be_written_as_a_window_without_a_size_or_of_the_size_of_the_image():
    for width, height in ((0, 0), (640, 480)):
        info = camera_info(roi=SimpleNamespace(x_offset=0, y_offset=0, width=width,
                                               height=height))
        assert StereoCalibration.from_camera_info(info, RIGHT).left.width == 640


def test_no_binning_may_be_written_as_zero_or_one():
    for binning in (0, 1):
        info = camera_info(binning_x=binning, binning_y=binning)
        assert StereoCalibration.from_camera_info(info, RIGHT).left.width == 640


def test_swapped_cameras_are_recognized():
    with pytest.raises(CalibrationError, match='swapped'):
        StereoCalibration.from_camera_info(RIGHT, LEFT)


@pytest.mark.parametrize('rotation, translation, message', [
    (np.eye(3), [0.2, 0, 0], r't = \[0.2, 0.0, 0.0\] m.*swapped'),
    (np.eye(3), [-0.01, -0.2, 0], 'expected to its right'),
    (np.eye(3), [-0.2, 0], 't has 2 values, expected 3'),
    (np.eye(3), [np.nan, 0, 0], r't\[0\] = nan is not a finite number'),
    (np.eye(3), [0, 0, 0], 'the pair has no baseline'),
    (np.eye(3), 'x', "t = 'x' is no list of numbers"),
    ('x', [-0.2, 0, 0], "R = 'x' is no list of numbers"),
    (2 * np.eye(3), [-0.2, 0, 0], 'R = .* is not a rotation'),
    (np.eye(2), [-0.2, 0, 0], 'R has 4 values, expected 9'),
    (np.eye(3), [-200.0, 0, 0], 'baseline of 200 m.*millimeters'),
])
def test_an_impossible_motion_is_refused(rotation, translation, message):
    with pytest.raises(CalibrationError, match=message):
        StereoCalibration.from_arrays(SIZE, K, D, K, D, rotation, translation)


@pytest.mark.parametrize('size', [(3, 3), (2, 2000), (64, 1), (0, 0), (-8, 8)])
def test_a_size_without_room_for_a_measurement_is_refused(size):
    with pytest.raises(CalibrationError, match='px is not an image size, expected 8 .. 32766 px'):
        StereoCalibration.from_arrays(size, K, D, K, D, np.eye(3), [-0.2, 0, 0])


@pytest.mark.parametrize('method', ['surface', 'paper'])
@pytest.mark.parametrize('size', [(8, 8), (8, 64), (64, 8)])
def test_the_smallest_images_are_measured(size, method):
    K_small = np.array([[50.0, 0, 4], [0, 50, 4], [0, 0, 1]])
    calibration = StereoCalibration.from_arrays(size, K_small, [], K_small, [], np.eye(3),
                                                [-0.1, 0, 0])
    stereo = ColorStereo(calibration, Settings().updated(
        {'matching.method': method, 'range.min_depth': 0.9, 'range.max_depth': 20.0}))
    image = np.random.default_rng(1).integers(0, 256, (*size[::-1], 3), np.uint8)
    assert stereo.process(image, image).depth.shape == size[::-1]


def converging(angle, model, skew=0.0):
    """Return rig and calibration of two cameras turned towards each other by angle each, deg."""
    K_each = np.array([[689.0, skew, 320.5], [0, 689.0, 238.0], [0, 0, 1]])
    D_each = {'plumb_bob': [-0.1, 0.05, 0.0, 0.0, 0.0], 'equidistant': [0.01, 0.002, 0.0, 0.0],
              'rational_polynomial': [-0.1, 0.05, 0, 0, 0, 0.02, 0, 0]}[model]
    rotation, _ = cv2.Rodrigues(np.array([0.01, np.radians(2 * angle), 0.02]))
    center = 0.2 * np.array([np.cos(np.radians(angle)), 0, np.sin(np.radians(angle))])
    return StereoCalibration.from_arrays(SIZE, K_each, D_each, K_each, D_each, rotation,
                                         -rotation @ center, distortion_model=model)


@pytest.mark.parametrize('model', ['plumb_bob', 'rational_polynomial', 'equidistant'])
@pytest.mark.parametrize('angle', [0, 12, 20, 24, 26, 28, 32, 36, 40])
def test_converging_cameras_keep_what_both_see(angle, model):
    calibration = converging(angle, model)
    rotation, translation = calibration.right_from_left
    places = []
    for side in ('left', 'right'):
        axis = np.array([0, 0, 0.1 / np.sin(np.radians(max(angle, 5)))])
        point = axis if side == 'left' else rotation @ axis + translation
        camera = getattr(calibration, side)
        places.append(project(camera, point))
        assert 0 <= places[-1][0] <= SIZE[0] - 1 and 0 <= places[-1][1] <= SIZE[1] - 1
    assert places[0][1] == pytest.approx(places[1][1], abs=1e-6)
    geometry = calibration.geometry
    assert 250 < geometry.focal_x < 1000
    black = np.zeros((*SIZE[::-1], 3), np.uint8)
    pair = Rectifier(calibration).rectify(black, black)
    assert min(pair.left_inside.mean(), pair.right_inside.mean()) > 0.6


def test_views_that_fit_side_by_side_get_one_principal_point():
    cameras = [CameraModel(name, *SIZE, 'plumb_bob', [], np.array(
        [[2000.0, 0, center], [0, 600.0, 240], [0, 0, 1]]), np.eye(3), np.eye(3, 4))
        for name, center in (('left', 320.0), ('right', 330.0))]
    poor = tuple((np.eye(3), np.array([[1e5, 0, -1e6, shift], [0, 1e5, 240, 0], [0, 0, 1, 0.0]]))
                 for shift in (0.0, -1e4))
    (_, P_left), (_, P_right) = with_common_view(*cameras, np.eye(3), np.array([[-0.1], [0], [0]]),
                                                 poor)
    assert P_left[0, 2] == P_right[0, 2]
    assert P_left[0, 0] == P_left[1, 1] == P_right[0, 0] == pytest.approx(600, rel=0.1)


def test_cameras_that_see_nothing_in_common_are_refused():
    with pytest.raises(CalibrationError, match='leave no view that both cameras share'):
        converging(-30, 'plumb_bob')


def test_an_impossible_size_is_refused():
    with pytest.raises(CalibrationError, match=r'size = 640, expected \(width, height\)'):
        StereoCalibration.from_arrays(640, K, D, K, D, np.eye(3), [-0.2, 0, 0])


@pytest.mark.parametrize('content, message', [
    ('just words', 'holds a str'),
    ('[1, 2', 'is no YAML'),
    ('', 'is empty, expected the fields'),
    ('image_width: 640', "no usable field 'image_height'"),
    (b'\xff\xfe\x00\x9f', 'cannot be read'),
])
def test_a_file_that_is_no_calibration_is_refused(tmp_path, content, message):
    path = tmp_path / 'left.yaml'
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(CalibrationError, match=message) as error:
        StereoCalibration.from_yaml(path, path)
    assert str(path) in str(error.value)


def test_something_else_than_a_path_is_refused():
    with pytest.raises(CalibrationError, match='left calibration None cannot be read'):
        StereoCalibration.from_yaml(None, None)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(CalibrationError, match='left calibration .*none.yaml cannot be read'):
        StereoCalibration.from_yaml(tmp_path / 'none.yaml', tmp_path / 'none.yaml')


def test_an_impossible_value_in_a_file_names_file_and_field(tmp_path):
    path = tmp_path / 'left.yaml'
    content = yaml.safe_load((SCENES / 'solids_hue1' / 'left.yaml').read_text())
    content['camera_matrix']['data'][0] = 0.0
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(CalibrationError, match=r'left.yaml: left K\[0\] = 0.0 px'):
        StereoCalibration.from_yaml(path, SCENES / 'solids_hue1' / 'right.yaml').check_raw()
    content['projection_matrix']['data'][0] = 0.0
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(CalibrationError, match=r'left.yaml: left P\[0\] = 0.0 px'):
        StereoCalibration.from_yaml(path, SCENES / 'solids_hue1' / 'right.yaml')


@pytest.mark.parametrize('line, message', [
    ('binning_x: 2', 'left binning_x = 2 is not supported'),
    ('roi: {x_offset: 4, y_offset: 0, width: 64, height: 64, do_rectify: true}',
     'left.yaml: left roi = 64 x 64 px')])
def test_a_printed_message_of_a_part_of_the_image_is_refused(tmp_path, line, message):
    path = tmp_path / 'left.yaml'
    path.write_text(yaml.safe_dump(vars(LEFT)) + line)
    with pytest.raises(CalibrationError, match=message):
        StereoCalibration.from_yaml(path, path)


@pytest.mark.parametrize('model', [[1], {'a': 1}, 7, None])
def test_an_odd_distortion_model_is_refused(model):
    with pytest.raises(CalibrationError, match='left distortion_model = .* is unknown'):
        StereoCalibration.from_camera_info(camera_info(distortion_model=model), RIGHT).check_raw()


def test_a_file_that_cannot_be_written_is_reported(tmp_path):
    with pytest.raises(CalibrationError, match='cannot be written'):
        StereoCalibration.from_camera_info(LEFT, RIGHT).to_yaml(
            tmp_path / 'none' / 'left.yaml', tmp_path / 'none' / 'right.yaml')

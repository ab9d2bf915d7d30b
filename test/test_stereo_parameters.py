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
"""The parameters of a pair as a vector, their covariance, and its file."""

from dataclasses import replace

from board_views import rectified

from color_stereo_ros.core import CalibrationError, StereoCalibration
from color_stereo_ros.core.cameras.covariance import (
    camera_hash, depth_derivatives, rectified_derivatives, StereoCovariance)
from color_stereo_ros.core.cameras.lenses import Lens, LENSES
from color_stereo_ros.core.cameras.parameters import StereoParameters

import numpy as np

import pytest

import yaml

MODELS = {
    'plumb_bob': [-0.11, 0.08, 0.002, -0.001, 0.01],
    'rational_polynomial': [-0.25, 0.08, 0.002, -0.001, 0.0, -0.15, 0.01, 0.0],
    'equidistant': [0.05, -0.02, 0.003, -0.001],
}
each_model = pytest.mark.parametrize('model', MODELS)


def parameters(model='plumb_bob'):
    """Return a verged pair of unequal cameras."""
    D = MODELS[model]
    return StereoParameters((640, 480), model, [640, 642, 322, 236, *D],
                            [636, 637, 318, 243, *np.multiply(D, 0.9)],
                            [0.01, 0.26, -0.005], [-0.193, 0.001, 0.052])


def some_covariance(count, seed=4):
    """Return a covariance matrix (n, n)."""
    root = 1e-3 * np.random.default_rng(seed).normal(size=(count, count))
    return root @ root.T


@each_model
def test_parameters_come_back_from_a_calibration_and_from_a_vector(model):
    given = parameters(model)
    for back in (StereoParameters.from_calibration(given.calibration()),
                 StereoParameters.from_vector((640, 480), model, given.vector)):
        np.testing.assert_allclose(back.vector, given.vector, rtol=1e-9, atol=1e-12)
        assert back.names == given.names and len(set(back.names)) == back.vector.size


def test_what_is_no_stereo_pair_is_refused():
    with pytest.raises(CalibrationError, match='13 values are no stereo parameters'):
        StereoParameters.from_vector((640, 480), 'plumb_bob', np.ones(13))
    with pytest.raises(CalibrationError, match='left and right have 4 and 5 values'):
        replace(parameters(), left=np.ones(4), right=np.ones(5))
    with pytest.raises(CalibrationError, match='is not a finite number'):
        replace(parameters(), rotation=[0, np.nan, 0])
    K = [[600, 1.0, 320], [0, 600, 240], [0, 0, 1]]
    skewed = StereoCalibration.from_arrays((640, 480), K, None, K, None, np.eye(3), [-0.1, 0, 0])
    with pytest.raises(CalibrationError, match='a skew is no parameter'):
        StereoParameters.from_calibration(skewed)


class Derived(Lens):
    """A lens that knows its distortion alone."""

    def __init__(self, lens):
        """Take the distortion of another lens."""
        self.lengths, self.distort = lens.lengths, lens.distort


@each_model
@pytest.mark.parametrize('kind', [lambda lens: lens, Derived])
def test_the_derivatives_of_a_projection_are_its_differences(model, kind):
    lens, intrinsics = kind(LENSES[model]), parameters(model).left
    points = np.random.default_rng(1).uniform([-0.1, -0.1, 0.3], [0.1, 0.1, 0.5], (20, 3))
    pixels, by_points, by_intrinsics = lens.project(points, intrinsics)
    step = 1e-6
    for axis, shift in enumerate(step * np.eye(3)):
        change = (lens.project(points + shift, intrinsics)[0] - pixels) / step
        np.testing.assert_allclose(by_points[:, :, axis], change, rtol=1e-4, atol=2e-2)
    for index, shift in enumerate(step * np.eye(intrinsics.size)):
        change = (lens.project(points, intrinsics + shift)[0] - pixels) / step
        np.testing.assert_allclose(by_intrinsics[:, :, index], change, rtol=1e-4, atol=1e-3)


@each_model
def test_rows_and_depth_follow_the_true_parameters_as_the_derivatives_say(model):
    truth = parameters(model)
    calibration = truth.calibration()
    geometry = calibration.geometry
    x, y = (each.ravel() for each in np.meshgrid([150.0, 320, 500], [80.0, 240, 400]))
    Z = np.full(x.size, 0.35)
    points = np.stack([(x - geometry.center_x_left) / geometry.focal_x * Z,
                       (y - geometry.center_y) / geometry.focal_y * Z, Z], -1)
    points = points @ calibration.left.R
    rows, disparity = rectified_derivatives(calibration, x, y, Z)
    depth = depth_derivatives(calibration, x, y, Z)
    before = rectified(calibration, truth, points)
    np.testing.assert_allclose(before[0], np.stack([x, y], 1), atol=1e-6)
    for index in range(truth.vector.size):
        step = 1e-6 * max(1.0, abs(truth.vector[index]))
        changes = []
        for sign in (1, -1):
            vector = truth.vector.copy()
            vector[index] += sign * step
            left, right = rectified(calibration, truth.changed(vector), points)
            changes.append(left - right)
        dx, dy = ((changes[0] - changes[1]) / (2 * step)).T
        np.testing.assert_allclose(rows[:, index], dy, rtol=1e-3, atol=2e-2)
        np.testing.assert_allclose(disparity[:, index], dx, rtol=1e-3, atol=2e-2)
    np.testing.assert_allclose(
        depth, -Z[:, None]**2 / geometry.focal_baseline * disparity, rtol=1e-12)


def test_standard_deviations_are_those_of_random_parameters():
    truth = parameters()
    calibration = truth.calibration()
    covariance = StereoCovariance.of(calibration, some_covariance(24))
    rng = np.random.default_rng(0)
    changes = rng.multivariate_normal(np.zeros(24), covariance.matrix, 20000, method='cholesky')
    rows, _ = rectified_derivatives(calibration, 300.0, 200.0, 0.4)
    depth = depth_derivatives(calibration, 300.0, 200.0, 0.4)
    assert covariance.rows_std(calibration, 300, 200, 0.4) == pytest.approx(
        (changes @ rows).std(), rel=0.03)
    assert covariance.depth_std(calibration, 300, 200, 0.4) == pytest.approx(
        (changes @ depth).std(), rel=0.03)
    assert covariance.depth_std(calibration, *np.ones((2, 3, 4)), 0.4).shape == (3, 4)


def test_points_beside_a_camera_have_no_standard_deviation():
    calibration = parameters().calibration()
    covariance = StereoCovariance.of(calibration, some_covariance(24))
    assert np.isnan(covariance.depth_std(calibration, 320, 240, -0.1))


def test_a_covariance_comes_back_from_its_file_and_knows_its_calibration(tmp_path):
    parameters().calibration().to_yaml(tmp_path / 'left.yaml', tmp_path / 'right.yaml')
    calibration = StereoCalibration.from_yaml(tmp_path / 'left.yaml', tmp_path / 'right.yaml')
    covariance = StereoCovariance.of(calibration, some_covariance(24))
    covariance.write(tmp_path / 'stereo_covariance.yaml')
    back = StereoCovariance.read(tmp_path / 'stereo_covariance.yaml')
    assert back.names == covariance.names and back.hashes == covariance.hashes
    np.testing.assert_array_equal(back.matrix, covariance.matrix)
    back.check(calibration)
    back.check(parameters().calibration())
    moved = parameters().vector
    moved[-1] += 1e-6
    with pytest.raises(CalibrationError, match='belongs to another left calibration'):
        back.check(parameters().changed(moved).calibration())
    with pytest.raises(CalibrationError, match='24 parameters, the calibration 30'):
        back.depth_std(parameters('rational_polynomial').calibration(), 0, 0, 1)


def test_the_hash_is_of_the_values_not_of_the_text():
    left = parameters().calibration().left
    same = replace(left, P=left.P * (1 + 1e-15) - 0.0, name='other', source='somewhere')
    assert camera_hash(left) == camera_hash(same)
    other = replace(left, K=left.K + np.diag([1e-6, 0, 0]))
    assert camera_hash(left) != camera_hash(other)


@pytest.mark.parametrize('change, words', [
    ({'matrix': [[1.0]]}, 'shape'),
    ({'matrix': [[1.0, 0.5], [0.1, 1.0]], 'names': ['a', 'b']}, 'not symmetric'),
    ({'matrix': [[1.0, 2.0], [2.0, 1.0]], 'names': ['a', 'b']}, 'correlation beyond 1'),
    ({'matrix': [[-1.0]], 'names': ['a']}, 'negative variance'),
    ({'matrix': [[np.nan]], 'names': ['a']}, 'no finite numbers'),
    ({'matrix': [['x']], 'names': ['a']}, 'no numbers'),
    ({'left': None}, 'expected the keys'),
    ({'names': 'ab'}, 'no lists'),
])
def test_a_damaged_covariance_file_is_refused_by_name(tmp_path, change, words):
    path = tmp_path / 'stereo_covariance.yaml'
    content = {'left': '0', 'right': '1', 'names': ['a', 'b'], 'matrix': [[1.0, 0], [0, 1.0]],
               **change}
    path.write_text(yaml.safe_dump({key: value for key, value in content.items()
                                    if value is not None}))
    with pytest.raises(CalibrationError, match=words) as raised:
        StereoCovariance.read(path)
    assert str(path) in str(raised.value)


def test_a_missing_covariance_file_is_refused(tmp_path):
    with pytest.raises(CalibrationError, match='cannot be read'):
        StereoCovariance.read(tmp_path / 'nothing.yaml')

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
"""`color_stereo plan`: known rigs give known answers, and impossible ones a clear sentence."""

from board_views import CORNERS, guided_poses, rms, rows_and_depth_errors, seen

from color_stereo_ros.calibration.adjustment import adjust
from color_stereo_ros.calibration.planning import expected_matrix, feature_size, plan, Rig
from color_stereo_ros.cli import main as cli
from color_stereo_ros.core import CalibrationError
from color_stereo_ros.core.cameras.covariance import StereoCovariance

import numpy as np

import pytest

WORDS = ['plan', '--baseline', '0.2', '--focal', '640', '--near', '0.3', '--far', '0.8']


def test_parallel_cameras_follow_the_formulas():
    found = plan(Rig(0.1, 600.0, (640, 480), 0.3, 1.2), CORNERS, views=3, disparity_std=0.1)
    np.testing.assert_allclose(found.disparity, 600 * 0.1 / found.depth, rtol=1e-6)
    np.testing.assert_allclose(found.matching_std, found.depth**2 / 60 * 0.1, rtol=1e-6)
    # of 640 columns 600 B / Z are seen by one camera alone
    np.testing.assert_allclose(found.common_width, (640 - found.disparity) * found.depth / 600,
                               rtol=1e-6)
    np.testing.assert_allclose(found.common_height, 480 * found.depth / 600, rtol=1e-6)
    assert found.depth[0] == pytest.approx(0.3) and found.depth[-1] == pytest.approx(1.2)


def test_the_plan_keeps_what_it_promises(effort, figures):
    rig, seeds = Rig(0.2, 640.0, (640, 480), 0.25, 0.5, aim=0.75), effort.seeds(3, 40)
    truth = rig.parameters()
    poses = guided_poses(truth, 15, distance=rig.middle)
    promised = StereoCovariance.of(truth.calibration(),
                                   expected_matrix(truth, CORNERS, rig.middle, 15))
    found = plan(rig, CORNERS, 15)
    index = int(np.argmin(np.abs(found.depth - 0.35)))
    errors = []
    for seed in seeds:
        result = adjust(truth.size, CORNERS, seen(truth, poses, np.random.default_rng(seed)))
        errors.append(rms(rows_and_depth_errors(result.calibration, truth,
                                                found.depth[index])[1]))
    figures('plan: depth error over the promise', rms(errors) / found.calibration_std[index], '',
            over=seeds, at_least=0.6 if effort.full else 0.3, at_most=1.3 if effort.full else 2.0)
    assert promised.std[0] < 0.2


def test_more_views_and_better_corners_help():
    rig = Rig(0.2, 640.0, (640, 480), 0.3, 0.8)
    few, many, better = (plan(rig, CORNERS, views, corner_sigma=sigma).calibration_std[12]
                         for views, sigma in ((4, 0.05), (20, 0.05), (20, 0.025)))
    assert better < 0.6 * many < 0.6 * few


def test_the_command_prints_and_plots(tmp_path, capsys):
    output = tmp_path / 'plan.svg'
    assert cli.main([*WORDS, '--aim', '0.75', '--output', str(output)]) == 0
    printed = capsys.readouterr().out
    assert 'turned toward each other by 15.2 degrees' in printed
    assert 'range.min_depth 0.3' in printed and 'pattern.feature_size 11.3' in printed
    assert '<svg' in output.read_text()
    assert cli.main([*WORDS, '--output', str(output)]) == 1
    assert 'exists already' in capsys.readouterr().err


def test_the_field_of_view_stands_for_the_focal_length(capsys):
    words = [word if word != '--focal' else '--fov' for word in WORDS]
    words[4] = '53.13'
    assert cli.main(words) == 0
    assert 'focal length 640 px' in capsys.readouterr().out


def test_cameras_that_see_nothing_in_common_are_told_so(capsys):
    assert cli.main([*WORDS[:5], '--near', '0.15', '--far', '0.8']) == 0
    assert 'see nothing in common at 0.150' in capsys.readouterr().out


@pytest.mark.parametrize('words, said', [
    (['--near', '0.9'], 'far = 0.8 m, expected more than near = 0.9 m'),
    (['--baseline', '-1'], 'baseline = -1.0 m, expected > 0'),
    (['--views', '1'], '--views = 1, expected 3 .. 1000'),
    (['--square-mm', '0.02'], 'expected 0.0001 .. 1.0 m'),
    (['--square-mm', '0.5'], 'no pose of the board can be detected'),
    (['--output', 'plan.xyz'], 'plan.xyz: cannot be written'),
])
def test_impossible_values_are_refused_in_a_clear_sentence(words, said, capsys, tmp_path,
                                                           monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main([*WORDS, *words]) in (1, 2)
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_the_feature_size_is_that_of_the_manual():
    assert feature_size(640, 1024, 46) == pytest.approx(9.0, rel=0.02)


def test_a_rig_that_cannot_be_calibrated_says_so():
    rig = Rig(0.5, 3000.0, (640, 480), 0.1, 0.2)
    with pytest.raises(CalibrationError, match='turn the cameras toward each other'):
        plan(rig, CORNERS)

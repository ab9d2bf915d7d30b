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
"""The drift of the cameras from pairs: carried, applied, taken back, told, written anew."""

from functools import lru_cache

from color_stereo_ros.cli import main as cli
from color_stereo_ros.core import CalibrationError, ColorStereo, StereoCalibration
from color_stereo_ros.core.cameras.covariance import StereoCovariance
from color_stereo_ros.core.cameras.parameters import StereoParameters
from color_stereo_ros.core.health.drift import corrected, expected_fields, SHOWN
from color_stereo_ros.core.health.posterior import (
    corrected_covariance, KnownDrift, parameters_by_drift)
from color_stereo_ros.core.health.prior import drift_by_parameters, drift_covariance
from color_stereo_ros.core.health.tracking import HealthTracker, posterior, TERMS
from color_stereo_ros.messages.contents import Header
from color_stereo_ros.messages.health import health_message, read_drift, suggestion, UNKNOWN
from color_stereo_ros.messages.outputs import Context, OUTPUTS
from color_stereo_ros.nodes.filling import message_of
from color_stereo_ros.parameters.groups import NodeHealthSettings, RangeNodeSettings
from color_stereo_ros.recordings.writing import write_recording
import numpy as np
import pytest
from surface_pairs import exposed, photographed, plane, rig, surface_settings
import test_health
from test_rows import same
import yaml

SIZE = 320, 240
KNOCK = np.array([0.15, 0.0, 0.2, 0.0, 0.0, 0.0]) / SHOWN
DISPARITY = plane(*SIZE, 30.0, 0.01, 0.02)
WORDS = ['--range.min_depth', str(32 / 44), '--range.max_depth', str(32 / 16)]


def settings(**changes):
    """Return settings for these pairs."""
    return surface_settings(16, 44, **changes)


@lru_cache(maxsize=8)
def pair(knocked, seed=1):
    """Return a pair of a plane from cameras as calibrated or knocked."""
    rng, calibration = np.random.default_rng(seed), rig(*SIZE)
    drift = KNOCK if knocked else 0 * KNOCK
    row, column = (each.ravel().astype(float) for each in np.mgrid[:SIZE[1], :SIZE[0]])
    rows, disparities = expected_fields(calibration, column + 30, row, np.full(row.size, 30.0))
    moved = [(each @ drift).reshape(SIZE[::-1]) for each in (rows, disparities)]
    return (exposed(photographed(-DISPARITY), rng),
            exposed(photographed(moved[1], rows=moved[0]), rng))


def test_a_knock_is_measured_applied_and_taken_back():
    stereo = ColorStereo(rig(*SIZE), settings(health__correct='apply'))
    sound = stereo.process(*pair(False))
    assert not sound.health.drifted and not sound.health.is_applied
    first = stereo.process(*pair(True))
    assert first.health.drifted and not first.health.is_applied
    after = [stereo.process(*pair(True, seed)) for seed in (2, 3, 4)]
    assert all(each.health.is_applied for each in after)
    error = (after[-1].health.drift - KNOCK) * SHOWN
    assert np.abs(error[[0, 2]]).max() < 0.01
    assert abs(after[-1].alignment.largest()[0]) < 0.1 < abs(first.alignment.largest()[0])
    assert after[-1].density > sound.density - 0.01
    assert after[-1].geometry == sound.geometry
    stereo.reset()
    again = stereo.process(*pair(False))
    assert same(again, sound) and not again.health.is_applied


def test_a_pair_with_given_values_depends_on_them_only():
    stereo = ColorStereo(rig(*SIZE), settings(health__correct='apply'))
    for seed in (1, 2):
        result = stereo.process(*pair(True, seed))
    given = result.alignment, result.projector, result.health
    kept = stereo.health
    one = stereo.process(*pair(True, 3), *given)
    assert stereo.health is kept
    stereo.reset()
    stereo.process(*pair(False))
    other = stereo.process(*pair(True, 3), *given)
    assert same(one, other)
    assert np.array_equal(one.health.drift, other.health.drift) and other.health.is_applied
    stereo.adopt_health(result.health)
    assert stereo.health is result.health


@pytest.mark.parametrize('choice', ['off', 'suggest'])
def test_nothing_is_corrected_without_being_asked(choice):
    stereo = ColorStereo(rig(*SIZE), settings(health__correct=choice))
    for seed in (1, 2):
        result = stereo.process(*pair(True, seed))
    assert result.health.drifted and not result.health.applied.any()
    assert 'calibrate update' in result.health.sentence()
    node = RangeNodeSettings(health=NodeHealthSettings(choice))
    found = suggestion(result.health, rig(*SIZE), node)
    assert (found is None) == (choice == 'off')


def test_without_rows_there_is_no_health():
    stereo = ColorStereo(rig(*SIZE), settings(matching__row_alignment='off'))
    result = stereo.process(*pair(False))
    assert result.health is None
    assert health_message(None, 'x', Header()).status[0].message == UNKNOWN


def covariance_of(calibration):
    """Return a StereoCovariance with the standard deviations of a good calibration."""
    names = StereoParameters.from_calibration(calibration).names
    spread = [0.05 if name[-2:] in ('fx', 'fy', 'cx', 'cy') else 1e-4 if '.D' in name else 2e-5
              for name in names]
    random = np.random.default_rng(5)
    axes = np.linalg.qr(np.eye(len(names)) + 0.3 * random.normal(size=2 * (len(names),)))[0]
    shape = axes @ np.diag(random.uniform(0.2, 1, len(names))) @ axes.T
    return StereoCovariance.of(calibration, shape * np.outer(spread, spread))


def health_file(path, health, calibration):
    """Write what `ros2 topic echo` prints of a Health."""
    message = health_message(health, 'x', Header(), calibration)
    path.write_text(yaml.safe_dump({'status': [{'values': [
        {'key': each.key, 'value': each.value} for each in message.status[0].values]}]}) + '---')
    return message


def knocked_health(covariance=None):
    """Return the Health of a knocked pair, and its calibration."""
    calibration = test_health.rig('barrel')
    tracker = HealthTracker(calibration, prior=None if covariance is None else drift_covariance(
        calibration, covariance))
    return tracker.follow(tracker.unknown(), test_health.alignment(
        calibration, test_health.KNOCK, noise=0.05)), calibration


@pytest.mark.processes  # the message is one of ROS
def test_the_message_holds_all_digits_and_the_suggestion(tmp_path):
    health, calibration = knocked_health()
    fixed = corrected(calibration, health.drift)
    content = health_message(health, 'calibration health', Header.at(7, 'left'), calibration,
                             fixed)
    message = message_of(content)
    assert message.status[0].level == b'\x01'
    values = {each.key: each.value for each in message.status[0].values}
    assert [float(each) for each in values['suggested right K'].split()] == [
        *fixed.right.K.ravel()]
    path = tmp_path / 'health.yaml'
    told = health_file(path, health, calibration).status[0].values
    # ros2 topic echo cuts longer text
    assert max(len(each.value) for each in told) <= 128
    known = read_drift(path, calibration)
    assert known.drift == pytest.approx(health.drift, rel=1e-12)
    assert known.covariance == pytest.approx(health.covariance, rel=1e-6, abs=1e-20)
    assert known.prior_std ** 2 == pytest.approx(np.diag(health.prior)) and known.knocked
    whole = path.read_text()
    for old, new, reason in (
            (whole, 'a: 1', 'tells no drift'), (whole, 'a: [', 'is no YAML'),
            ('yaw (degrees)', 'x', 'tells no drift'),
            ('left calibration', 'x', 'tells no drift'),
            (repr(float(health.drift[0] * SHOWN[0])), 'nan', 'no finite numbers')):
        path.write_text(whole.replace(old, new))
        with pytest.raises(CalibrationError, match=reason):
            read_drift(path, calibration)


def test_a_health_file_of_another_calibration_is_refused(tmp_path):
    health, calibration = knocked_health()
    health_file(tmp_path / 'health.yaml', health, calibration)
    foreign = corrected(calibration, 1e-6 * np.ones(6))
    with pytest.raises(CalibrationError, match='the drift belongs to another left calibration'):
        read_drift(tmp_path / 'health.yaml', foreign)


def test_the_topic_is_one_of_the_outputs():
    stereo = ColorStereo(rig(*SIZE), settings())
    result = stereo.process(*pair(True))
    node = RangeNodeSettings(health=NodeHealthSettings('suggest'))
    content = OUTPUTS['calibration_health'].content(
        result, Context.of(Header.at(7, 'left'), node, rig(*SIZE)))
    keys = [each.key for each in content.status[0].values]
    assert 'rows (px)' in keys and 'suggested right R' in keys


def test_update_writes_a_new_calibration_from_a_health_file(tmp_path, capsys):
    covariance = covariance_of(test_health.rig('barrel'))
    health, calibration = knocked_health(covariance)
    files = [tmp_path / name for name in ('left.yaml', 'right.yaml')]
    calibration.to_yaml(*files)
    covariance.write(tmp_path / 'covariance.yaml')
    health_file(tmp_path / 'health.yaml', health, calibration)
    words = ['calibrate', 'update', str(tmp_path / 'new'), '--health',
             str(tmp_path / 'health.yaml')]
    assert cli.main(words) == 2 and '--left and --right' in capsys.readouterr().err
    words += ['--left', str(files[0]), '--right', str(files[1])]
    before = [each.read_bytes() for each in files]
    assert not cli.main([*words, '--health.covariance', str(tmp_path / 'covariance.yaml')])
    assert [each.read_bytes() for each in files] == before
    written = StereoCalibration.from_yaml(tmp_path / 'new/left.yaml', tmp_path / 'new/right.yaml')
    assert written.right.R == pytest.approx(corrected(calibration, health.drift).right.R, abs=1e-9)
    assert written.geometry.baseline == pytest.approx(calibration.geometry.baseline)
    told = StereoCovariance.read(tmp_path / 'new/stereo_covariance.yaml')
    told.check(written)
    after = corrected_covariance(calibration, covariance, KnownDrift.of(health))
    assert told.matrix == pytest.approx(after.matrix, rel=1e-6, abs=1e-16)
    assert cli.main(words) == 1 and 'is there already' in capsys.readouterr().err
    words[2] = str(tmp_path / 'bare')
    assert not cli.main(words)
    assert 'no stereo_covariance.yaml is written' in capsys.readouterr().out
    assert sorted(each.name for each in (tmp_path / 'bare').iterdir()) == [
        'left.yaml', 'right.yaml']


def test_a_drift_of_another_covariance_is_refused_and_nothing_written(tmp_path, capsys):
    health, calibration = knocked_health()
    files = [tmp_path / name for name in ('left.yaml', 'right.yaml')]
    calibration.to_yaml(*files)
    covariance_of(calibration).write(tmp_path / 'covariance.yaml')
    health_file(tmp_path / 'health.yaml', health, calibration)
    assert cli.main(['calibrate', 'update', str(tmp_path / 'new'), '--health',
                     str(tmp_path / 'health.yaml'), '--left', str(files[0]), '--right',
                     str(files[1]), '--health.covariance', str(tmp_path / 'covariance.yaml')]) == 1
    assert 'another covariance' in capsys.readouterr().err
    assert not (tmp_path / 'new').exists()


@pytest.mark.parametrize('knocked', [False, True])
def test_the_covariance_after_an_update_is_what_errors_show(knocked, effort):
    calibration = test_health.rig('barrel')
    covariance = covariance_of(calibration)
    images, at = drift_by_parameters(calibration, covariance), np.zeros(6)
    moves = parameters_by_drift(calibration, at)
    assert images @ moves == pytest.approx(np.eye(6), abs=0.02)
    prior = drift_covariance(calibration, covariance)
    knock = np.diag(np.square(np.array([0.3, 0.3, 0.3, 0.1, 0.005, 0.005]) / SHOWN)) * knocked
    random = np.random.default_rng(7)
    # the rows of 50 places, .2 px each: they tell little of yaw and of the direction
    fields = expected_fields(calibration, *random.uniform(20, 400, (2, 50)),
                             random.uniform(60, 160, 50))[0] / 0.2
    information = np.zeros((6 + TERMS,) * 2)
    information[:6, :6] = fields.T @ fields
    ratios = []
    for _ in effort.seeds(200, 2000):
        error = random.multivariate_normal(np.zeros(len(covariance.names)), covariance.matrix)
        move = random.multivariate_normal(at, knock)
        seen = fields @ (images @ error + move) + random.normal(size=len(fields))
        pull = np.zeros(6 + TERMS)
        pull[:6] = fields.T @ seen
        drift, after = posterior(information, pull, prior + knock)
        known = KnownDrift(drift, after, np.sqrt(np.diag(prior)), knocked)
        told = corrected_covariance(calibration, covariance, known)
        ratios.append((error + moves @ (move - drift)) ** 2 / np.diag(told.matrix))
    assert np.mean(ratios, axis=0) == pytest.approx(1, abs=0.45)
    assert np.mean(ratios) == pytest.approx(1, abs=0.15)


def test_update_measures_a_recording(tmp_path, capsys):
    with write_recording(tmp_path / 'bag') as writer:
        for number in (1, 2, 3):
            writer.write_pair(number * 10 ** 9, *pair(True, number), rig(*SIZE))
    words = ['calibrate', 'update', str(tmp_path / 'new'), '--recording', str(tmp_path / 'bag'),
             *WORDS]
    assert not cli.main(words)
    out = capsys.readouterr().out
    assert 'the cameras have moved' in out and 'calibration changed by pitch 0.1' in out
    assert 'no stereo_covariance.yaml is written' in out
    written = StereoCalibration.from_yaml(tmp_path / 'new/left.yaml', tmp_path / 'new/right.yaml')
    turned = written.right.R.T @ rig(*SIZE).right.R
    assert turned[0, 1] == pytest.approx(-KNOCK[2], abs=3e-4)
    words[2] = str(tmp_path / 'other')
    assert cli.main([*words, '--matching.row_alignment', 'off']) == 1
    assert 'no calibration is written' in capsys.readouterr().err
    assert not (tmp_path / 'other').exists()


def test_the_covariance_of_a_calibration_becomes_that_of_the_drift(tmp_path):
    calibration = test_health.rig('plain')
    names = StereoParameters.from_calibration(calibration).names
    matrix = np.diag(np.full(len(names), 1e-18))
    for name, spread in (('right.cy', 0.1), ('translation.x', 1e-4)):
        matrix[names.index(name), names.index(name)] = spread ** 2
    covariance = StereoCovariance.of(calibration, matrix)
    std = np.sqrt(np.diag(drift_covariance(calibration, covariance)))
    assert std[0] == pytest.approx(0.1 / 640, rel=0.3)  # a principal point looks like a pitch
    assert std[1] < 1e-4
    path = tmp_path / 'stereo_covariance.yaml'
    covariance.write(path)
    read = NodeHealthSettings(covariance=str(path)).read_covariance()
    assert np.sqrt(np.diag(drift_covariance(calibration, read))) == pytest.approx(std)
    with pytest.raises(CalibrationError, match='another left calibration'):
        ColorStereo(rig(*SIZE), covariance=read)
    assert NodeHealthSettings().read_covariance() is None
    sharp = ColorStereo(calibration, covariance=read).health
    assert np.sqrt(np.diag(sharp.prior)) == pytest.approx(std)

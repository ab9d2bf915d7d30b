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
"""A ColorStereo finds the projector by itself, follows it, and never believes a wrong one."""

from color_stereo_ros.core import ColorStereo
from color_stereo_ros.core.projector import Reason, Track
from color_stereo_ros.core.projector.tuning import TUNING
from color_stereo_ros.core.rows import search as rows_search
import numpy as np
from projected import CALIBRATION, pair, truth
import pytest
from test_third_view import cover, same, settings

SURE = 0.9
FARTHER = 0.02, 0.0, 0.0   # m, beyond what patches follow
LITTLE = 0.002, 0.001, 0.0  # m


@pytest.fixture(scope='module')
def rig():
    """Return an object for the scene."""
    return ColorStereo(CALIBRATION, settings())


@pytest.fixture(scope='module')
def two():
    """Return an object that measures with two views."""
    return ColorStereo(CALIBRATION, settings(matching__third_view='off'))


@pytest.fixture(scope='module')
def known(rig):
    """Return what is known after a first pair."""
    return rig.process(*pair(), projector=Track()).projector


def wrong(result):
    """Return the share of the lit pixels of high confidence that are off by more than 1 px."""
    disparity, lit, _ = truth()
    sure = lit & (result.confidence > SURE)
    return np.mean(np.abs(result.disparity - disparity)[sure] > 1) if sure.any() else 0.0


def test_the_first_pair_is_measured_with_the_projector(rig, two):
    rig.reset()
    result = rig.process(*pair())
    assert result.projector.agreeing
    assert result.projector.sentence().startswith('projector found: 57 x 44 degrees, .06 m above')
    assert cover(result) > cover(two.process(*pair())) + 0.05
    assert np.mean(result.views == 2) > 0.02


def test_a_result_depends_on_the_pair_and_on_what_is_given_only(rig, known):
    fresh = ColorStereo(CALIBRATION, settings())
    given = {'projector': known, 'alignment': fresh.alignment}
    first = fresh.process(*pair(noise=2), **given)
    for others in ({'noise': 3, 'paint': (1.0, 0.3, 0.3)}, {'seed': 99}):
        rig.process(*pair(**others), projector=Track())
        assert same(rig.process(*pair(noise=2), **given), first)


def test_what_was_found_is_carried_on_until_it_is_forgotten(rig):
    rig.reset()
    rig.process(*pair())
    found = rig.projector
    following = rig.process(*pair(noise=2)).projector
    assert following.agreeing and following.share > 0.9 and following.shift < 0.2
    assert following.model is found.model and following.age == 1
    old = following.but(age=TUNING.track.refresh - 1)
    fresh = rig.process(*pair(noise=3), projector=old).projector
    assert fresh.model is not found.model and fresh.age == 0
    rig.process(*pair(noise=3), projector=Track())
    assert rig.projector is following
    rig.reset()
    assert rig.projector.model is None and rig.projector.due


def test_a_search_beside_the_pairs_is_adopted(two):
    rig = ColorStereo(CALIBRATION, settings(), search_at_once=False)
    first = rig.process(*pair())
    assert same(first, two.process(*pair()))
    assert first.projector.due and first.projector.sentence() == 'projector not found yet'
    rig.adopt_projector(rig.search_projector(first))
    second = rig.process(*pair(noise=2))
    assert second.projector.agreeing and (second.views & 2).any()


@pytest.mark.parametrize('changes', [
    {'matching__third_view': 'off'}, {'pattern__type': 'unknown'},
    {'pattern__type': 'sine', 'pattern__cycles': 8}, {'matching__refinements': 0},
    {'matching__method': 'paper'}])
def test_without_a_third_view_nothing_is_known_of_the_projector(changes):
    rig = ColorStereo(CALIBRATION, settings(**changes))
    assert rig.projector is None and not rig.may_use_projector
    assert rig.process(*pair()).projector is None


def test_a_projector_that_was_bumped_a_little_is_followed(rig, known):
    result = rig.process(*pair(shift=LITTLE), projector=known)
    assert result.projector.agreeing and result.projector.shift > 0.5
    assert wrong(result) < 0.002
    moved = result.projector.model.translation - known.model.translation
    np.testing.assert_allclose(moved, LITTLE, atol=0.0008)


def test_a_projector_that_was_moved_is_found_again_in_the_same_pair(rig, known):
    result = rig.process(*pair(shift=FARTHER), projector=known)
    assert result.projector.agreeing and wrong(result) < 0.002
    moved = result.projector.model.translation - known.model.translation
    np.testing.assert_allclose(moved, FARTHER, atol=0.002)


def test_without_a_search_a_moved_projector_leaves_two_views(two, known):
    rig = ColorStereo(CALIBRATION, settings(), search_at_once=False)
    result = rig.process(*pair(shift=FARTHER), projector=known)
    assert same(result, two.process(*pair(shift=FARTHER)))
    assert result.projector.due
    assert result.projector.sentence().startswith('projector lost: it was moved')


def test_a_projector_that_is_dark_for_a_pair_is_there_in_the_next(rig, known):
    dark = np.full_like(pair()[0], 3)
    result = rig.process(dark, dark + np.uint8(1), projector=known)
    assert not result.projector.agreeing and result.density < 0.01
    result = rig.process(*pair(noise=2), projector=result.projector)
    assert result.projector.agreeing and (result.views & 2).any()


@pytest.mark.parametrize('scene, reasons', [
    ({'seed': 99}, [Reason.ABSENT]), ({'what': 'menu'}, [Reason.PLAIN]),
    ({'what': 'mirrored'}, [Reason.MIRRORED, Reason.ABSENT])])
@pytest.mark.parametrize('before', [False, True])
def test_what_is_no_projector_leaves_two_views_and_a_reason(rig, two, known, scene, reasons,
                                                            before):
    result = rig.process(*pair(**scene), projector=known if before else Track())
    assert result.projector.reason in reasons and not result.projector.agreeing
    assert result.projector.sentence() == result.projector.reason.value
    assert same(result, two.process(*pair(**scene)))


def test_a_bare_wall_does_not_show_the_projector_unless_its_lens_is_known(rig, two, known):
    wall = pair(plate=False)
    result = rig.process(*wall, projector=Track())
    assert result.projector.reason is Reason.FLAT
    assert same(result, two.process(*wall))
    assert rig.process(*wall, projector=known).projector.agreeing


def test_a_search_in_vain_is_not_repeated_at_once(rig):
    track, waits = Track(), []
    for noise in range(4):
        track = rig.process(*pair(seed=99, noise=noise + 1), projector=track).projector
        waits.append((track.tries, track.wait))
    assert waits == [(1, 2), (1, 1), (1, 0), (2, 4)]


def test_the_left_camera_goes_on_alone(rig, known):
    rig.process(*pair(), projector=known)
    result = rig.process_left(pair(noise=2)[0], projector=known)
    assert cover(result) > 0.95 and set(np.unique(result.views)) == {0, 2}
    assert wrong(result) < 0.002 and result.projector.agreeing


def test_the_left_camera_alone_says_how_far_a_moved_projector_is_wrong(rig, known):
    rig.process(*pair(), projector=known)
    left = pair(noise=2, shift=(0.001, 0.0, 0.0))[0]
    result = rig.process_left(left, projector=known)
    error = np.abs(result.disparity - truth()[0])
    known_there = np.isfinite(error)
    assert np.percentile(error[known_there] / result.disparity_std[known_there], 68) < 1.4
    assert wrong(result) == 0.0


def test_the_left_camera_alone_measures_nothing_after_a_large_move(rig, known):
    rig.process(*pair(), projector=known)
    result = rig.process_left(pair(noise=2, shift=FARTHER)[0], projector=known)
    assert result.density == 0.0 and not result.views.any() and not result.confidence.any()
    assert not result.projector.agreeing


@pytest.mark.parametrize('before', [False, True])
@pytest.mark.parametrize('what', ['two', 'mirror', 'photo'])
def test_light_that_is_not_of_one_projector_is_never_silently_wrong(rig, known, what, before):
    result = rig.process(*pair(what=what), projector=known if before else Track())
    assert wrong(result) < 0.01


@pytest.mark.parametrize('move', [
    {'turn': (0.0, 0.05, 0.02)}, {'turn': (0.01, 0.0, 0.0)},
    {'shift': (0.02, -0.01, 0.01), 'turn': (0.02, 0.03, 0.0)}])
def test_a_projector_that_was_turned_is_found_again_within_two_pairs(rig, known, move):
    first = rig.process(*pair(**move), projector=known)
    second = rig.process(*pair(noise=2, **move), projector=first.projector)
    assert wrong(first) < 0.01 and wrong(second) < 0.01
    assert second.projector.agreeing and (second.views == 2).any()


def test_a_pattern_that_was_changed_for_a_pair_does_no_harm(rig, known):
    changed = rig.process(*pair(seed=99), projector=known)
    assert changed.projector.reason is Reason.ABSENT and wrong(changed) < 0.01
    again = rig.process(*pair(noise=2), projector=changed.projector)
    assert wrong(again) < 0.01
    last = rig.process(*pair(noise=3), projector=again.projector)
    assert last.projector.agreeing and wrong(last) < 0.01


def test_the_pattern_tells_the_rows_where_the_views_have_nothing_in_common(rig, monkeypatch):
    left, right = pair()
    lower = np.roll(right, 12, axis=0)
    monkeypatch.setattr(rows_search, 'matches', lambda pair: (*np.zeros((2, 0, 2)), 0))
    found = rig.search_rows(left, lower)
    assert found.coefficients[0] == pytest.approx(12, abs=0.3)

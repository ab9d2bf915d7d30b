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
"""Rows of the two views that disagree: known errors are found, corrected, told and forgotten."""

from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache

from color_stereo_ros.core import ColorStereo
from color_stereo_ros.core.account import doubts_about_result
from color_stereo_ros.core.rows.alignment import Alignment, COUNT, terms, TURNS
from color_stereo_ros.core.rows.estimate import (
    applicable, failed, resumed, robust_fit, UNSEEN, updated)
from color_stereo_ros.core.rows.search import ASTRAY, fit, search, UPSIDE_DOWN
from color_stereo_ros.core.rows.tuning import TUNING
from color_stereo_ros.core.surface.aligning import Aligner, doubt
from color_stereo_ros.core.surface.pair_model import PairModel
from color_stereo_ros.core.surface.row_kernels import CELL_STEP
from color_stereo_ros.nodes.sensor.row_search import RowSearch
import numpy as np
import pytest
from scenes import hue_pair, paper_settings, parallel_rig
from surface_pairs import exposed, photographed, rig, surface_settings

SIZE = 320, 240
LARGE = 640, 480
LIMITS = 8, 40
SMALL_ERRORS = {
    'offset': (0.4, 0, 0, 0, 0, 0, 0), 'one pixel': (-1, 0, 0, 0, 0, 0, 0),
    'two pixels': (2, 0, 0, 0, 0, 0, 0), 'roll': (0, 1.4, 0, 0, 0, 0, 0),
    'scale': (0, 0, 1.6, 0, 0, 0, 0), 'quadratic': (0.2, 0, 0, 0.3, -0.4, 0.5, 0),
    'radial': (0, 0, 0, 0, 0, 0, 0.8)}


def coefficients(*values):
    """Return so many coefficients of the row error, px; the others are 0."""
    return np.array([*values, *np.zeros(COUNT - len(values))], float)


def row_error(values, size=SIZE):
    """Return the row error at every pixel (x, y) of the right view: what shows row y, px."""
    y, x = np.mgrid[:size[1], :size[0]].astype(float)
    there = y
    for _ in range(4):  # the error is that at the row that should be there
        there = y - terms(x, there, size) @ np.array(values, float)
    return y - there


@lru_cache(maxsize=16)
def left_light(size, kind):
    """Return what the left camera sees of a slanted board."""
    return photographed(-disparity(size), kind=kind)


def disparity(size):
    """Return the disparity of the board at the pixels of the left image, px."""
    return np.add.outer(0.01 * np.arange(size[1]), 20 + 0.02 * np.arange(size[0]))


def pair(values=(), seed=1, size=SIZE, kind='hue_field'):
    """Return a pair of the board; the rows of the right view are off by the row error."""
    rng = np.random.default_rng(seed)
    zeros = np.zeros(size[::-1])
    right = photographed(zeros, kind=kind, rows=row_error(coefficients(*values), size))
    return exposed(left_light(size, kind), rng), exposed(right, rng)


def sensor(size=SIZE, **changes):
    """Return a sensor of these pairs."""
    return ColorStereo(rig(*size), surface_settings(*LIMITS, **changes))


@pytest.fixture(scope='module')
def stereo():
    """Return a sensor; tests forget what others have left."""
    return sensor()


def apart(alignment, values, size=SIZE):
    """Return the error of an alignment in the middle of the image, root mean square, px."""
    x, y = np.meshgrid(np.arange(20, size[0] - 40, 10), np.arange(10, size[1] - 10, 10))
    return float(np.sqrt(np.mean((alignment.error(x, y) - terms(x, y, size)
                                  @ coefficients(*values)) ** 2)))


def same(one, other):
    """Return whether two results have the same bytes."""
    return all(np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True)
               for name in ('disparity', 'confidence', 'disparity_std', 'status'))


# ---- in the sensor

@pytest.mark.parametrize('name', SMALL_ERRORS)
def test_known_row_errors_are_found_and_corrected(stereo, name):
    values = SMALL_ERRORS[name]
    stereo.reset()
    clean = stereo.process(*pair(seed=3))
    stereo.reset()
    first, _, third = (stereo.process(*pair(values, seed)) for seed in (1, 2, 3))
    assert third.alignment.observable and third.alignment.agreeing
    assert apart(third.alignment, values) < 0.04
    dense, dense_first, dense_third = (np.isfinite(each.disparity[6:-6]).mean()
                                       for each in (clean, first, third))
    assert dense_first > dense - 0.02 and dense_third > dense - 0.01
    right = np.abs(third.disparity - disparity(SIZE)) < 0.2
    assert right.mean() > 0.97 * (np.abs(clean.disparity - disparity(SIZE)) < 0.2).mean()


def test_the_standard_deviation_of_disparities_holds_with_corrected_rows(stereo):
    stereo.reset()
    z = []
    for seed in (1, 2, 3):
        result = stereo.process(*pair((0.3, 0.2, -0.2), seed))
        z.append(np.abs(result.disparity - disparity(SIZE)) / result.disparity_std)
    assert 0.5 < np.nanpercentile(z[-1], 68) < 1.4


def test_twenty_pixels_are_found_within_the_first_pair():
    stereo = sensor(LARGE)
    result = stereo.process(*pair((20.0, 0.8, -0.5), size=LARGE))
    assert apart(result.alignment, (20.0, 0.8, -0.5), LARGE) < 0.05
    assert result.density > 0.85
    again = stereo.process(*pair((20.0, 0.8, -0.5), 2, LARGE))
    assert apart(again.alignment, (20.0, 0.8, -0.5), LARGE) < 0.03


def test_rows_that_agree_change_no_byte(stereo):
    stereo.reset()
    results = [stereo.process(*pair(seed=seed)) for seed in (1, 2, 3)]
    plain = sensor(matching__row_alignment='off')
    for seed, result in zip((1, 2, 3), results):
        assert not result.alignment.applied.any()
        assert apart(result.alignment, ()) < 0.02
        assert same(result, plain.process(*pair(seed=seed)))


def test_measure_changes_no_disparity_and_tells_the_error():
    stereo = sensor(matching__row_alignment='measure')
    plain = sensor(matching__row_alignment='off')
    result, expected = (each.process(*pair((0.3,))) for each in (stereo, plain))
    both = np.isfinite(result.disparity) & np.isfinite(expected.disparity)
    assert both.mean() > 0.8
    np.testing.assert_array_equal(result.disparity[both], expected.disparity[both])
    assert not result.alignment.applied.any() and apart(result.alignment, (0.3,)) < 0.1
    assert (result.disparity_std[both] > expected.disparity_std[both]).mean() > 0.99
    assert expected.alignment is None


def test_the_papers_method_sees_the_pair_as_it_is():
    stereo = ColorStereo(parallel_rig(), paper_settings(range__min_depth=0.7,
                                                        range__max_depth=4.0))
    assert stereo.process(*hue_pair(5.0)).alignment is None


def test_a_sweep_shows_no_rows_and_they_are_left():
    stereo = sensor(pattern__type='sweep')
    result = stereo.process(*pair((1.0,), kind='sweep'))
    assert not result.alignment.observable and not result.alignment.known
    assert not result.alignment.applied.any()


def test_structure_that_was_evened_away_still_asks_for_matches():
    stereo = sensor(pattern__type='sweep')
    stereo.process(*pair(kind='sweep'))
    method = stereo._method
    rows, views, planes = method.rows, method.views, method.planes
    known = PairModel.neutral(views), Alignment.unknown(SIZE)
    assert rows.measure(views, planes, *known).agreeing
    rows.before = 400  # cells that had structure before the views were made alike
    found = rows.measure(views, planes, *known)
    assert not found.agreeing and not found.observable and found.misfit == np.inf


def test_print_shows_the_rows_that_a_sweep_does_not():
    rng, images = np.random.default_rng(1), []
    for shift, rows in ((-disparity(SIZE), 0.0),
                        (np.zeros(SIZE[::-1]), row_error(coefficients(0.8)))):
        ink = photographed(shift, kind='hue_field', rows=rows)[..., :1]
        light = photographed(shift, kind='sweep', rows=rows) * (0.2 + 0.8 * ink)
        images.append(exposed(light, rng))
    result = sensor(pattern__type='sweep').process(*images)
    assert result.alignment.observable and apart(result.alignment, (0.8,)) < 0.06
    assert (np.abs(result.disparity - disparity(SIZE)) < 0.5).mean() > 0.8


def test_a_bump_is_recovered_by_the_next_pair(stereo):
    stereo.reset()
    before = [stereo.process(*pair(seed=seed)) for seed in (1, 2, 3)]
    after = [stereo.process(*pair((1.2, 0.3), seed)) for seed in (4, 5)]
    assert apart(after[-1].alignment, (1.2, 0.3)) < 0.03
    assert after[-1].density > before[-1].density - 0.01
    back = stereo.process(*pair(seed=6))
    assert not back.alignment.applied.any()


# ---- an explicit value

def test_a_pair_with_a_given_alignment_depends_on_nothing_else(stereo):
    stereo.reset()
    given = stereo.process(*pair((0.5,))).alignment
    first = stereo.process(*pair((0.5,), 2), given)
    stereo.process(*pair((-1.0, 0.5), 3))
    stereo.process(*pair(seed=4))
    second = stereo.process(*pair((0.5,), 2), given)
    assert same(first, second)
    np.testing.assert_array_equal(first.alignment.coefficients, second.alignment.coefficients)


def test_a_given_alignment_is_not_carried_on(stereo):
    stereo.reset()
    given = stereo.process(*pair((0.5,))).alignment
    stereo.reset()
    carried = stereo.process(*pair(seed=2)).alignment
    stereo.process(*pair((0.5,), 3), given)
    assert stereo.alignment is carried


def test_reset_forgets_the_rows(stereo):
    stereo.reset()
    first = stereo.process(*pair((0.5,)))
    stereo.process(*pair((0.5,), 2))
    stereo.reset()
    assert not stereo.alignment.known
    assert same(stereo.process(*pair((0.5,))), first)


def test_a_new_sensor_knows_nothing_of_the_rows():
    assert not sensor().alignment.known


def test_alignments_cannot_be_written(stereo):
    stereo.reset()
    found = stereo.process(*pair((0.5,))).alignment
    for values in (found.coefficients, found.covariance, found.applied, found.evidence.dy):
        with pytest.raises(ValueError, match='read-only'):
            values[...] = 0


def test_evidence_says_where_the_rows_were_compared(stereo):
    stereo.reset()
    evidence = stereo.process(*pair((0.5,))).alignment.evidence
    assert len(evidence.x) > 30 and len({len(each) for each in vars(evidence).values()}) == 1
    assert np.average(evidence.dy, weights=evidence.sigma ** -2.0) == pytest.approx(0.5, abs=0.03)
    assert abs(np.median(evidence.disparity) - np.median(disparity(SIZE))) < 2
    assert evidence.y.min() < 40 and evidence.y.max() > 200


def test_threads_with_alignments_of_their_own_do_not_disturb_each_other(stereo):
    stereo.reset()
    given = [stereo.process(*pair(values)).alignment for values in ((0.5,), (-0.5,))]
    pairs = [pair((0.5,), 2), pair((-0.5,), 2)]
    alone = [stereo.process(*images, each) for images, each in zip(pairs, given)]
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(
            lambda index: stereo.process(*pairs[index % 2], given[index % 2]), range(8)))
    assert all(same(result, alone[index % 2]) for index, result in enumerate(together))


# ---- pairs that do not belong together

def test_two_scenes_are_told_and_nothing_is_carried_on():
    stereo = sensor(LARGE)
    good = pair(size=LARGE)
    other = photographed(np.zeros(LARGE[::-1]), kind='hue_field', feature_size=11.0)
    bad = good[0], exposed(other, np.random.default_rng(5))
    clean = stereo.process(*good)
    result = stereo.process(*bad)
    assert not result.alignment.agreeing and result.alignment.sentence() == ASTRAY
    assert ASTRAY in doubts_about_result(stereo, *bad, result)
    assert (result.confidence > 0.9).mean() < 0.01
    assert same(stereo.process(*good), clean)


@pytest.mark.parametrize('alignment', ['off', 'correct'])
def test_one_image_twice_is_no_measurement(alignment):
    left, _ = pair()
    result = sensor(matching__row_alignment=alignment,
                    matching__min_confidence=0.01).process(left, left.copy())
    assert np.isfinite(result.disparity).any()
    assert np.nanmax(result.confidence) <= 0.5


def test_a_search_in_vain_is_not_repeated_at_once():
    stereo = sensor(LARGE)
    good = pair(size=LARGE)
    other = photographed(np.zeros(LARGE[::-1]), kind='hue_field', feature_size=11.0)
    bad = good[0], exposed(other, np.random.default_rng(5))
    tries = [stereo.process(*bad).alignment.tries for _ in range(4)]
    assert tries == [1, 1, 1, 2]
    assert stereo.process(*good).alignment.tries == 0


def test_the_search_says_upside_down_and_too_far():
    stereo = sensor(LARGE)
    left, right = pair(size=LARGE)
    turned = search(stereo.rectify(left, np.ascontiguousarray(right[::-1, ::-1])), LIMITS)
    assert turned == (None, UPSIDE_DOWN)
    far = np.zeros_like(right)
    far[100:] = right[:-100]
    found, sentence = search(stereo.rectify(left, far), LIMITS)
    assert found is None and sentence.startswith('rows differ by 100 px, more than the 32 px')


def gray(image):
    """Return an image, uint8 (H, W, 3), with its red channel in all channels."""
    return np.repeat(image[..., :1], 3, axis=2)


@pytest.mark.parametrize('gray_sides', [(True, True), (False, True)])
def test_the_search_finds_the_rows_of_gray_images(gray_sides):
    stereo = sensor(LARGE)
    images = [gray(image) for image in pair((5.0, 0.8), size=LARGE)]
    tinted = [image if colorless else (image * [1.0, 0.8, 0.5]).astype(np.uint8)
              for image, colorless in zip(images, gray_sides)]
    found, sentence = search(stereo.rectify(*tinted), LIMITS)
    assert sentence == '' and apart(found, (5.0, 0.8), LARGE) < 0.05


def test_gray_images_are_told_apart_like_colors():
    stereo = sensor(LARGE)
    left, right = (gray(image) for image in pair(size=LARGE))
    turned = search(stereo.rectify(left, np.ascontiguousarray(right[::-1, ::-1])), LIMITS)
    assert turned == (None, UPSIDE_DOWN)


def test_a_black_view_is_told():
    stereo = sensor()
    left, right = pair()
    result = stereo.process(left, np.zeros_like(right))
    assert result.alignment.sentence() == ASTRAY and not np.isfinite(result.disparity).any()


@pytest.mark.parametrize('scatter, misfit, searched, expected', [
    (0.25, 12.0, ASTRAY, 6), (np.nan, np.inf, ASTRAY, 6), (0.16, 13.0, ASTRAY, 6),
    (0.25, 3.1, ASTRAY, 0), (np.nan, np.inf, '', 0), (0.25, 10.0, '', 2)])
def test_pairs_that_a_search_refuses_lose_most(scatter, misfit, searched, expected):
    alignment = Alignment.unknown(SIZE).but(scatter=scatter, misfit=misfit, searched=searched)
    assert doubt(alignment) == expected
    assert doubt(alignment.but(agreeing=True)) == 0


def test_the_search_in_images_without_features_finds_nothing():
    stereo = sensor()
    gray = np.full((*SIZE[::-1], 3), 90, np.uint8)
    assert search(stereo.rectify(gray, gray), LIMITS) == (None, '')


def test_matches_that_are_wrong_do_not_bend_the_fit():
    rng = np.random.default_rng(7)
    left = rng.uniform(0, 1, (400, 2)) * LARGE
    right = left - [20, 0]
    right[:, 1] += terms(right[:, 0], left[:, 1], LARGE) @ coefficients(12, 1.5, -0.8, 0.3)
    right += rng.normal(0, 0.3, right.shape)
    right[:120] = rng.uniform(0, 1, (120, 2)) * LARGE
    found, agree = fit(left, right, LARGE)
    assert apart(found, (12, 1.5, -0.8, 0.3), LARGE) < 0.1
    assert agree[120:].mean() > 0.98 and agree[:120].mean() < 0.1


def test_a_search_confirms_what_poor_matches_show():
    aligner = Aligner(SIZE, True)
    poor = updated(Alignment.unknown(SIZE), *cells((0.5, 0.2), scatter=0.1)).but(misfit=8.0)

    def measured(prior):
        return poor.but(applied=prior.applied, agreeing=False)

    same_rows, other_rows = (
        updated(Alignment.unknown(SIZE), *cells(values)) for values in ((0.55, 0.2), (3.0,)))
    confirmed = aligner.align(None, measured, lambda: (same_rows, ''))
    assert confirmed.agreeing and apart(confirmed, (0.5, 0.2)) < 0.05
    assert not aligner.align(None, measured, lambda: (other_rows, '')).known
    assert not aligner.align(None, measured, lambda: (None, ASTRAY)).known


def test_every_cell_is_asked_once_in_some_pairs():
    assert TURNS == CELL_STEP
    asked, aligner, known = [], Aligner(SIZE, True, turning=True), None
    shown = updated(Alignment.unknown(SIZE), *cells((0.0,))).but(agreeing=True)

    def measured(prior):
        asked.append(prior.turn)
        return shown.but(applied=prior.applied)

    for _ in range(TURNS + 1):
        known = aligner.align(known, measured, None)
        assert known.turn == asked[-1]
    assert asked == [*range(TURNS), 0]


@pytest.mark.parametrize('agreeing', [True, False])
def test_what_a_search_finds_is_kept_where_the_views_then_agree(agreeing):
    start = updated(Alignment.unknown(SIZE), *cells((2.4,)))
    poor = updated(Alignment.unknown(SIZE), *cells((0.1,), scatter=0.3)).but(misfit=8.6)

    def measured(prior):
        if prior.applied.any():
            return start.but(applied=prior.applied, agreeing=agreeing, misfit=7.1)
        return poor.but(applied=prior.applied, agreeing=False)

    found = Aligner(SIZE, True).align(None, measured, lambda: (start, ''))
    assert found.agreeing == agreeing and found.known == agreeing


# ---- the estimate

def cells(values, count=200, scatter=0.05, size=SIZE, seed=1):
    """Return places, row errors, information and disparities of cells."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0, 1, (2, count)) * np.array(size)[:, None]
    dy = terms(x, y, size) @ coefficients(*values) + rng.normal(0, scatter, count)
    return x, y, dy, np.full(count, scatter ** -2), np.full(count, 30.0)


def test_the_robust_fit_solves_the_normal_equations_of_its_weights():
    x, y, dy, information, _ = cells((0.4, -0.7, 0.2, 0.1))
    dy[::7] += 3
    there = terms(x, y, SIZE)
    found, weight = robust_fit(there, dy, information, np.zeros(COUNT))
    center = np.zeros(COUNT)
    center[0] = np.sort(dy)[len(dy) // 2]
    deviation = 1 / np.sqrt(information) + TUNING.estimate.least_scatter
    for _ in range(TUNING.estimate.iterations):
        apart = [abs(each - row @ center) / deviation[0] for each, row in zip(dy, there)]
        scatter = sorted(apart)[len(dy) // 2] / TUNING.estimate.half
        expected = np.array([1 / ((scatter * deviation[0]) ** 2 * (
            1 + (each / (TUNING.estimate.outlier * scatter)) ** 2)) for each in apart])
        last, center = center, np.linalg.solve(
            there.T @ (expected[:, None] * there) + UNSEEN, there.T @ (expected * dy))
        if np.abs(center - last).max() < TUNING.estimate.converged:
            break
    np.testing.assert_allclose(found, center, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(weight, expected, rtol=1e-9)


def test_the_estimate_is_as_good_as_it_says():
    z = []
    for seed in range(40):
        found = updated(Alignment.unknown(SIZE), *cells((0.3, -0.2, 0.5), seed=seed))
        z.append((found.coefficients - coefficients(0.3, -0.2, 0.5)) / found.std)
    assert 0.6 < np.sqrt(np.mean(np.square(z))) < 1.2


def test_higher_terms_stay_near_zero_where_the_evidence_does_not_carry_them():
    x, y, dy, information, d = cells((0.3,), count=60, scatter=0.2)
    x, y = 100 + x / 10, 100 + y / 10  # a small object
    found = updated(Alignment.unknown(SIZE), x, y, dy, information, d)
    assert np.abs(found.coefficients[3:]).max() < 0.3
    assert found.error(110, 110) == pytest.approx(0.3, abs=0.15)


def test_outliers_hardly_count():
    x, y, dy, information, d = cells((0.3,))
    dy[::5] += 3
    found = updated(Alignment.unknown(SIZE), x, y, dy, information, d)
    assert apart(found, (0.3,)) < 0.03


def test_pairs_add_up_and_the_spread_stays_that_of_a_drift():
    alignment, spread = Alignment.unknown(SIZE), []
    for seed in range(8):
        alignment = updated(alignment, *cells((0.3,), seed=seed))
        spread.append(alignment.std[0])
    assert spread[1] < spread[0] and spread[-1] == pytest.approx(spread[-2], rel=0.05)
    assert apart(alignment, (0.3,)) < 0.02


def test_too_few_cells_say_nothing():
    prior = updated(Alignment.unknown(SIZE), *cells((0.3,)))
    found = updated(prior, *cells((2.0,), count=TUNING.estimate.least_cells - 1))
    assert not found.observable and found.known
    np.testing.assert_array_equal(found.coefficients, prior.coefficients)
    assert found.std[0] > prior.std[0]


def test_what_may_be_chance_is_not_applied():
    small = updated(Alignment.unknown(SIZE), *cells((0.01,)))
    assert not applicable(small).any()
    large = updated(Alignment.unknown(SIZE), *cells((0.1,)))
    np.testing.assert_array_equal(applicable(large), large.coefficients)
    noisy = updated(Alignment.unknown(SIZE), *cells((0.1,), count=30, scatter=1.0))
    assert not applicable(noisy).any()


def test_a_tiny_change_keeps_what_is_applied():
    found = updated(Alignment.unknown(SIZE), *cells((0.3,)))
    applied = found.coefficients + coefficients(0.002)
    np.testing.assert_array_equal(applicable(found.but(applied=applied)), applied)


@pytest.mark.parametrize('values, sentence', [
    ((0.7,), 'rows differ by 0.7 px'), ((0, 0.4, 0.6), '(bottom right)'), ((0.1,), '')])
def test_people_are_told_of_large_errors_and_where_they_are(values, sentence):
    told = updated(Alignment.unknown(SIZE), *cells(values)).sentence()
    assert sentence in told and bool(told) == bool(sentence)
    assert not told or told.endswith('calibration or mounting has changed')


# ---- the search beside the pairs

class Stereo:
    """What a search beside the pairs needs of a sensor."""

    def __init__(self, alignment):
        self.alignment, self.found = alignment, alignment.but(tries=5)

    def search_rows(self, left, right):
        """Return what a search finds."""
        return self.found

    def adopt(self, alignment):
        """Take an alignment."""
        self.alignment = alignment


class Result:
    """A result of which only the alignment is known."""

    def __init__(self, alignment):
        self.alignment = alignment


@pytest.mark.parametrize('changes, searched', [
    ({}, True), ({'agreeing': True}, False), ({'wait': 1}, False)])
def test_the_node_searches_where_the_views_do_not_agree(changes, searched):
    stereo = Stereo(Alignment.unknown(SIZE).but(**changes))
    rows, image = RowSearch(), np.zeros((2, 2, 3), np.uint8)
    rows.look(stereo, image, image, Result(stereo.alignment))
    for _ in range(100):
        if not rows.busy:
            break
        rows._thread.join(0.1)
    assert (stereo.alignment is stereo.found) == searched


def test_the_node_does_not_search_again_for_a_pair_that_came_before_the_find():
    stereo = Stereo(Alignment.unknown(SIZE).but(agreeing=True))
    rows, image = RowSearch(), np.zeros((2, 2, 3), np.uint8)
    rows.look(stereo, image, image, Result(Alignment.unknown(SIZE)))
    assert not rows.busy and stereo.alignment is not stereo.found


def test_a_sensor_that_leaves_the_search_to_others_takes_what_they_find():
    stereo = ColorStereo(rig(*LARGE), surface_settings(*LIMITS), search_at_once=False)
    images = [pair((12.0,), seed, LARGE) for seed in (1, 2)]
    first = stereo.process(*images[0])
    assert first.alignment.due and first.density < 0.1
    stereo.adopt(stereo.search_rows(*images[0]))
    second = stereo.process(*images[1])
    assert second.density > 0.85 and apart(second.alignment, (12.0,), LARGE) < 0.04


def test_what_a_search_finds_again_does_not_count_as_news():
    current = Alignment.unknown(SIZE)
    assert resumed(current, current, '').tries == 1
    found = resumed(current, current.but(coefficients=coefficients(3.0)), '')
    assert found.coefficients[0] == 3.0 and not found.due
    waits = [current.wait]
    for _ in range(10):
        current = failed(current, 'nothing')
        waits.append(current.wait)
    assert waits[:4] == [0, 2, 4, 8] and max(waits) == TUNING.search.largest_wait

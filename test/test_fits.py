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
"""The fits recover what made their data, and say how they differ from what ships."""

from dataclasses import replace
from pathlib import Path
import subprocess
import sys

from color_stereo_ros.core import PatternSettings, Settings
from color_stereo_ros.core.surface.fitted import FittedModel, load_model, MODELS
from color_stereo_ros.core.surface.tuning import TUNING
from color_stereo_ros.evaluation.fits import arguments, nodes, period, records, run, slow
from color_stereo_ros.evaluation.fits import quality, spread, steps, temper, trust
from color_stereo_ros.evaluation.fits.pairs import Pair
import numpy as np
import projected
import pytest
from surface_pairs import rig, step_pair, surface_settings


def some_nodes(rng, count=20000, **values):
    """Return nodes with evidence as it occurs, of which nothing is right."""
    blank = {'evidence': rng.uniform(0, [4, 4, 0.8, 1, 0.6], (count, 5)),
             'hidden': rng.random(count) < 0.1, 'log_odds': rng.normal(1, 3, count),
             'variance': np.full(count, 0.01), 'clear_share': rng.random(count),
             'error': np.full(count, 9.0), 'visible': np.ones(count, bool),
             'alone': np.zeros(count, bool), 'visible_count': count, 'least_odds': 0.4}
    return nodes.Nodes(**{**blank, **values})


def drawn(rng, odds):
    """Return whether nodes are right, at random with these log-odds."""
    return rng.random(len(odds)) < 1 / (1 + np.exp(-odds))


def test_the_trust_fit_recovers_a_planted_form():
    rng = np.random.default_rng(1)
    form, hidden_odds = np.array(TUNING.trust.form), -2.0
    pairs = []
    for _ in range(3):
        found = some_nodes(rng)
        x = np.concatenate([np.ones((len(found.hidden), 1)), found.evidence], axis=1)
        odds = np.einsum('ni,ij,nj->n', x, form, x) + hidden_odds * found.hidden
        pairs.append(replace(found, error=np.where(drawn(rng, odds), 0.1, 5.0)))
    weights = trust.fitted_weights(pairs)
    planted = trust.inputs_of(pairs[0]) @ np.append(form[np.triu_indices(6)], hidden_odds)
    recovered = trust.inputs_of(pairs[0]) @ weights
    doubtful = np.abs(planted) < 3
    assert np.abs(recovered - planted)[doubtful].mean() < 0.2
    assert weights[-1] == pytest.approx(hidden_odds, abs=0.25)
    assert (np.tril(trust.quadratic_form(weights[:-1]), -1) == 0).all()


def test_pairs_count_alike_however_many_nodes_they_have():
    rng = np.random.default_rng(2)
    few, many = (some_nodes(rng, count, evidence=np.zeros((count, 5)),
                            hidden=np.zeros(count, bool),
                            error=np.where(rng.random(count) < share, 0, 5))
                 for count, share in ((1000, 0.9), (30000, 0.5)))
    odds = trust.fitted_weights([few, many])[0]
    assert 1 / (1 + np.exp(-odds)) == pytest.approx(0.7, abs=0.02)


def test_the_slow_fit_recovers_a_planted_offset():
    rng = np.random.default_rng(3)
    found = some_nodes(rng)
    right = drawn(rng, found.log_odds - 1.5)
    pairs = [replace(found, error=np.where(right, 0.2, 4))]
    assert slow.fitted_offset(pairs) == pytest.approx(-1.5, abs=0.1)
    confidence, share = slow.calibration(pairs, slow.fitted_offset(pairs))
    assert confidence == pytest.approx(share, abs=0.01)


@pytest.mark.parametrize('wrong', [0.0, 0.02])
def test_the_spread_fit_recovers_planted_factors_despite_wrong_planes(wrong):
    rng = np.random.default_rng(4)
    variance, apart = rng.uniform(1e-4, 4e-3, 50000), rng.exponential(0.05, 50000)
    std = np.sqrt(1.7 * variance + (0.6 * apart) ** 2)
    error = np.where(rng.random(50000) < wrong, 0.9, std * rng.standard_normal(50000))
    variance_factor, std_per_distance = spread.fitted_spread([(error, variance, apart)])
    assert variance_factor == pytest.approx(1.7, rel=0.06)
    assert std_per_distance == pytest.approx(0.6, rel=0.06)


def test_the_period_fit_recovers_planted_odds():
    rng = np.random.default_rng(5)
    planted = np.array([-1.0, -0.5, 0.5, 1.0, 2.0, 3.0, 4.0])
    clear = rng.random(60000)
    odds = np.interp(clear, period.SHARES, planted)
    found = period.fitted_odds([(clear, drawn(rng, odds)), (clear, drawn(rng, odds))])
    np.testing.assert_allclose(found, planted, atol=0.3)


def test_where_no_node_has_been_the_period_odds_stay_finite():
    odds = period.fitted_odds([(np.full(1000, 1.0), np.ones(1000, bool))])
    assert np.isfinite(odds).all() and odds[-1] > 5 and abs(odds[0]) < 0.1


def step(pattern=PatternSettings()):
    """Return a pair of a near strip before a far plane, as the fits take it."""
    left, right, truth, hidden = step_pair(256, 160, 44, 16, 120, 190)
    settings = replace(surface_settings(2, 60), pattern=pattern)
    return Pair('step', rig(256, 160), settings, left, right, truth, ~hidden, hidden)


def test_nodes_of_a_pair_are_judged_by_the_truth():
    pair = step()
    found = nodes.gathered(pair, nodes.pattern_tuning(pair))
    assert found.evidence.shape == (len(found.error), 5)
    assert found.right.mean() > 0.8 and found.alone.sum() > 50
    assert not (found.right & found.alone).any()
    assert (found.clear_share == 1).all()
    assert found.log_odds[found.right].mean() > found.log_odds[~found.right].mean()


def test_nodes_obey_the_tuning_they_are_measured_with():
    pair = step()
    weights = np.zeros(22)
    weights[0], weights[-1] = 2.0, -7.0
    found = nodes.gathered(pair, trust.tuning_with(pair, weights))
    tried = set(np.unique(np.round(found.log_odds, 3)))
    assert 2.0 in tried and -5.0 in tried


def test_no_doubt_hides_the_ranges_that_tell_of_periods():
    pair = step(PatternSettings(type='sine', cycles=8))
    found = nodes.gathered(pair, period.without_doubt(pair))
    doubted = nodes.gathered(pair, nodes.pattern_tuning(pair))
    assert found.clear_share.min() < 1
    assert (found.log_odds >= doubted.log_odds).all()
    assert (found.log_odds > doubted.log_odds).any()


def test_the_smallest_loss_that_suffices_in_every_case_is_taken():
    most = steps.MOST_WRONG
    falling = np.interp(steps.LOSSES, (0, 2), (2 * most, 0.5 * most))
    quick = np.interp(steps.LOSSES, (0, 1), (2 * most, 0))
    assert steps.LOSSES[steps.smallest([falling, quick])] == 1.5
    assert steps.LOSSES[steps.smallest([falling + most])] == steps.LOSSES[-1]


def test_scenes_without_steps_do_not_hide_the_harder_half():
    wrong = np.array([[0.00, 0.0], [0.03, 0.02], [0.00, 0.00], [0.01, 0.00]])
    np.testing.assert_allclose(steps.harder_half(wrong), (0.02, 0.01))


def test_the_temper_fit_recovers_planted_weights():
    rng = np.random.default_rng(7)
    planted, samples = np.array([-0.3, 0.5, -1.0]), []
    for _ in range(3):
        inputs = np.stack([np.ones(20000), rng.uniform(0, 8, 20000),
                           rng.uniform(-4, 0, 20000)], axis=1)
        samples.append((inputs, drawn(rng, inputs @ planted)))
    np.testing.assert_allclose(temper.fitted_weights(samples), planted, atol=0.15)


def test_the_quality_fit_recovers_a_planted_factor():
    rng = np.random.default_rng(8)
    count = 20000
    known = np.stack([np.zeros(count), rng.uniform(1e-4, 1e-2, count), np.zeros(count),
                      rng.uniform(0.3, 3, count), np.exp(rng.uniform(-3, 0, count))], axis=1)
    known[:, 0] = rng.standard_normal(count) * quality.deviation(known, 4.0, 0.5)
    gain, power = quality.fitted_factor([known, known])
    assert gain == pytest.approx(4.0, rel=0.15) and power == pytest.approx(0.5, abs=0.1)


def options(**values):
    """Return options without progress bar, one round."""
    return run.Options(quick=True, progress=list, **values)


def projected_pair():
    """Return a Pair that a projector beside the cameras lights."""
    disparity, lit, visible = projected.truth()
    depths = projected.CALIBRATION.geometry.focal_baseline / np.array(projected.LIMITS)
    settings = Settings(pattern=projected.PATTERN).updated(
        {'range.min_depth': float(depths[1]), 'range.max_depth': float(depths[0])})
    return Pair('projected', projected.CALIBRATION, settings, *projected.pair(), disparity,
                visible, lit & ~visible, projected.projector())


@pytest.mark.parametrize('name', list(run.FITS))
def test_every_fit_gives_the_parameters_of_its_model(name):
    cyclic = {'slow': PatternSettings(type='sine'),
              'period': PatternSettings(type='sine', cycles=8)}
    lit = name in ('third', 'doubts', 'certainty')
    pair = projected_pair() if lit else step(cyclic.get(name, PatternSettings()))
    fitted, report, *_ = run.FITS[name].fit([pair], options())
    assert set(fitted) == set(load_model(name).fitted)
    assert all(isinstance(line, str) for line in report)
    if name in ('trust', 'spread', 'slow', 'third'):
        shipped = load_model(name)
        assert all(np.shape(value) == np.shape(shipped[key]) for key, value in fitted.items())


def test_the_help_names_every_fit():
    assert list(arguments.MODELS) == list(run.FITS)
    assert {path.stem for path in MODELS.glob('*.yaml')} == set(run.FITS)


# ---- files

@pytest.mark.processes  # git says the revision
def test_a_written_model_is_read_back_and_keeps_what_was_set_by_hand(tmp_path):
    fitted = {'form': np.eye(6).tolist(), 'hidden_odds': -1.5}
    model = records.record('trust', fitted, 'the command', ['solids'])
    records.write_model(tmp_path / 'trust.yaml', model)
    read = load_model(tmp_path / 'trust.yaml')
    assert read == model
    assert read.fitted['hidden_odds'] == -1.5 and read['hidden_odds'] == -4.0
    assert read.versions['numpy'] == np.__version__ and read.revision


def test_a_fit_says_how_it_differs_from_what_ships():
    shipped = load_model('trust')
    model = replace(shipped, fitted={**shipped.fitted, 'hidden_odds': -1.234})
    text = '\n'.join(records.comparison(model))
    assert 'fitted  -1.234' in text and 'ships   -4.0' in text
    assert 'set by hand: No other change' in text
    assert text.endswith('The fit differs from what ships: hidden_odds.')
    ships = load_model('slow')['odds_offset']
    same = FittedModel('slow', 'c', 'r', {}, [], {'odds_offset': ships - 0.004})
    assert records.comparison(same)[-1] == 'The fit is what ships.'


def test_the_command_that_is_recorded_repeats_the_fit():
    class Args:
        scenes, quick, seed = ['solids'], True, 3
    assert run.command_of('spread', Args) == (
        'python -m color_stereo_ros.evaluation.fits spread solids --quick --seed 3')


@pytest.mark.processes  # git says the revision
def test_a_fit_runs_from_scenes_to_a_file(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(trust, 'pairs_of', lambda scenes, options: [step() for _ in scenes])
    monkeypatch.setattr(run, 'progress_bar', list)

    class Args:
        scenes, quick, seed, cache = ['step'], True, 1, None
        output = tmp_path / 'trust.yaml'
    run.run('trust', Args)
    assert 'The fit differs from what ships' in capsys.readouterr().out
    assert load_model(tmp_path / 'trust.yaml').scenes == ['step']


def test_the_module_lists_the_fits_without_compiling():
    code = ('import sys; from color_stereo_ros.evaluation.fits.__main__ import main\n'
            'try: main(["--help"])\n'
            'except SystemExit: assert "numba" not in sys.modules')
    ran = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True,
                         cwd=Path(__file__).parents[1])
    assert all(name in ran.stdout for name in run.FITS)

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
"""Every constant says what it is and where it comes from; no number hides in the sources."""

import ast
from dataclasses import dataclass, fields
from pathlib import Path
import re

from color_stereo_ros.core import (
    account, ColorSettings, ColorStereoError, PatternSettings, Settings)
from color_stereo_ros.core.constants import (
    chosen, constant, Constants, derived, KINDS, listed, replaced)
from color_stereo_ros.core.health import tuning as health
from color_stereo_ros.core.paper import tuning as paper
from color_stereo_ros.core.patterns.expectation import Expectation
from color_stereo_ros.core.projector import tuning as projector
from color_stereo_ros.core.rows import tuning as rows
from color_stereo_ros.core.surface import fitted, tuning as surface
from color_stereo_ros.core.surface.grid_kernels import PAD, PHASE_VARIANCE
from color_stereo_ros.core.surface.method import SurfaceMethod
from color_stereo_ros.core.surface.third import tuning as third
from color_stereo_ros.core.surface.tuning import slow, TUNING, tuning_for
from color_stereo_ros.core.surface.warm_up import some_calibration
import numpy as np
import pytest
import yaml

CORE = Path(surface.__file__).parents[1]
ENTRIES = [*listed(TUNING), *listed(paper.TUNING, 'paper.'),
           *listed(rows.TUNING, 'rows.'), *listed(projector.TUNING, 'projector.'),
           *listed(health.TUNING, 'health.'), *listed(account.TUNING, 'account.'),
           *listed(third.TUNING, 'third.')]
# Halves and quarters of pixels, means of two and three, signs: formulas have such numbers.
SIMPLE = {0.0, 0.25, 0.5, 0.75, 1.0, 2.0, 3.0}
# Functions that hold other numbers, which nobody may tune.
FORMULAS = {
    'reduce_colors',      # 16 levels of trust, which `cost_line` shifts away
    'foreshortening',     # 1 / 8 from its derivation
    'best_shifted_mean',  # a mean of nine
    'weigh_evidence',     # a mean of nine
    'linearize',          # cubic Lagrange interpolation
    'row_cells',          # the same, and a derivative from five rows
    'linearize_brightness',  # the same as `linearize`
    'logistic',           # the series of the exponential function, and its range
    'logarithm',          # the series of artanh, of an eighth root
    'join_nodes',         # bits of a link
    'independent_pixels',  # 4 pi sigma^2, the area of a Gaussian correlation
    'some_calibration',   # any small rig
}
# Module globals that are made of numbers and are no tuning.
GLOBALS = {
    'LARGEST',            # of int16
    'PATCH_ROWS', 'PATCH_COLUMNS', 'stack_sums',  # sizes that follow from the tuning
    'SIZE',               # of any small rig
    'ROOT3', 'ROOT12',    # from the definition of chromaticity
    'SIDE', 'VALUES',     # sizes of a patch
    'MOST_EVIDENCE',      # room for the kinds of evidence
    'LENS', 'FREEDOMS',   # places of unknowns
    'RING', 'TENT',       # shapes of the neighbors that demosaicing mixes
    'GAUGES', 'REACH', 'LINEAR', 'QUADRATIC',  # from the model of unequal views
    'ESTIMATE',           # a word of the settings
    'wait', 'tries', 'turn', 'matches', 'with_depth',  # counts that begin at 0
    'color_map',          # the shape of an array
    'SUBPIXEL_CODES',     # names of modes
    'NEIGHBORS',          # the four of them
    'WARM',               # the size of a pattern that nobody sees
    '(RIGHT_CAMERA, PROJECTOR)',  # bits of `views`
    '(NOTHING, AGREE, FIRM, APART)', '(OWN, SEED, NEIGHBOR)',  # codes of nodes
    'PATHS',              # what is needed of a coarse node
    'age',                # a count that begins at 0
    'PERCENT', 'MILLIMETERS',  # units for people
    'SHOWN', 'pairs', 'rows', 'disparity', 'depth',  # the same, and what begins at 0
    'DIRECTIONS', 'PLACES',  # of neighbors on the grid of pixels
}
SOURCES = [path for room in ('surface', 'surface/third', 'paper', 'rows', 'projector', 'health')
           for path in sorted((CORE / room).glob('*.py'))
           if path.name not in ('tuning.py', 'fitted.py')] + [CORE / 'account.py']


@pytest.mark.parametrize('entry', ENTRIES, ids=lambda entry: entry.name)
def test_every_constant_has_unit_reason_and_provenance(entry):
    assert entry.unit
    assert entry.reason.endswith('.') and entry.reason[0].isupper()
    assert entry.provenance.kind in KINDS
    assert entry.provenance.text.endswith(('.', ')'))
    assert (entry.provenance.kind in ('fitted', 'recorded')) == bool(entry.provenance.command)
    assert 'found is not recorded' not in entry.provenance.text


def test_every_change_for_a_pattern_has_a_provenance():
    known = {entry.name: entry.value for entry in listed(TUNING)}
    for changes in (surface.PERIODIC, slow(4)):
        for name, change in changes.items():
            assert change.value != known[name] or name == 'coarse.smoothness', name
            assert change.provenance.kind in KINDS and change.provenance.text, name


def numbers_of(tree):
    """Yield (function or '', value) of every float literal, and of integers made float32."""
    def walk(node, function):
        if isinstance(node, ast.FunctionDef):
            function = node.name
        if isinstance(node, ast.ClassDef) and node.name.endswith('Tuning'):
            return
        if isinstance(node, ast.Constant) and isinstance(node.value, float):
            yield function, node.value
        if (isinstance(node, ast.Call) and ast.unparse(node.func) in ('F4', 'np.float32')
                and isinstance(node.args[0], ast.Constant) and type(node.args[0].value) is int):
            yield function, float(node.args[0].value)
        for child in ast.iter_child_nodes(node):
            yield from walk(child, function)
    yield from walk(tree, '')


def has_number(node):
    """Return whether an expression contains a number, none that is only an index."""
    indices = {id(inner) for each in ast.walk(node) if isinstance(each, ast.Subscript)
               for inner in ast.walk(each.slice)}
    return any(isinstance(each, ast.Constant) and type(each.value) in (int, float)
               and id(each) not in indices for each in ast.walk(node))


def assigned_numbers(tree):
    """Yield the names of module globals and class attributes that are made of numbers."""
    bodies = [tree.body, *(node.body for node in tree.body if isinstance(node, ast.ClassDef)
                           and not node.name.endswith('Tuning'))]
    for node in (node for body in bodies for node in body):
        if isinstance(node, (ast.Assign, ast.AnnAssign)) and node.value is not None:
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            if has_number(node.value):
                yield ast.unparse(target)


@pytest.mark.parametrize('path', SOURCES, ids=lambda path: f'{path.parent.name}/{path.name}')
def test_no_number_lives_outside_the_tuning(path):
    tree = ast.parse(path.read_text(encoding='utf-8'))
    assert not [(function, value) for function, value in numbers_of(tree)
                if value not in SIMPLE and function not in FORMULAS]
    assert not set(assigned_numbers(tree)) - GLOBALS


def test_the_search_for_numbers_finds_them():
    tree = ast.parse('A = 0.3\nclass B:\n    c = 7\ndef f(x):\n    return F4(5) * x[2] + 1.5\n')
    assert list(numbers_of(tree)) == [('', 0.3), ('f', 5.0), ('f', 1.5)]
    assert list(assigned_numbers(tree)) == ['A', 'c']


def texts_of(room):
    """Return the sources of a room but the tuning itself, as one text."""
    rooms = (room, 'surface') if room == 'rows' else (room,)  # the surface method reads both
    return ' '.join(path.read_text(encoding='utf-8') for each in rooms
                    for path in sorted((CORE / each).glob('*.py')) if path.name != 'tuning.py')


@pytest.mark.parametrize('room, tuning', [('surface', TUNING), ('paper', paper.TUNING),
                                          ('rows', rows.TUNING),
                                          ('surface/third', third.TUNING),
                                          ('projector', projector.TUNING),
                                          ('health', health.TUNING)])
def test_every_constant_is_read(room, tuning):
    text = texts_of(room)
    chooses = {'views.averaging_period', 'views.largest_averaging_radius'}  # in `changes_for`
    unread = [entry.name for entry in listed(tuning) if entry.name not in chooses
              and f'.{entry.name.rpartition(".")[2]}' not in text]
    assert not unread


@pytest.mark.parametrize('path', sorted((CORE / 'surface').glob('*_kernels.py')),
                         ids=lambda path: path.name)
def test_kernels_call_a_constant_as_the_tuning_does(path):
    text = path.read_text(encoding='utf-8')
    pairs = re.findall(r'^(\w+) = (?:F4|I2)?\(?TUNING\.\w+\.(\w+)\)?$', text, re.M)
    assert not [(name, constant) for name, constant in pairs if name != constant.upper()]


def test_values_that_the_settings_tell_in_words_are_those_of_the_tuning():
    described = {spec.name: spec.metadata['description'] for spec in fields(ColorSettings)}
    low, high = paper.TUNING.colors.camera_difference
    assert f'by {TUNING.views.same_camera_balance:.0%}'.replace('%', ' %') in (
        described['equalize_cameras'])
    assert f'by {100 * low:.0f} to {100 * high:.0f} %' in described['equalize_cameras']


def test_no_log_odds_of_the_period_exceed_those_of_a_node():
    assert max(TUNING.repetition.odds) == TUNING.trust.odds_limits[1]


# ---- the tuning itself

def expected(pattern, cycles=1):
    """Return what is known of a pattern."""
    return Expectation.of(PatternSettings(type=pattern, cycles=cycles))


def test_aperiodic_patterns_have_the_tuning_as_it_is():
    for pattern in ('hue_field', 'wave_field', 'pseudo_noise'):
        assert tuning_for(expected(pattern, 16), 640) is not None
        assert tuning_for(expected(pattern, 16), 640) == TUNING


@pytest.mark.parametrize('cycles, width, radius', [(1, 640, 3), (1, 320, 2), (3, 640, 1),
                                                   (16, 640, 0), (1, 4000, 4)])
def test_slow_colors_are_averaged_over_their_cycles(cycles, width, radius):
    tuning = tuning_for(expected('sine', cycles), width)
    assert tuning.views.averaging_radius == radius
    is_slow = radius > 0
    assert (tuning.planes.noise_correlation > 1) == is_slow
    assert (tuning.repetition.least_gap > 0) == (cycles > 1)


def test_patterns_of_unknown_period_repeat_but_are_not_slow():
    tuning = tuning_for(expected('unknown'), 640)
    assert tuning.repetition.least_gap > 0 and tuning.views.averaging_radius == 0
    assert tuning.coarse.texture_surroundings == TUNING.coarse.texture_surroundings
    assert np.isinf(tuning.views.same_camera_balance)


@pytest.mark.parametrize('radius', range(5))
def test_shared_noise_is_that_of_averages_of_averages(radius):
    box, window = 2 * radius + 1, 2 * TUNING.planes.wide_radius + 1
    shares = np.convolve(np.ones(box), np.ones(window)) / (box * window)
    white = 1 / (box * window)  # of as many independent nodes
    assert surface.noise_correlation(radius) == pytest.approx(((shares ** 2).sum() / white) ** 2)


def test_compiled_constants_are_those_of_the_kernels_and_cannot_be_replaced():
    assert PAD == TUNING.grid.pad and PHASE_VARIANCE == np.float32(TUNING.pair.phase_variance)
    with pytest.raises(ValueError, match='pad = 9 cannot replace 8: .* compiled'):
        replaced(TUNING, {'grid.pad': 9})
    assert {entry.name for entry in listed(TUNING) if entry.compiled} >= {
        'grid.pad', 'planes.radius', 'trust.std_per_distance'}


def test_unknown_constants_are_refused():
    with pytest.raises(ValueError, match="unknown constant 'planes.rigde'"):
        replaced(TUNING, {'planes.rigde': 1.0})


def test_a_method_obeys_its_tuning():
    calibration = some_calibration()
    left, right = np.random.default_rng(1).integers(0, 255, (2, 48, 64, 3)).astype(np.uint8)
    settings, found = Settings().updated({'matching.third_view': 'off'}), []
    for values in ({}, {'trust.odds_offset': 100.0}):
        method = SurfaceMethod(settings, calibration, (2, 30), tuning=replaced(TUNING, values))
        found.append(method.measure(left, right, Clock()).confidence.mean())
    assert found[1] > found[0]


class Clock:
    """A stopwatch that nobody reads."""

    def lap(self, *_):
        """Forget the time."""


@dataclass(frozen=True)
class Group(Constants):
    """A group for the tests below."""

    length: float = constant(2.0, 'm', 'A length.', chosen('Any.'))
    fixed: int = constant(3, '1', 'A number.', derived('1 + 2.'), compiled=True)


@dataclass(frozen=True)
class Groups(Constants):
    """Groups in a group."""

    first: Group = Group()


def test_constants_are_listed_by_flat_names():
    first, second = listed(Groups(), 'x.')
    assert (first.name, first.value, first.unit, first.reason) == (
        'x.first.length', 2.0, 'm', 'A length.')
    assert second.compiled and second.provenance.kind == 'derived'
    assert replaced(Groups(), {'first.length': 3.0}).first.length == 3.0


# ---- fitted models

def content(**values):
    """Return the content of a file of a small model."""
    return {'model': 'm', 'command': 'c', 'revision': 'r', 'versions': {}, 'scenes': ['s'],
            'fitted': {'a': 1, 'b': [1, [2.5, 3]]}, 'overrides': {}} | values


def written(tmp_path, data):
    """Return the path of a file with that content."""
    path = tmp_path / 'm.yaml'
    path.write_text(yaml.safe_dump(data) if not isinstance(data, str) else data)
    return path


def test_an_override_ships_instead_of_the_fit_and_says_why(tmp_path):
    data = content(overrides={'a': {'value': -4, 'reason': 'Better so.'}})
    model = fitted.load_model(written(tmp_path, data))
    assert model['a'] == -4.0 and model['b'] == (1.0, (2.5, 3.0))
    assert model.explained('a').endswith('The fit gave 1; set by hand. Better so.')
    assert 'by hand' not in model.explained('b')


@pytest.mark.parametrize('values, kind, explained', [
    ({}, 'fitted', True),
    ({'overrides': {'a': {'value': -4, 'reason': 'Better so.'}}}, 'chosen', True),
    ({'command': fitted.NOT_KEPT}, 'recorded', False),
    ({'command': fitted.NOT_KEPT, 'overrides': {'a': {'value': 2, 'reason': 'So.'}}},
     'recorded', False)])
def test_a_model_says_where_its_values_come_from(tmp_path, values, kind, explained):
    provenance = fitted.load_model(written(tmp_path, content(**values))).provenance('a')
    assert (provenance.kind, provenance.explained) == (kind, explained)
    assert bool(provenance.command) == (kind != 'chosen')
    assert ('command of the fit was not kept' in provenance.text) == (kind == 'recorded')


@pytest.mark.parametrize('data, message', [
    ('a: [', 'is no YAML'), ('7', 'it has no names and values'),
    (content(fitted={}), "'fitted' has no names"), (content(extra=1), "'extra' is not one of"),
    ({key: value for key, value in content().items() if key != 'scenes'}, "'scenes' is missing"),
    (content(overrides=[]), "'overrides' has no names"),
    (content(overrides={'z': {'value': 1, 'reason': ''}}), "'z' is no fitted parameter"),
    (content(overrides={'a': {'value': 1}}), "'a' needs 'value' and 'reason'"),
    (content(fitted={'a': 'many'}), "a = 'many' is no number"),
    (content(fitted={'a': [1, float('nan')]}), 'is no number'),
    (content(fitted={'a': []}), 'is no number'), (content(fitted={'a': True}), 'is no number')])
def test_a_damaged_model_is_refused_with_the_reason(tmp_path, data, message):
    path = written(tmp_path, data)
    with pytest.raises(ColorStereoError, match=f'm.yaml.*{message}'):
        fitted.load_model(path)


def test_a_missing_model_is_refused():
    with pytest.raises(ColorStereoError, match='cannot be read'):
        fitted.load_model('nonsense')


def test_all_models_that_ship_are_in_the_tuning():
    shipped = {path.stem for path in fitted.MODELS.glob('*.yaml')}
    assert shipped == {'trust', 'slow', 'spread', 'period', 'third', 'doubts', 'certainty',
                       'steps', 'temper', 'quality'}
    assert third.TUNING.use.doubts == fitted.load_model('doubts')['doubts']
    kept = fitted.load_model('certainty')['kept_certainty']
    assert third.TUNING.use.kept_certainty == kept
    assert TUNING.steps.odds == fitted.load_model('steps')['odds']
    assert TUNING.trust.rough_odds == fitted.load_model('temper')['rough_odds']
    assert TUNING.quality.pull_gain == fitted.load_model('quality')['pull_gain']
    assert TUNING.trust.form == fitted.load_model('trust')['form']
    assert third.TUNING.odds.firm == fitted.load_model('third')['firm']
    assert slow(4)['trust.odds_offset'].value == fitted.load_model('slow')['odds_offset']

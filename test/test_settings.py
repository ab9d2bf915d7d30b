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
"""Settings: complete descriptions, checked values, replacement by flat name."""

import dataclasses

from color_stereo_ros.core import (
    ColorSettings, MatchingSettings, PatternSettings, RangeSettings, Settings, SettingsError)
from color_stereo_ros.core.methods import Method, METHODS
from color_stereo_ros.core.settings import described, setting, suggestion
import numpy as np
import pytest

DESCRIBED = list(described(Settings()))
NUMBERS = [item for item in DESCRIBED if type(item[1]) in (int, float)]
WITHOUT_UNIT = {'pattern.cycles', 'pattern.seed', 'matching.min_confidence',
                'matching.smoothness', 'matching.refinements', 'matching.uniqueness_ratio'}


def test_every_setting_has_a_description():
    for name, _, meta in DESCRIBED:
        assert len(meta['description']) > 10, name


def test_every_number_has_a_range_and_a_default_inside():
    for name, default, meta in NUMBERS:
        assert meta['minimum'] is not None and meta['maximum'] is not None, name
        assert meta['minimum'] <= default <= meta['maximum'], name


def test_units_are_those_of_the_documentation():
    assert {meta['unit'] for _, _, meta in DESCRIBED} <= {'', 'px', 'm', 'DN', 's'}


def test_lengths_and_signals_have_units():
    units = {name: meta['unit'] for name, _, meta in DESCRIBED}
    for name in ('range.min_depth', 'range.max_depth'):
        assert units[name] == 'm'
    for name in ('color.dark_level', 'color.min_signal', 'color.saturation_level'):
        assert units[name] == 'DN'
    for name in ('matching.window_width', 'matching.local_limit', 'pattern.feature_size'):
        assert units[name] == 'px'


def test_every_text_has_choices_with_the_default_among_them():
    for name, default, meta in DESCRIBED:
        if isinstance(default, str) and name != 'color.calibration':  # the name of a file
            assert default in meta['choices'], name


@pytest.mark.parametrize('name, default, meta', NUMBERS, ids=[item[0] for item in NUMBERS])
def test_values_outside_the_range_are_refused_with_value_and_range(name, default, meta):
    for value in (meta['minimum'] - 1, meta['maximum'] + 1):
        with pytest.raises(SettingsError) as error:
            Settings().updated({name: value})
        assert name in str(error.value) and str(value) in str(error.value)
        assert str(meta['maximum']) in str(error.value)


def test_nan_is_outside_every_range():
    with pytest.raises(SettingsError, match='range.min_depth = nan m is outside 0.001 .. 1000.0'):
        RangeSettings(min_depth=float('nan'))


def test_a_wrong_type_is_refused():
    with pytest.raises(SettingsError, match="matching.window_width = '9' is a str, expected int"):
        MatchingSettings(window_width='9')
    with pytest.raises(SettingsError, match='matching.window_width = 9.0 is a float'):
        MatchingSettings(window_width=9.0)
    with pytest.raises(SettingsError, match='color.equalize = 1 is a int, expected bool'):
        ColorSettings(equalize=1)
    with pytest.raises(SettingsError, match='range.min_depth = True is a bool'):
        RangeSettings(min_depth=True)


def test_an_integer_is_taken_for_a_float():
    settings = RangeSettings(min_depth=1, max_depth=2)
    assert isinstance(settings.min_depth, float)


def test_numpy_numbers_become_plain_ones():
    assert type(RangeSettings(min_depth=np.float64(0.3)).min_depth) is float
    assert type(PatternSettings(cycles=np.int64(3)).cycles) is int


def test_an_unknown_choice_is_refused_with_the_choices():
    with pytest.raises(SettingsError, match="matching.method = 'best' is not one of surface, pap"):
        MatchingSettings(method='best')


@pytest.mark.parametrize('name', ['matching.method', 'range.min_depth', 'x' * 100_000])
def test_a_refusal_shows_a_long_value_in_brief(name):
    with pytest.raises(SettingsError) as refused:
        Settings().updated({name: 'x' * 100_000})
    assert len(str(refused.value)) < 300 and '(100000 characters)' in str(refused.value)


def test_an_even_window_is_refused():
    with pytest.raises(SettingsError, match='matching.window_height = 8 px is even'):
        MatchingSettings(window_height=8)


def test_crossed_depth_limits_are_refused():
    with pytest.raises(SettingsError, match='range.min_depth = 2.0 m must be smaller than range.'):
        Settings().updated({'range.min_depth': 2.0, 'range.max_depth': 1.0})


def test_depth_limits_may_move_together_past_the_old_ones():
    settings = Settings().updated({'range.min_depth': 3.0, 'range.max_depth': 4.0})
    assert (settings.range.min_depth, settings.range.max_depth) == (3.0, 4.0)


def test_an_unknown_name_is_refused_with_a_suggestion():
    with pytest.raises(SettingsError, match="unknown setting 'range.min_dept'; did you mean "
                                            "'range.min_depth'"):
        Settings().updated({'range.min_dept': 0.3})


def test_no_suggestion_for_a_name_like_nothing():
    assert suggestion('xyzzy', ['range.min_depth']) == ''


def test_flat_names_and_values_build_the_same_settings():
    settings = Settings().updated({'pattern.cycles': 5, 'matching.method': 'paper'})
    assert Settings().updated(settings.flat()) == settings


def test_settings_are_frozen_and_replaced_by_dataclasses():
    settings = Settings()
    with pytest.raises(dataclasses.FrozenInstanceError):
        settings.range.min_depth = 1.0
    changed = dataclasses.replace(
        settings, range=dataclasses.replace(settings.range, min_depth=0.22, max_depth=0.62))
    assert changed.range.max_depth == 0.62 and settings.range.max_depth != 0.62


def test_a_group_of_the_wrong_class_is_refused():
    with pytest.raises(SettingsError, match='range = .* is no RangeSettings'):
        Settings(range=PatternSettings())


@pytest.mark.parametrize('name, text', [
    ('pattern.type', 'hue_field: aperiodic 2-D hue, uniform brightness (default); sweep: '
     'all hues in turn, uniform brightness (paper fig. 2.2 right); bright_sweep: all hues in '
     'turn, full brightness (paper fig. 2.2 left); sine: three phase-shifted sines; walsh: three '
     'Walsh functions, one a channel (paper sec. 2.1); lines: high-contrast lines (paper fig. 2.1 '
     'left); wave_field: 2-D random color waves; pseudo_noise: colored patches; unknown: some '
     'other pattern, which can be matched, not made'),
    ('pattern.cycles', 'repetitions over the width (sweep, bright_sweep, sine); steeper colors '
     'are more precise, but the same ones may come again within the search'),
    ('matching.method', 'surface: coarse to fine with slanted surfaces (default); paper: the '
     'exhaustive search of the paper, sec. 2.2')])
def test_descriptions_tell_what_the_registries_know(name, text):
    assert {name: meta['description'] for name, _, meta in DESCRIBED}[name] == text


def test_choices_and_descriptions_are_those_of_the_moment():
    with METHODS.temporarily():
        METHODS.register('guess', Method('a wild guess', lambda *arguments: None))
        metadata = {name: meta for name, _, meta in described(Settings())}['matching.method']
        assert list(metadata['choices']) == ['surface', 'paper', 'guess']
        assert metadata['description'].endswith('sec. 2.2; guess: a wild guess')
        assert MatchingSettings(method='guess').method == 'guess'
    with pytest.raises(SettingsError, match="'guess' is not one of surface, paper"):
        MatchingSettings(method='guess')


def test_a_description_that_is_a_function_is_asked_at_each_reading():
    texts = iter(['first', 'second'])
    metadata = setting(1, lambda: next(texts), minimum=0, maximum=2).metadata
    assert metadata['description'] == 'first' and metadata.get('description') == 'second'
    assert set(metadata) >= {'description', 'unit', 'minimum', 'maximum', 'choices'}

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
"""The patterns have the properties that the paper and their names promise."""

from color_stereo_ros.core import make_pattern, PatternSettings, Settings, SettingsError
from color_stereo_ros.core.patterns import blocks, hue_field, wave_field
from color_stereo_ros.core.patterns.colors import constant_sum_colors
from color_stereo_ros.core.patterns.expectation import Expectation
from color_stereo_ros.core.patterns.frames import FRAMES, make_frame
from color_stereo_ros.core.patterns.making import check_pattern
from color_stereo_ros.core.patterns.pattern import Pattern, Repeats
from color_stereo_ros.core.patterns.pseudo_noise import repeated_neighborhoods
from color_stereo_ros.core.patterns.registry import is_aperiodic, makable, PATTERNS, repeating
from color_stereo_ros.core.patterns.seen import pattern_seen, steps
import numpy as np
import pytest
from scenes import load
from surface_pairs import exposed, photographed

CONSTANT_SUM = ('sweep', 'lines', 'hue_field')


def pattern(kind, **changes):
    """Return a small pattern."""
    return make_pattern(PatternSettings(type=kind, **{'width': 300, 'height': 40, **changes}))


@pytest.mark.parametrize('kind', makable())
def test_every_pattern_is_an_8_bit_image_of_the_projector_size(kind):
    image = pattern(kind)
    assert image.shape == (40, 300, 3) and image.dtype == np.uint8
    assert image.flags.c_contiguous and image.min() == 0 and image.max() >= 250


@pytest.mark.parametrize('kind', makable())
def test_every_pattern_is_made_again_the_same(kind):
    np.testing.assert_array_equal(pattern(kind), pattern(kind))


@pytest.mark.parametrize('kind', repeating(Repeats.NEVER))
def test_another_seed_gives_another_random_pattern(kind):
    assert (pattern(kind, seed=1) != pattern(kind, seed=2)).mean() > 0.3


def test_every_known_type_but_unknown_can_be_made():
    assert set(makable()) == set(PATTERNS) - {'unknown'}


def test_the_types_keep_their_order_and_kind():
    assert PATTERNS.names == ('hue_field', 'sweep', 'bright_sweep', 'sine', 'walsh', 'lines',
                              'wave_field', 'pseudo_noise', 'unknown')
    assert repeating(Repeats.NEVER) == ['hue_field', 'wave_field', 'pseudo_noise']
    assert repeating(Repeats.CYCLES) == ['sweep', 'bright_sweep', 'sine']


def test_a_registered_type_is_a_choice_made_and_expected_at_once():
    with PATTERNS.temporarily():
        PATTERNS.register('gray', Pattern('all gray', lambda settings: np.full(3, 0.5),
                                          Repeats.NEVER, uniform_brightness=True))
        settings = Settings().updated({'pattern.type': 'gray'})
        assert is_aperiodic(settings.pattern)
        assert Expectation.of(settings.pattern) == Expectation.of(PatternSettings())
        assert (make_pattern(settings.pattern) == 128).all()
    with pytest.raises(SettingsError, match="pattern.type = 'gray' is not one of hue_field"):
        pattern('gray')


def test_an_unknown_pattern_cannot_be_made():
    with pytest.raises(SettingsError, match="pattern.type = 'unknown' cannot be made, expected "
                                            'one of hue_field, sweep'):
        pattern('unknown')


@pytest.mark.parametrize('kind', makable())
def test_a_pattern_tells_whether_its_brightness_is_uniform(kind):
    brightness = pattern(kind).sum(axis=2, dtype=int)
    assert (np.ptp(brightness) <= 2) == PATTERNS[kind].uniform_brightness  # rounding


@pytest.mark.parametrize('kind', CONSTANT_SUM)
def test_the_components_add_up_to_255(kind):
    assert np.abs(pattern(kind).sum(axis=2, dtype=int) - 255).max() <= 1


@pytest.mark.parametrize('kind', (*CONSTANT_SUM, 'bright_sweep'))
def test_one_component_is_zero_everywhere(kind):
    assert pattern(kind).min(axis=2).max() == 0


def test_the_bright_sweep_has_maximum_brightness_everywhere():
    assert (pattern('bright_sweep').max(axis=2) == 255).all()


def test_the_sweep_runs_from_red_over_green_and_blue_back_to_red():
    row = pattern('sweep')[0]
    assert row[0].tolist() == [255, 0, 0]
    assert row[100].tolist() == [0, 255, 0]
    assert row[200].tolist() == [0, 0, 255]
    assert row[299].tolist() == [252, 0, 3]


@pytest.mark.parametrize('kind', repeating(Repeats.CYCLES))
@pytest.mark.parametrize('cycles', [1, 3, 10])
def test_periodic_patterns_repeat_as_often_as_asked(kind, cycles):
    row = pattern(kind, cycles=cycles)[0].astype(int)
    period = 300 // cycles
    np.testing.assert_allclose(row[period:], row[:300 - period], atol=1)  # rounding
    if cycles == 1:
        assert np.unique(row, axis=0).shape[0] == 300
    else:
        assert np.abs(row[period // 2:] - row[:300 - period // 2]).max() > 100


@pytest.mark.parametrize('kind', ['sweep', 'bright_sweep', 'sine', 'walsh', 'lines'])
def test_line_patterns_do_not_change_from_row_to_row(kind):
    image = pattern(kind)
    assert (image == image[0]).all()


def test_sines_are_shifted_by_a_third_of_the_period():
    row = pattern('sine')[0]
    np.testing.assert_array_equal(row[100:, 1], row[:200, 0])
    np.testing.assert_array_equal(row[200:, 2], row[:100, 0])


def test_sines_keep_their_brightness():
    assert np.ptp(pattern('sine').sum(axis=2, dtype=int)) <= 1


def test_walsh_functions_are_orthogonal_and_no_finer_than_asked():
    row = pattern('walsh', width=1024, feature_size=8.0)[0].astype(float) / 127.5 - 1
    np.testing.assert_allclose(row.T @ row, 1024 * np.eye(3), atol=1e-9)
    np.testing.assert_allclose(row.sum(axis=0), 0, atol=1e-9)
    changes = np.flatnonzero(np.any(np.diff(row, axis=0) != 0, axis=1))
    assert np.diff(changes).min() >= 8


def test_walsh_components_have_different_frequencies():
    row = pattern('walsh', width=1024, feature_size=8.0)[0].astype(int)
    changes = (np.diff(row, axis=0) != 0).sum(axis=0)
    assert changes[0] > 1.5 * changes[1] > 2 * changes[2]


def test_neighboring_lines_differ_most_and_every_second_one_is_alike():
    lines = pattern('lines', feature_size=10.0)[0, 5::10].astype(int)
    assert np.abs(lines[1:] - lines[:-1]).max(axis=1).min() > 100
    assert np.abs(lines[2:] - lines[:-2]).max() <= 52


def test_the_hue_field_is_aperiodic_in_both_directions():
    image = pattern('hue_field', width=256, height=256).astype(float)
    image -= image.mean(axis=(0, 1))
    spectrum = np.abs(np.fft.fft2(image, axes=(0, 1))) ** 2
    correlation = np.fft.ifft2(spectrum, axes=(0, 1)).real.sum(axis=2)
    correlation /= correlation[0, 0]
    correlation[:20, :20] = correlation[-20:, :20] = correlation[:20, -20:] = 0
    correlation[-20:, -20:] = 0
    assert correlation.max() < 0.25


def test_a_larger_feature_size_makes_a_smoother_field():
    for kind in ('hue_field', 'wave_field'):
        fine, coarse = (
            np.abs(np.diff(pattern(kind, feature_size=size).astype(int), axis=1)).mean()
            for size in (4.0, 12.0))
        assert coarse < 0.6 * fine


def test_a_field_coarser_than_the_projector_is_refused():
    with pytest.raises(SettingsError, match='pattern.feature_size = 256.0 px is too large'):
        pattern('hue_field', width=16, height=16, feature_size=256.0)


def test_no_neighborhood_of_pseudo_noise_repeats():
    patches = pattern('pseudo_noise', width=600, height=400, feature_size=4.0)[2::4, 2::4]
    codes = (patches > 0) @ [1, 2, 4]
    windows = {tuple(codes[y:y + 3, x:x + 3].ravel())
               for y in range(codes.shape[0] - 2) for x in range(codes.shape[1] - 2)}
    assert len(windows) == (codes.shape[0] - 2) * (codes.shape[1] - 2)


def test_repeated_neighborhoods_are_found():
    codes = np.arange(36).reshape(6, 6) % 6
    repeated = repeated_neighborhoods(codes)
    assert not repeated[0].any() and repeated[1:].all()


def test_pseudo_noise_with_too_many_patches_is_refused():
    with pytest.raises(SettingsError, match='feature_size = 1.0 px makes 3000 x 4000 patches'):
        pattern('pseudo_noise', width=4000, height=3000, feature_size=1.0)


def test_the_wave_field_uses_all_colors_in_both_directions():
    image = pattern('wave_field', width=256, height=256).astype(float)
    assert (image.std(axis=(0, 1)) > 40).all()
    correlation = np.corrcoef(image.reshape(-1, 3).T) - np.eye(3)
    assert np.abs(correlation).max() < 0.5
    assert (np.abs(np.diff(image, axis=0)).mean(axis=(0, 1)) > 3).all()


def whole_hue_field(settings):
    """Return the hue field as one computation, without bands."""
    shape = (settings.height, settings.width)
    noise = np.random.default_rng(settings.seed).standard_normal(shape)
    frequency = np.hypot(np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1]))
    blur = np.exp(-2.0 * (np.pi * settings.feature_size * frequency) ** 2)
    smooth = np.fft.irfft2(np.fft.rfft2(noise) * blur, s=shape)
    smooth -= smooth.mean()
    hue = hue_field.HUE_FIELD_DEVIATION * smooth / smooth.std()
    return np.rint(255.0 * constant_sum_colors(hue)).astype(np.uint8)


@pytest.mark.parametrize('piece, band', [(blocks.PIECE, blocks.BAND), (1000, 5000), (128, 1)])
@pytest.mark.parametrize('width, height', [(300, 40), (8, 8), (13, 9), (257, 1025), (1024, 1024)])
def test_a_hue_field_in_bands_has_the_bytes_of_the_whole_one(
        width, height, piece, band, monkeypatch):
    monkeypatch.setattr(blocks, 'PIECE', piece)
    monkeypatch.setattr(blocks, 'BAND', band)
    settings = PatternSettings(width=width, height=height, feature_size=2.5, seed=7)
    smooth, deviation = hue_field.filtered_noise(settings)
    values = smooth.rows(slice(0, height))
    assert deviation == values.std()
    np.testing.assert_array_equal(make_pattern(settings), whole_hue_field(settings))


@pytest.mark.parametrize('kind', ['wave_field', 'pseudo_noise'])
def test_a_large_pattern_has_the_bytes_of_a_kept_one(kind, monkeypatch):
    whole = pattern(kind, height=400)
    monkeypatch.setattr(blocks, 'PIECE', 1000)
    monkeypatch.setattr(wave_field, 'KEPT', 0)
    np.testing.assert_array_equal(pattern(kind, height=400), whole)


@pytest.mark.parametrize('settings, reason', [
    ({'type': 'unknown'}, "pattern.type = 'unknown' names no pattern that can be shown"),
    ({'width': 8, 'feature_size': 256.0, 'height': 8}, 'feature_size = 256.0 px is too large'),
    ({'width': 64, 'feature_size': 256.0, 'height': 8192}, None),
    ({'width': 1024, 'feature_size': 256.0}, None),
    ({'type': 'pseudo_noise', 'feature_size': 1.0, 'width': 8192, 'height': 8192},
     'expected at most 1000000 for unrepeated')])
def test_a_check_refuses_at_once_what_cannot_be_made(settings, reason):
    asked = PatternSettings(**settings)
    if reason is None:
        check_pattern(asked)
        make_pattern(asked)
        return
    with pytest.raises(SettingsError, match=reason):
        check_pattern(asked)
    with pytest.raises(SettingsError):
        make_pattern(asked)


# ---- what is seen of a pattern

FIELDS = {'hue_field', 'wave_field', 'pseudo_noise'}


def image_of(kind):
    """Return a noisy image of a slanted board under a pattern."""
    shift = np.add.outer(0.01 * np.arange(240), 20 + 0.02 * np.arange(320))
    return exposed(photographed(-shift, kind=kind), np.random.default_rng(5))


@pytest.mark.parametrize('kind', makable())
def test_the_kind_of_pattern_is_seen_in_an_image(kind):
    image = image_of(kind)
    assert pattern_seen(image, PatternSettings(type=kind)).agrees
    assert pattern_seen(image, PatternSettings(type='unknown')).agrees is None
    other = 'sweep' if kind in FIELDS else 'hue_field'
    seen = pattern_seen(image, PatternSettings(type=other))
    assert seen.agrees is False
    assert seen.sentence.startswith(f'{other} is set, but colors change along rows ')
    assert kind in seen.sentence.partition('looks like')[2]


@pytest.mark.parametrize('name', ['solids_hue1', 'prism_hue1'])
def test_stripes_stay_stripes_on_objects(name):
    found = steps(load(name).left)
    assert found.along_columns < 0.3 * found.along_rows


def test_gray_and_dark_images_show_no_pattern():
    gray = np.full((240, 320, 3), 120, np.uint8)
    assert pattern_seen(gray, PatternSettings()).agrees is False
    assert pattern_seen(gray, PatternSettings(type='unknown')).agrees is None
    dark = pattern_seen(gray // 20, PatternSettings())
    assert dark.agrees is None and dark.sentence == 'too little light to see a pattern'
    assert pattern_seen(gray[:2], PatternSettings()).agrees is None


def test_colors_that_are_too_fine_say_nothing_of_the_pattern():
    image = np.random.default_rng(3).integers(90, 150, (240, 320, 3), np.uint8)
    seen = pattern_seen(image, PatternSettings())
    assert seen.agrees is None and 'too fine' in seen.sentence


def test_each_frame_has_the_size_of_the_pattern_and_its_colors():
    settings = PatternSettings(width=100, height=61)
    colors = {'white': (255, 255, 255), 'black': (0, 0, 0), 'red': (255, 0, 0),
              'green': (0, 255, 0), 'blue': (0, 0, 255)}
    for name in FRAMES:
        image = make_frame(name, settings)
        assert (image.shape, image.dtype) == ((61, 100, 3), np.uint8)
        if name in colors:
            assert (image == colors[name]).all()


def test_mask_and_complement_add_up_to_white():
    settings = PatternSettings(width=300, height=200)
    mask, complement = (make_frame(name, settings) for name in ('mask', 'complement'))
    assert set(np.unique(mask)) == {0, 255}
    assert (mask + complement == 255).all()
    assert 0.3 < (mask == 255).mean() < 0.7


def test_blank_light_is_as_bright_as_the_pattern():
    settings = PatternSettings(width=300, height=200)
    blank = make_frame('blank', settings)
    assert np.ptp(blank, axis=(0, 1)).max() == 0
    np.testing.assert_allclose(blank[0, 0], make_pattern(settings).mean(axis=(0, 1)), atol=0.5)
    assert (make_frame('pattern', settings) == make_pattern(settings)).all()

# SPDX-License-Identifier: Apache-2.0
"""The color patterns for the projector (paper, sec. 2.1, figs. 2.1 and 2.2)."""

import numpy as np

from ...errors import SettingsError
from ..settings.groups import PatternSettings

HUE_FIELD_DEVIATION = 1.6  # hue units; the whole circle has 3, so the field wraps around
WAVES = 96                 # of wave_field
WAVE_SPAN = 4.0            # longest over shortest wave of wave_field
WAVE_CLIP = 2.0            # standard deviations of wave_field between middle and full intensity
PATCH_COLORS = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1], [1, 0, 1], [1, 1, 0]])
MAX_PATCHES = 1_000_000    # a tenth of the 6^9 neighborhoods: found within a few trials


def make_pattern(settings=PatternSettings()):
    """
    Return the image that the projector must show.

    Parameters
    ----------
    settings : PatternSettings

    Returns
    -------
    pattern : numpy.ndarray, uint8, shape (height, width, 3)
        RGB, linear light: a projector with a gamma curve should be given the inverse of it.

    Raises
    ------
    SettingsError
        If settings.type is 'unknown': such a pattern cannot be made, only matched.

    """
    if settings.type not in GENERATORS:
        known = ', '.join(GENERATORS)
        raise SettingsError(f'pattern.type = {settings.type!r} cannot be made, expected one of '
                            f'{known}')
    colors = GENERATORS[settings.type](settings)
    return np.ascontiguousarray(np.broadcast_to(
        np.rint(255.0 * np.asarray(colors)).astype(np.uint8),
        (settings.height, settings.width, 3)))


def constant_sum_colors(hue):
    """
    Return colors of uniform brightness, one component zero (paper, fig. 2.2 right).

    Parameters
    ----------
    hue : numpy.ndarray, shape (...)
        0 = red, 1 = green, 2 = blue, 3 = red again; any real number.

    Returns
    -------
    colors : numpy.ndarray, float64, shape (..., 3)
        Components 0..1 whose sum is 1.

    """
    distance = np.abs((hue[..., None] - np.arange(3.0) + 1.5) % 3.0 - 1.5)
    return np.maximum(0.0, 1.0 - distance)


def sweep_hue(settings):
    """Return the hue of each projector column, shape (width,): `cycles` turns over the width."""
    return 3.0 * settings.cycles * np.arange(settings.width) / settings.width


def sweep(settings):
    """Return a constant-sum turn through the hues (paper, fig. 2.2 right)."""
    return constant_sum_colors(sweep_hue(settings))


def bright_sweep(settings):
    """Return the hue sweep of maximum brightness (paper, fig. 2.2 left)."""
    return np.minimum(1.0, 2.0 * constant_sum_colors(sweep_hue(settings)))


def sine(settings):
    """Return three sines, shifted by a third of a period (paper, sec. 2.1)."""
    phase = 2.0 * np.pi / 3.0 * (sweep_hue(settings)[:, None] - np.arange(3.0))
    return 0.5 + 0.5 * np.cos(phase)


def walsh(settings):
    """
    Return three Walsh functions, one per component (paper, sec. 2.1).

    The width is cut into 2^n segments of at least feature_size px. Function j is -1 to the number
    of bits that segment number and j share; red takes every third bit from the first on, green
    from the second, blue from the third, so that red is the fastest.

    """
    bits = max(3, int(np.log2(settings.width / settings.feature_size)))
    segments = np.arange(settings.width) * 2 ** bits // settings.width
    every_third = [sum(1 << bit for bit in range(first, bits, 3)) for first in range(3)]
    return np.stack([1.0 - parity(segments & mask) for mask in every_third], axis=-1)


def parity(numbers):
    """Return 1 where a non-negative number below 2^16 has an odd count of set bits."""
    for shift in (8, 4, 2, 1):
        numbers = numbers ^ (numbers >> shift)
    return numbers & 1


def lines(settings):
    """
    Return columns of high contrast (paper, fig. 2.1 left).

    From line to line the hue jumps half around the circle and returns, so that every second line
    follows the constant-sum sweep.

    """
    line = np.floor(np.arange(settings.width) / settings.feature_size)
    slow = 3.0 * settings.cycles * line * settings.feature_size / settings.width
    return constant_sum_colors(slow + 1.5 * (line % 2))


def wave_field(settings):
    """
    Return superposed two-dimensional waves of random direction and color (paper, sec. 2.1).

    Half waves are feature_size to WAVE_SPAN times as long.

    """
    rng = np.random.default_rng(settings.seed)
    half_waves = settings.feature_size * WAVE_SPAN ** rng.random(WAVES)
    direction, start = 2.0 * np.pi * rng.random((2, WAVES))
    wave_numbers = np.pi / half_waves
    along_x = np.exp(1j * np.outer(np.arange(settings.width), wave_numbers * np.cos(direction)))
    along_y = np.exp(1j * np.outer(np.arange(settings.height), wave_numbers * np.sin(direction)))
    strengths = rng.standard_normal((3, WAVES)) * np.exp(1j * start)
    # cos(u x + v y + start) = Re[exp(i v y) exp(i start) exp(i u x)]: a product of matrices.
    field = np.stack([((along_y * strength) @ along_x.T).real for strength in strengths], axis=-1)
    deviation = field.std(axis=(0, 1))
    return np.clip(0.5 + 0.5 * field / (WAVE_CLIP * deviation), 0.0, 1.0)


def pseudo_noise(settings):
    """Return square patches of six colors in which no 3 x 3 patches repeat (paper, sec. 2.1)."""
    rows, columns = (max(3, int(np.ceil(size / settings.feature_size)))
                     for size in (settings.height, settings.width))
    codes = unrepeated_codes(rows, columns, settings)
    row = np.minimum(np.arange(settings.height) / settings.feature_size, rows - 1).astype(int)
    column = np.minimum(np.arange(settings.width) / settings.feature_size, columns - 1).astype(int)
    return PATCH_COLORS[codes[row[:, None], column]]


def unrepeated_codes(rows, columns, settings):
    """
    Return random color numbers, int (rows, columns), whose 3 x 3 neighborhoods are all different.

    Raises
    ------
    SettingsError
        If there are more patches than MAX_PATCHES.

    """
    if rows * columns > MAX_PATCHES:
        raise SettingsError(f'pattern.feature_size = {settings.feature_size} px makes {rows} x '
                            f'{columns} patches, expected at most {MAX_PATCHES} for unrepeated '
                            '3 x 3 neighborhoods')
    rng = np.random.default_rng(settings.seed)
    codes = rng.integers(len(PATCH_COLORS), size=(rows, columns))
    repeated = repeated_neighborhoods(codes)
    while repeated.any():
        codes[1:-1, 1:-1][repeated] = rng.integers(len(PATCH_COLORS), size=repeated.sum())
        repeated = repeated_neighborhoods(codes)
    return codes


def repeated_neighborhoods(codes):
    """Return which 3 x 3 neighborhoods occurred before, bool (rows - 2, columns - 2)."""
    rows, columns = codes.shape
    number = np.zeros((rows - 2, columns - 2), np.int64)
    for y in range(3):
        for x in range(3):
            number = number * len(PATCH_COLORS) + codes[y:rows - 2 + y, x:columns - 2 + x]
    repeated = np.ones(number.size, bool)
    repeated[np.unique(number, return_index=True)[1]] = False
    return repeated.reshape(number.shape)


def hue_field(settings):
    """Return an aperiodic two-dimensional hue field of uniform brightness."""
    return constant_sum_colors(random_phase(settings))


def random_phase(settings):
    """Return the phase of hue_field: Gaussian-filtered white noise, hue units, (H, W)."""
    shape = (settings.height, settings.width)
    noise = np.random.default_rng(settings.seed).standard_normal(shape)
    frequency = np.hypot(np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1]))
    # The Fourier transform of a Gaussian of standard deviation s is exp(-2 (pi s f)^2).
    blur = np.exp(-2.0 * (np.pi * settings.feature_size * frequency) ** 2)
    smooth = np.fft.irfft2(np.fft.rfft2(noise) * blur, s=shape)
    smooth -= smooth.mean()
    deviation = smooth.std()
    if deviation < 1e-9:
        raise SettingsError(f'pattern.feature_size = {settings.feature_size} px is too large for '
                            f'a pattern of {settings.width} x {settings.height} px')
    return HUE_FIELD_DEVIATION * smooth / deviation


GENERATORS = {
    'hue_field': hue_field, 'sweep': sweep, 'bright_sweep': bright_sweep, 'sine': sine,
    'walsh': walsh, 'lines': lines, 'wave_field': wave_field, 'pseudo_noise': pseudo_noise}

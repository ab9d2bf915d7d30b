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
"""
All constants of the paper's method: value, unit, reason and provenance of each.

What the paper leaves to the user is a setting. docs/tuning.md lists both kinds of constants.

"""

from dataclasses import dataclass

from ..constants import chosen, constant, Constants, derived, unexplained

FIRST = 'The value of the first version (9569ee0).'


@dataclass(frozen=True)
class ColorTuning(Constants):
    """Color correction and noise elimination (paper, sec. 2.2)."""

    brightness: float = constant(
        255.0, 'DN', 'Sum of the components of a scaled color (lambda of the paper).',
        derived('Full scale of an 8-bit channel (paper, sec. 2.2).'))
    dark_percentile: float = constant(
        5.0, '%', 'Percentile of the weakest components that is the dark level.',
        unexplained('One component of the pattern is zero, or a shadow shows it. ' + FIRST))
    dark_step: int = constant(
        8, 'px', 'Distance of the pixels that the dark level is estimated from.',
        chosen('4800 pixels are left at 640 x 480 (12a04d7).'))
    blur_reach: float = constant(
        3.0, 'standard deviations', 'How far the smoothing looks to each side.',
        derived('A Gaussian has .3 % of its weight beyond.'))
    spot_step: int = constant(
        16, 'px', 'Distance of the spots that the gains are estimated from.',
        chosen('1200 spots at 640 x 480 (12a04d7).'))
    spot_size: int = constant(
        4, 'px', 'Rows and columns of a spot.',
        chosen('The mean of 16 pixels has a quarter of their noise.'))
    gain_iterations: int = constant(
        4, '1', 'Reweighted eigenvalue problems that the gains are estimated by.',
        unexplained(FIRST))
    least_gain_samples: int = constant(
        50, 'pairs of spots', 'Pairs of spots below which all gains are 1.', unexplained(FIRST))
    robust_scale: float = constant(
        1.5, '1', 'Factor of the median contrast beyond which a pair counts less than half.',
        derived('1.4826 times the median is a standard deviation of normal noise; rounded.'))
    least_contrast: float = constant(
        1e-6, '1', 'Added to that scale: prevents division by 0.',
        derived('Far below the contrast of any noise.'))
    least_brightness: float = constant(
        1e-3, 'DN', 'Smallest brightness that a difference is divided by.',
        derived('Far below one step of the camera; prevents division by 0.'))
    relative_ridge: float = constant(
        1e-6, '1', 'Added to the diagonal of the samples, as a share of its trace.',
        derived('Keeps the Cholesky factor finite where all samples have one color.'))
    absolute_ridge: float = constant(
        1e-12, 'DN^2', 'Added to that ridge.', derived('The same where all samples are black.'))
    camera_difference: tuple = constant(
        (0.20, 0.35), '1', 'Differences of the log gains of two cameras: below the first they '
        'share their gains, above the second each has its own.',
        unexplained('Smaller ones are errors of the estimate for two cameras of one type. '
                    + FIRST))
    least_sum: float = constant(
        1e-6, 'DN', 'Smallest sum of components that a color is divided by.',
        derived('Far below one step of the camera; prevents division by 0.'), compiled=True)


@dataclass(frozen=True)
class SearchTuning(Constants):
    """The exhaustive search (paper, sec. 2.2 and 3)."""

    cost_unit: float = constant(
        2.0, '1 / DN^2', 'Stored cost per squared color difference.',
        chosen('The finest unit for which costs fit into 16 bits.'), compiled=True)
    cost_cap: int = constant(
        16000, 'stored cost', 'Largest cost of a pixel: bounds what an outlier counts.',
        derived('Colors that are 89 DN apart: 2 x 89^2.'), compiled=True)
    unlit_ratio: float = constant(
        1.0e3, '1', 'Color ratio that no lit pixel has.',
        derived('Components of 255 DN and less than 1 DN have a smaller one.'), compiled=True)
    least_component: float = constant(
        1e-3, 'DN', 'Smallest component that a ratio is divided by.',
        derived('Far below one step of the camera; prevents division by 0.'), compiled=True)
    unknown_cost: int = constant(
        2000, 'stored cost', 'Cost of any color against an unusable left pixel.',
        chosen('Colors that are 32 DN apart: it tells no disparity from another.'), compiled=True)
    lanes: int = constant(
        32, '1', 'Disparities are rounded up to a multiple of this.',
        chosen('Vectors without a remainder are up to twice as fast (12a04d7).'), compiled=True)
    padding_cost: int = constant(
        2 ** 30, 'stored cost', 'Window sum of disparities that are no candidates.',
        derived('More than 63 x 63 times `cost_cap`.'), compiled=True)
    no_cost: int = constant(
        2 ** 31 - 1, 'stored cost', 'Cost that every candidate undercuts.',
        derived('The largest int32.'), compiled=True)
    no_index: int = constant(
        2 ** 30, '1', 'Index that is larger than every disparity.',
        derived('More than any image has columns.'), compiled=True)
    tile: int = constant(
        16, 'px', 'Side of the tiles whose median is the disparity of the surroundings.',
        chosen('The value of the first version of the local limit (7293f3f).'))
    mosaic_blur: float = constant(
        1.2, 'px', 'Standard deviation of the noise correlation of single-chip cameras.',
        unexplained('The value of the first version (7293f3f).'))


@dataclass(frozen=True)
class SupportTuning(Constants):
    """Matches by chance and the confidence: whether matches of neighboring windows agree."""

    blur_reach: float = constant(
        2.0, 'standard deviations', 'Distance of windows that have no noise in common.',
        derived('Noise that was smoothed correlates by 1 / e over this distance.'))
    surroundings: int = constant(
        7, 'windows', 'Columns and rows of windows that decide together.',
        chosen('49 windows: on noise and on the twelve path-traced scenes both are sure.'))
    tolerance: float = constant(
        2.0, 'px', 'Largest misfit of three disparities on a line.',
        chosen('Whole disparities on a straight surface differ by at most 2 px.'), compiled=True)
    slope: float = constant(
        1.0, 'px / px', 'Steepest surface whose disparities agree.',
        chosen('Steeper surfaces are hidden from the right camera.'), compiled=True)
    share_unit: int = constant(
        256, '1', 'Integers that a share of 1 is counted in.',
        derived('Sums of integers do not depend on the number of threads.'), compiled=True)
    least_probability: float = constant(
        1e-3, '1', 'Smallest probability of agreement by chance.',
        chosen('Smaller ones would let a single agreement count for much.'), compiled=True)
    least_evidence: float = constant(
        5.0, '1', 'Evidence against chance below which surroundings are refused.',
        derived('exp(-5) = .7 % is the largest probability of noise (Chernoff bound).'),
        compiled=True)
    precision: float = constant(
        0.02, 'px', 'Added to standard deviations before their logarithm is taken.',
        chosen('More precise matches are not more often right.'), compiled=True)
    odds: tuple = constant(
        (0.45, -0.78, 1.18), '1', 'Log-odds of being right within 1 px: offset, factors of the '
        'log of the standard deviation and of the log-odds of agreement.',
        chosen('Logistic regression on the path-traced scenes solids (one sweep, hue field) and '
               'bench, windows 9 x 9 and 9 x 1; flat_350 and prism were held out.'),
        compiled=True)


@dataclass(frozen=True)
class Tuning(Constants):
    """All constants of the paper's method."""

    colors: ColorTuning = ColorTuning()
    search: SearchTuning = SearchTuning()
    support: SupportTuning = SupportTuning()


TUNING = Tuning()

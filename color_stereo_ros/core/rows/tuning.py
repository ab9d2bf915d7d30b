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
All constants of the row alignment: value, unit, reason and provenance of each.

The disturbances named here were applied to the path-traced pairs of docs/row_alignment.md.

"""

from dataclasses import dataclass

from ..constants import chosen, constant, Constants, derived, ROBUST_STD, unexplained


@dataclass(frozen=True)
class EstimateTuning(Constants):
    """From the evidence of a pair to the alignment that is carried on."""

    prior_std: tuple = constant(
        (30.0, 8.0, 8.0, 0.3, 0.3, 0.3, 0.3), 'px', 'Standard deviation of each coefficient '
        'before anything is seen: offset, roll, scale, x x, x y, y y, radial.',
        chosen('Offset, roll and scale are free. The others stay near 0 unless the evidence '
               'carries them: 300 cells know them to .01 px.'))
    floor_std: float = constant(
        0.004, 'px', 'Standard deviation of each coefficient of one pair that no amount of '
        'evidence removes.',
        chosen('Undisturbed pairs show coefficients of this size.'))
    keep: float = constant(
        0.6, '1', 'Share of the information that is left after one pair (process noise).',
        unexplained('A mounting that yields slowly is followed within a few pairs.'))
    turns: int = constant(
        4, 'pairs', 'After so many pairs all cells were asked.',
        derived('The step of the cells in the surface method. The errors of a cell come again: '
                'asking it in each pair tells nothing new.'))
    bump: float = constant(
        0.08, 'px', 'Difference between a pair and what was carried, root mean square over the '
        'evidence, from which the latter is forgotten.',
        chosen('Eight times what undisturbed pairs scatter.'))
    iterations: int = constant(
        5, '1', 'Most rounds of reweighting.',
        unexplained('The fourth changes less than .001 px.'))
    converged: float = constant(
        0.001, 'px', 'Change of the coefficients after which there is no further round.',
        derived('A quarter of what no evidence removes (floor_std).'))
    outlier: float = constant(
        2.5, '1', 'Deviations at which a cell has half of its weight (Cauchy).',
        chosen('Half-occluded cells and mirrors must not count.'))
    half: float = constant(
        round(1 / ROBUST_STD, 4), '1', 'Deviations that half of the cells stay within.',
        derived('Third quartile of the normal distribution.'))
    least_weight: float = constant(
        1e-6, 'px^-2', 'Smallest weight that is divided by.',
        derived('A standard deviation of 1000 px: an outlier.'))
    least_scatter: float = constant(
        0.02, 'px', 'Smallest scatter of the cells around the model.',
        derived('Far below what noise gives; prevents division by 0.'))
    least_cells: int = constant(
        24, 'cells', 'Cells with vertical structure below which nothing is said.',
        unexplained('Three for each coefficient.'))
    vague: float = constant(
        0.06, 'px', 'Standard deviation of the mean row error above which it is not observable.',
        chosen('JPEG of quality 60 .035, vertical stripes .02 to .05 px.'))
    useful: float = constant(
        0.1, 'px', 'Standard deviation of the row error at a place where it is half known.',
        derived('A row error of .1 px shows in the disparities.'))


@dataclass(frozen=True)
class UseTuning(Constants):
    """When the right view is corrected, and when a pair is measured again."""

    least_error: float = constant(
        0.03, 'px', 'Row error, root mean square over the image, that is corrected.',
        chosen('A tenth of it reaches the disparities; undisturbed pairs show up to .011 px.'))
    least_error_left: float = constant(
        0.015, 'px', 'The same once rows are corrected.',
        derived('Half: the correction must not come and go.'))
    least_chi_square: float = constant(
        30.0, '1', 'Least sum of squares of the coefficients in standard deviations that is not '
        'chance.', derived('Chi-square with seven degrees of freedom: chance of .0001.'))
    least_change: float = constant(
        0.004, 'px', 'Largest change of the correction that is not worth new maps.',
        derived('Less than the precision of a pair.'))
    again: float = constant(
        0.05, 'px', 'Row error left in a pair, root mean square over the evidence, from which the '
        'pair is measured again.',
        chosen('It adds .015 px to the disparities, as much as noise.'))
    turns: int = constant(
        8, '1', 'Largest number of times that one pair is measured.',
        chosen('2 px need five, 1 px four, .5 px and what a search has found two.'))
    poor: float = constant(
        3.0, '1', 'Median misfit of cells from which the views do not agree.',
        chosen('Undisturbed .6 to 1, .5 px off 1.8 to 3, 1 px 3.5 to 6, two different scenes 9 '
               'to 18.'))
    least_share: float = constant(
        0.3, '1', 'Share of the cells with vertical structure that must have matches.',
        unexplained('Undisturbed pairs have .8 and more.'))
    least_structured: float = constant(
        0.25, '1', 'Share of the lit cells that must have vertical structure.',
        chosen('Vertical stripes .00 to .26, at depth edges, where the views differ; '
               'two-dimensional patterns .28 to 1.'))
    steady: float = constant(
        0.15, 'px', 'Scatter of the cells around the model below which the views agree, however '
        'large the misfit is.',
        chosen('1 % hot pixels .1 px, chance matches .19 to .28 px.'))
    chance: float = constant(
        0.18, 'px', 'Scatter of the cells around the model from which matches are chance.',
        chosen('Two scenes .19 to .28 px, JPEG of quality 60 .17 px.'))
    doubted: float = constant(
        5.0, '1', 'Median misfit of cells above which such matches lose log-odds.',
        chosen('JPEG of quality 40 has 3.1 and right ranges, two scenes 9 to 18.'))
    doubt: float = constant(
        2.0, '1', 'Log-odds that all nodes lose where the views do not agree, per doubling of '
        'the misfit above `doubted`.',
        chosen('Two scenes: 3 % of the pixels had chance ranges of confidence above .9.'))
    largest_doubt: float = constant(
        6.0, '1', 'Largest such loss.', unexplained('Leaves no range of a usual node.'))
    followed: float = constant(
        0.3, 'px', 'Row error left in a pair that does not agree from which it is followed.',
        chosen('1 to 3 px off shows .4 to .9 px, two different scenes .1 px.'))
    better: float = constant(
        0.8, '1', 'Factor of the misfit that a found alignment must reach to be kept.',
        unexplained('A chance alignment leaves it as it is.'))
    coverage: float = constant(
        0.4, '1', 'Share of a row error that reaches the disparities.',
        chosen('Measured: .28 on a board, .44 on a bench, under the default pattern.'))
    silent: float = constant(
        0.02, 'px', 'Row error that the standard deviation of disparities does not tell.',
        derived('It adds less than .01 px.'))
    bump: float = constant(
        0.2, 'px', 'Difference from what the matches show, root mean square over the image, from '
        'which the find of a search is tried.', chosen('A find is good to .02 px.'))
    told: float = constant(
        0.3, 'px', 'Row error from which people are told.',
        chosen('Good calibrations of ROS stay below .25 px.'))


@dataclass(frozen=True)
class SearchTuning(Constants):
    """The search from nothing: SIFT on two chromaticities, and on brightness where they fail."""

    largest_width: int = constant(
        800, 'px', 'Width up to which images are searched as they are; wider ones are reduced.',
        derived('The time of the search stays below .5 s.'))
    gray: float = constant(
        96.0, '1', 'Steps of 8 bit per unit of chromaticity, or of the logarithm of brightness.',
        unexplained('Hues of a full pattern, or a contrast of 14, use most of the 256 steps.'))
    surroundings: int = constant(
        31, 'px', 'Width of the surroundings that brightness is compared with.',
        unexplained('Wider than the structures of patterns, narrower than shading.'))
    middle: float = constant(
        128.0, '1', 'Gray value of a surface without color.', derived('The middle of 8 bit.'))
    turned: float = constant(
        8.0, 'px', 'Distance up to which a match agrees with a view that is turned or far off.',
        unexplained('Depth moves matches along the rows; a rough answer is enough.'))
    dark: float = constant(
        24.0, 'DN', 'Added to the sum of the channels: dark noise has no color.',
        unexplained('A dim channel, of a signal of 255.'))
    features: int = constant(
        1500, '1', 'Largest number of features per image and chromaticity.',
        derived('Bounds the time of matching.'))
    ratio: float = constant(
        0.75, '1', 'Largest ratio of the best to the second best distance (Lowe 2004).',
        unexplained('The usual value; 90 % and more of the matches agree.'))
    margin: float = constant(
        24.0, 'px', 'How far beyond the disparity limits a match may lie.',
        derived('A row error of 20 px comes with errors of the columns.'))
    gates: tuple = constant(
        (12.0, 6.0, 3.0, 1.5, 1.0), 'px', 'Distance from the model up to which a match agrees, '
        'round by round.', chosen('Roll and scale move rows by up to 3 px; single matches scatter '
                                  'by .2 to .35 px.'))
    linear_rounds: int = constant(
        3, '1', 'Rounds that fit offset, roll and scale only.',
        derived('Few matches are wrong after these.'))
    match_std: float = constant(
        0.3, 'px', 'Standard deviation of one match.',
        chosen('.21 to .34 px on path-traced pairs.'))
    least_matches: int = constant(
        40, '1', 'Matches that must agree.', unexplained('Chance gives fewer than ten.'))
    least_features: int = constant(
        200, '1', 'Features of the richer view from which a pair without matches shows different '
        'things.',
        unexplained('Five times as many as matches must agree.'))
    least_share: float = constant(
        0.5, '1', 'Share of the matches that must agree.',
        chosen('Path-traced pairs .93 to .98, two different scenes below .1.'))
    largest_offset: float = constant(
        32.0, 'px', 'Largest row error that is corrected.',
        derived('Rows beyond the image are known up to there.'))
    largest_wait: int = constant(
        64, 'pairs', 'Largest number of pairs between two searches that find nothing.',
        derived('A search takes as long as 30 pairs.'))


@dataclass(frozen=True)
class Tuning(Constants):
    """All constants of the row alignment."""

    estimate: EstimateTuning = EstimateTuning()
    use: UseTuning = UseTuning()
    search: SearchTuning = SearchTuning()


TUNING = Tuning()

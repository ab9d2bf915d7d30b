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
"""All constants of the third view: value, unit, reason and provenance of each."""

from dataclasses import dataclass

from ..fitted import load_model
from ...constants import chosen, constant, Constants, derived

THIRD, DOUBTS, CERTAINTY = (load_model(name) for name in ('third', 'doubts', 'certainty'))


@dataclass(frozen=True)
class SweepTuning(Constants):
    """From nodes of the left image to places of the pattern."""

    least_depth: float = constant(
        1e-6, 'm', 'Nearest distance from the projector, per distance from the left camera.',
        derived('Prevents division by 0; behind the projector there is no light.'),
        compiled=True)
    far_outside: float = constant(
        -1e6, 'px', 'Place of what lies behind the projector.',
        derived('Outside any pattern.'), compiled=True)
    unit: float = constant(
        1 / 255, '1', 'Light per step of a packed pixel.', derived('A byte for each channel.'),
        compiled=True)
    spread_step: float = constant(
        1.05, '1', 'Ratio of the disparities for which the uncertainty of the projector is kept.',
        derived('Its variance is off by a twentieth.'))
    samples: tuple = constant(
        (12, 9), '1', 'Places across and down where the uncertainty of the projector is computed.',
        chosen('It changes slowly over the image.'))
    least_shift: float = constant(
        1e-3, 'px', 'Smallest disparity against infinity, and smallest movement of the place.',
        derived('Prevents division by 0.'))

    prepared_places: float = constant(
        0.1, 'px', 'Largest error of places, by a change of the lens that no affine map explains, '
        'up to which the straightened pattern is kept.',
        derived('Half of the deviation of `use.phase_variance`, reached at the corners of the '
                'pattern only. It is the same from pair to pair: disparities shift by it over the '
                'movement of the place per disparity.'))
    lens_samples: int = constant(
        7, '1', 'Places across and down where two lenses are compared.',
        derived('Differences are polynomials of the third power.'))
    prepared_scale: float = constant(
        0.03, '1', 'Largest change of the scale for which the pattern is blurred anew.',
        derived('A blur of 1 px is off by .03 px.'))


@dataclass(frozen=True)
class ColorTuning(Constants):
    """What the left camera sees of the pattern."""

    margin: float = constant(
        2.0, 'px', 'Border of the pattern that lights nothing reliably.',
        derived('Two deviations of the blur of a sharp lens.'), compiled=True)
    least_light: float = constant(
        1e-6, '1', 'Smallest sum of the channels of the pattern.',
        derived('Prevents division by 0; a white pixel has 3.'), compiled=True)
    samples: int = constant(
        700, '1', 'Nodes from which the map of the colors is fitted, at most.',
        chosen('Twelve numbers are known to a hundredth; 1500 tell no more and take 2 ms.'))
    blurs: tuple = constant(
        (0.0, 1.0, 1.7, 2.5, 3.5), 'px', 'Further blur of the left view that the pattern is '
        'given, standard deviation.',
        chosen('Lenses out of focus, projectors out of focus, subsampled chroma.'))
    sharp: float = constant(
        0.985, '1', 'Share of the spread of the colors from which no further blur is tried.',
        chosen('Sharp views of gray surfaces: .99.'))
    scale_samples: int = constant(
        4000, '1', 'Nodes from which the first quartile of the errors is taken, about.',
        derived('Known to a hundredth.'))
    least_samples: int = constant(
        300, '1', 'Known nodes below which the third view takes no part.',
        chosen('Less than .5 % of the nodes of a VGA pair say nothing about all others.'))
    turns: int = constant(
        3, '1', 'Rounds of reweighting of the map of the colors.',
        chosen('The fourth changes less than a thousandth.'))
    robust: float = constant(
        4.0, '1', 'Squared error at which a node has half of its weight, medians.',
        chosen('Colored surfaces must not decide what white ones look like.'))
    color_prior: float = constant(
        1e-4, '1', 'Hold of the map of the colors towards equal channels, share of the evidence.',
        chosen('The sum of the channels of the default pattern is constant: the offset alone '
               'would not be determined.'))
    least_error: float = constant(
        1e-12, '1', 'Smallest squared error of a color.', derived('Prevents division by 0.'))
    least_total: float = constant(
        0.02, '1', 'Smallest brightness of the predicted color, white = 3.',
        derived('Prevents division by 0.'))
    thin: int = constant(
        2, '1', 'Coarse nodes, across and down, per node where colors are measured.',
        chosen('Six scenes: 1 covers as much and takes 3 ms more.'))
    radii: tuple = constant(
        (12, 3, 1), 'thin nodes', 'Radii of the windows from which local colors are measured.',
        chosen('A material, a part, a print; each holds where the next one knows nothing.'))
    thinnings: tuple = constant(
        (3, 1, 1), '1', 'Thin nodes per node of the grid on which windows are averaged.',
        derived('Smooth over windows: a quarter of the radius.'))
    holds: tuple = constant(
        (2.0, 4.0, 8.0), '1', 'Hold of the local colors towards those of the larger window.',
        chosen('A node of usual noise weighs 400 times its share of a window.'))
    robust_misfit: float = constant(
        9.0, '1', 'Squared error over variance at which a node has half of its weight.',
        derived('As `planes.robust_misfit`.'))
    change_limits: tuple = constant(
        ((-2.5, 2.5), (-2.5, 2.5), (-1.5, 0.2)), '1', 'Limits of the logarithms of red against '
        'green, blue against green, and of the share of the color.',
        chosen('A surface that returns less than a twelfth of a channel is no match.'))
    quartile: float = constant(
        0.575, '1', 'First quartile of the misfit of true matches under known noise.',
        derived('Chi-square with two degrees of freedom: 2 ln(4 / 3).'))
    least_scale: float = constant(
        0.2, '1', 'Smallest factor of the variance of the colors.',
        chosen('The pattern has no noise: a good camera gives .25.'))
    least_share: float = constant(
        0.02, '1', 'Share of known nodes in a window from which they tell something.',
        chosen('A few nodes are chance.'))
    unrest_radius: int = constant(
        2, 'thin nodes', 'Radius of the windows over which the error of the colors is averaged.',
        chosen('A surface with print has it everywhere.'))
    unrest_limit: float = constant(
        60.0, '1', 'Largest factor of the variance.', chosen('Beyond, nothing is told.'))


@dataclass(frozen=True)
class SearchTuning(Constants):
    """The coarse search over all disparities."""

    guard_cost: int = constant(
        8000, 'cost of 8 nodes', 'Path cost that loses against any other and leaves room to add.',
        derived('As `coarse.guard_cost`.'))
    lanes: int = constant(
        16, '1', 'Depth of the volumes is a multiple of it.',
        derived('Entries of a vector of int16: loops over them have no remainder.'))
    window_weight: int = constant(
        8, '1', 'Sum of the weights of a window of coarse nodes.',
        derived('1 2 1 across and down, halved.'))
    known_slope: float = constant(
        0.25, 'cost_cap', 'Cost of a known node per disparity away from what stereo knows.',
        chosen('Four steps away cost as much as a color that is quite different.'))
    blur: float = constant(
        1.15, 'px', 'Standard deviation of the mean over a coarse node of 4 px.',
        derived('4 / 12^.5.'))
    detail: float = constant(
        2.0, 'px', 'Least blur of the pattern that is searched, standard deviation, its own px.',
        chosen('The search sees the nearest pixel: its error is an eighth of that blur. With 1 px '
               'the left camera alone loses .1 to .3 points of its ranges.'))
    least_ratio: float = constant(
        0.1, '1', 'Smallest movement of the place per disparity with which the search counts.',
        derived('A projector beside the left camera tells no distance.'))
    spacing: float = constant(
        1.25, 'coarse nodes', 'How far neighbors of the compared disparities move the place.',
        chosen('Colors at places between two of them are close to one of both.'))


@dataclass(frozen=True)
class UseTuning(Constants):
    """When the third view takes part, and where."""

    firm_odds: float = constant(
        2.2, '1', 'Log-odds from which a disparity of the two cameras is known.',
        derived('A probability of .9.'))
    firm_misfit: float = constant(
        9.0, '1', 'Mean misfit of 3 x 3 nodes up to which the third view agrees.',
        chosen('2 on average where a plane is right; 5 % of the right ones exceed 9, beside edges '
               'and on print.'))
    least_agreement: float = constant(
        0.5, '1', 'Share of the known nodes that must agree, or the third view takes no part.',
        chosen('A pattern that is not the one shown agrees nowhere.'))
    least_explained: float = constant(
        0.6, '1', 'Share of the spread of the colors that the pattern must explain.',
        chosen('The right pattern explains .9 and more of gray and colored surfaces, a wrong one '
               'nothing.'))
    known_share: float = constant(
        0.25, '1', 'Share of firm nodes from which a coarse node is not searched.',
        chosen('Six scenes: 1 covers .0007 less, has as many wrong ranges, and takes .5 to 1.7 ms '
               'more; .5 covers as much and takes .2 to .6 ms more (791ce02).'))
    shadow_dim: float = constant(
        2.5, '1', 'Logarithm of how much brighter the surroundings are from which a node lies in '
        'the shadow of the projector.',
        chosen('Ten scenes: 0 to .5 % of the lit nodes are as dark, and half of the unlit ones.'))
    lens_variance: float = constant(
        0.35, 'px^2', 'Variance of the point spread of lens and projector together.',
        derived('.5 px of a good lens, and .4 px of the projector at 1.7 px per pixel.'))
    phase_variance: float = constant(
        0.04, 'px^2', 'Variance of the place of a color in the left image.',
        derived('As `pair.phase_variance`.'))
    misfit_cap: float = constant(
        60.0, '1', 'Largest misfit of one node.', derived('As `neighbors.misfit_cap`.'),
        compiled=True)
    alone_rounds: int = constant(
        2, '1', 'Rounds of search and fit without the right camera.',
        chosen('The first one tells the colors.'))
    variance_cap: float = constant(
        4.0, 'px^2', 'Largest variance that counts as evidence.', derived('Nothing is told.'),
        compiled=True)
    distance_cap: float = constant(
        2.0, 'px', 'Largest distance of a neighbor that counts as evidence.',
        derived('As `trust.distance_cap`.'), compiled=True)
    doubts: tuple = constant(
        DOUBTS['doubts'], '1', 'By how much log-odds are lowered at most where planes of both '
        'agree, where two cameras know the place, and where the planes differ.',
        DOUBTS.provenance('doubts'))
    expected_wrong: tuple = constant(
        DOUBTS['expected_wrong'], '1', 'Share of its ranges that two cameras expect to be wrong, '
        'from their log-odds, from which doubts begin to fade, and from which there is none.',
        DOUBTS.provenance('expected_wrong'))
    sure_odds: float = constant(
        1.0, '1', 'Log-odds above which `kept_certainty` counts.',
        chosen('A probability of .73: what decides whether there is a range stays as it is.'),
        compiled=True)
    kept_certainty: float = constant(
        CERTAINTY['kept_certainty'], '1', 'Factor of log-odds above `sure_odds` of what the third '
        'view measures or confirms, in pairs without doubts.',
        CERTAINTY.provenance('kept_certainty'))
    told_step: int = constant(
        4, 'nodes', 'Distance of the nodes, across and down, whose log-odds tell that share.',
        derived('Some 3000 nodes of a VGA pair: known to a twentieth.'))
    odds_limits: tuple = constant(
        (-8.0, 14.0), '1', 'Limits of the log-odds that are weighed against each other.',
        chosen('Below, a plane is wrong for certain.'))
    agreement: float = constant(
        1.0, 'px', 'Difference of two planes up to which they agree.',
        derived('What is right means.'))
    cell: float = constant(
        1.0, 'nodes', 'Size of the places of the pattern that only one surface can claim.',
        derived('Neighbors on one surface are one node apart.'))
    contest_distance: float = constant(
        2.0, 'px', 'Difference of disparity from which two nodes are different surfaces.',
        chosen('A surface changes by less from node to node.'))
    most_dim: float = constant(
        5.0, '1', 'Largest logarithm of how much brighter the surroundings are.',
        chosen('A hundredth of the light is none.'))
    dim_radius: int = constant(
        6, 'thin nodes', 'Radius of the surroundings with which brightness is compared.',
        chosen('Wider than most shadows.'))
    kept_odds: float = constant(
        0.0, '1', 'Log-odds from which the plane of the two cameras is kept where both agree.',
        chosen('The right camera is nearer to the left one in color than the pattern.'))
    steps: tuple = constant(
        ((), (6,)), 'nodes', 'Distances of the neighbors whose planes are tried, per round.',
        chosen('Six scenes: ((6,), (2,)) covers .0001 more and takes a fifth of the time more; '
               '((6,),) covers .008 less.'))
    settled_misfit: float = constant(
        1.0, '1', 'Mean misfit of the best window around a node up to which no other plane is '
        'tried.',
        chosen('Five scenes: 1 covers .0003 less than 0 and has as many wrong ranges; 2 covers '
               '.0005 less, and .03 % more are wrong.'))
    robust_misfit: float = constant(
        9.0, '1', 'Misfit at which a node has half of its weight (Cauchy).',
        derived('As `planes.robust_misfit`.'))


@dataclass(frozen=True)
class AloneTuning(Constants):
    """Left camera and projector without the right camera."""

    least_share: float = constant(
        0.5, '1', 'Share of the patches that must be found, of what is usual.',
        derived('As `projector.track.least_share`.'))
    farthest: float = constant(
        2.0, 'px', 'Largest distance of patches from their epipolar lines, px of the pattern.',
        chosen('Colors are matched wrongly from a quarter of a structure on.'))
    factor: float = constant(
        2.0, '1', 'How much farther places are moved along the lines than across.',
        chosen('A projector moves in any direction; two deviations.'))


@dataclass(frozen=True)
class OddsTuning(Constants):
    """Log-odds of being right within 1 px; all forms are upper triangular, see `fusion`."""

    form: tuple = constant(
        THIRD['form'], '1', 'Form of one and the evidence of a plane of the third view.',
        THIRD.provenance('form'))
    agree: tuple = constant(
        THIRD['agree'], '1', 'Form of the plane of two cameras where the third view has the same.',
        THIRD.provenance('agree'))
    two_apart: tuple = constant(
        THIRD['two_apart'], '1', 'Form of the plane of two cameras where the third view has '
        'another one.', THIRD.provenance('two_apart'))
    third_apart: tuple = constant(
        THIRD['third_apart'], '1', 'Form of the plane of the third view there.',
        THIRD.provenance('third_apart'))
    firm: tuple = constant(
        THIRD['firm'], '1', 'Form of the plane of two cameras where the third view only bears '
        'witness.', THIRD.provenance('firm'))


@dataclass(frozen=True)
class SpreadTuning(Constants):
    """Standard deviation of a plane of the third view; see `fusion.Fusion.std`."""

    variance_factor: float = constant(
        THIRD['variance_factor'], '1', 'Factor of the variance of the least squares.',
        THIRD.provenance('variance_factor'))
    std_per_distance: float = constant(
        THIRD['std_per_distance'], '1', 'Standard deviation per distance of the neighbors from '
        'the plane.', THIRD.provenance('std_per_distance'))
    geometry_share: float = constant(
        0.0625, '1', 'Share of the variance by the geometry where two cameras see the scene, too.',
        chosen('The covariance allows for slow errors of the depth, which the geometry shares '
               'with the two cameras: errors on nine scenes are below half of it. 1: z68 of .35 '
               'on smooth scenes.'))


@dataclass(frozen=True)
class ThirdTuning(Constants):
    """All groups."""

    sweep: SweepTuning = SweepTuning()
    color: ColorTuning = ColorTuning()
    search: SearchTuning = SearchTuning()
    use: UseTuning = UseTuning()
    alone: AloneTuning = AloneTuning()
    odds: OddsTuning = OddsTuning()
    spread: SpreadTuning = SpreadTuning()


TUNING = ThirdTuning()

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
All constants of the projector's geometry: value, unit, reason and provenance of each.

The scenes and disturbances named here are those of docs/third_view.md.

"""

from dataclasses import dataclass

from ..constants import chosen, constant, Constants, derived, unexplained


@dataclass(frozen=True)
class MatchingTuning(Constants):
    """The matches from nothing: SIFT on two chromaticities."""

    largest_width: int = constant(
        800, 'px', 'Width up to which images are searched as they are; wider ones are reduced.',
        derived('The time of the search stays below 1 s.'))
    dark: float = constant(
        24.0, 'DN', 'Added to the sum of the channels: dark noise has no color.',
        unexplained('As in the search of the rows.'))
    lit: float = constant(
        0.5, '1', 'Share of the mean brightness from which a pixel counts as lit.',
        unexplained('Dark pixels show noise.'))
    every: int = constant(
        7, 'px', 'Lit pixels for each one that is asked for the contrast.', derived('Saves time.'))
    spread: float = constant(
        32.0, '1', 'Standard deviation to which chromaticities are stretched, of 255.',
        chosen('Cameras with crosstalk have a tenth of the contrast.'))
    colorless: float = constant(
        0.01, '1', 'Least standard deviation of a chromaticity that is stretched.',
        derived('Gray cameras show noise of that size.'))
    middle: float = constant(
        128.0, '1', 'Gray value of the mean chromaticity.', derived('The middle of 8 bit.'))
    features: int = constant(
        1200, '1', 'Largest number of features per image and chromaticity.',
        chosen('Some 500 matches; patches make them precise. The pattern keeps all its own.'))
    contrast: float = constant(
        0.02, '1', 'Least contrast of a feature, as OpenCV counts it.',
        chosen('Half of the usual value: a third more matches of images out of focus.'))
    ratio: float = constant(
        0.75, '1', 'Largest ratio of the best to the second best distance (Lowe 2004).',
        unexplained('The usual value; 90 % and more of the matches agree.'))
    tile: int = constant(
        320, 'px', 'Largest width and height of what SIFT sees at once, without the seam.',
        chosen('24 MB of memory instead of 59 at 640 x 480, 28 instead of 91 at 800 x 600.'))
    seam: int = constant(
        96, 'px', 'What SIFT sees of the tiles around; a multiple of `unit`.',
        chosen('Blurred by 0, 12, 16, 20 px a pattern has the features of the whole image to '
               '.05 px but for 0, 2, 2, 6 %; 64: 3 % at 12 px; 32: 16 % at 12 px.'))
    unit: int = constant(
        32, 'px', 'Tiles begin at multiples of it; a power of 2.',
        derived('SIFT halves images by leaving out pixels: octaves of up to 32 px keep the same.'))
    compared: int = constant(
        400, '1', 'Features of an image that are compared with the pattern at once.',
        chosen('8 MB of distances instead of 25; fewer cost time. No result depends on it.'))


@dataclass(frozen=True)
class PriorTuning(Constants):
    """What is known of any projector."""

    field_of_view: float = constant(
        45.0, 'degrees', 'Usual field of view over the width.',
        chosen('Projectors have 25 to 70 degrees; the standard deviation covers them.'))
    focal_std: float = constant(
        0.6, '1', 'Standard deviation of the logarithm of the focal length.',
        derived('A factor of 1.8: 26 to 75 degrees.'))
    square_std: float = constant(
        0.0005, '1', 'Standard deviation of skew and aspect ratio where pixels are square.',
        chosen('Chips are made to a ten-thousandth; the scale of a pattern is exact.'))
    column_std: float = constant(
        0.01, 'widths', 'Standard deviation of the column of the principal point.',
        chosen('Lenses are centered to 1 %; lens shift is vertical; patterns may be cropped.'))
    row_std: float = constant(
        0.5, 'heights', 'Standard deviation of the row of the principal point.',
        derived('Lens shift puts it on the lower edge.'))
    loose_std: float = constant(
        0.3, '1', 'Standard deviation of aspect, skew and column where these are free.',
        derived('A keystone of 20 degrees.'))
    distortion_std: float = constant(
        0.2, '1', 'Standard deviation of k1 where the lens may distort.',
        derived('A quarter of what cheap wide-angle cameras have.'))
    distance_std: float = constant(
        2.0, '1', 'Standard deviation of the distance of the projector from the left camera, in '
        'median depths of the scene.', derived('A projector far behind cameras is unusual.'))
    inflation: float = constant(
        4.0, '1', 'Factor of the covariance of an earlier pair.',
        derived('Twice the standard deviation: errors of one scene are not those of the next.'))
    drift: float = constant(
        0.0003, '1', 'Standard deviation by which a lens changes until it is found again.',
        chosen('A warm projector: .3 px of the pattern.'))
    straight_std: float = constant(
        0.002, '1', 'Standard deviation of k1 where it may not.',
        derived('.1 px at the edge of the pattern.'))


@dataclass(frozen=True)
class StartTuning(Constants):
    """The starts of the adjustment."""

    fields_of_view: tuple = constant(
        (28.0, 45.0, 65.0), 'degrees', 'Fields of view over the width that are tried.',
        derived('The adjustment reaches a factor of 1.5 in focal length.'))
    tries: int = constant(
        60, '1', 'Random samples (RANSAC).',
        derived('Six matches of which .6 are right: .95 to meet them once.'))
    reach: float = constant(
        0.04, 'widths', 'Distance up to which a match agrees with a guessed lens.',
        chosen('What a wrong focal length leaves.'))
    close: float = constant(
        0.005, 'widths', 'Distance up to which a match agrees with a linear fit.',
        chosen('5 px: ten standard deviations of a match.'))
    least: int = constant(
        6, '1', 'Matches of a linear fit.', derived('Eleven unknowns, two equations each.'))
    repeats: int = constant(
        2, '1', 'Linear fits to those that agree.', unexplained('The third changes nothing.'))
    most: int = constant(
        400, '1', 'Matches from which starts are made.', derived('Bounds the time.'))
    seed: int = constant(
        16, '1', 'Of the samples: the same pair gives the same geometry.',
        unexplained('Any number.'))


@dataclass(frozen=True)
class AdjustmentTuning(Constants):
    """The bundle adjustment."""

    rounds: int = constant(
        30, '1', 'Largest number of steps.', unexplained('Ten are usual.'))
    outlier: float = constant(
        2.5, '1', 'Standard deviations at which a match has half of its weight (Cauchy).',
        unexplained('As in the row alignment.'))
    gate: float = constant(
        4.0, '1', 'Standard deviations up to which a match agrees.',
        derived('One of 3000 right matches lies beyond.'))
    damping: float = constant(
        1e-4, '1', 'First damping of the steps (Marquardt 1963).', unexplained('Usual.'))
    largest_damping: float = constant(
        1e6, '1', 'Damping at which no step improves any more.', unexplained('Usual.'))
    least_gain: float = constant(
        0.001, '1', 'Gain of a step below which the fit has settled.',
        derived('Far below one standard deviation.'))
    settled: float = constant(
        0.98, '1', 'Ratio of two scales from which the scale has settled.', unexplained('Usual.'))
    block: int = constant(
        256, '1', 'Rows of a matrix that are multiplied at once.',
        derived('22 x 23 x 256 stays below 262144, from which OpenBLAS starts threads.'))
    nearest: float = constant(
        0.01, 'm', 'Least distance of a point in front of the projector.',
        derived('No projector is used so close.'))
    rounding: float = constant(
        1e-9, '1', 'What is lost by rounding.', derived('Double precision, summed.'))
    behind: float = constant(
        1e4, 'px', 'Residual of a point behind the projector.', derived('An outlier.'))


@dataclass(frozen=True)
class PatchTuning(Constants):
    """Patches of the image that are placed in the pattern."""

    half: int = constant(
        5, 'px', 'Half width of a patch of the image.',
        chosen('11 x 11 px hold several structures of the pattern.'), compiled=True)
    dark: float = constant(
        24.0, 'DN', 'Added to the sum of the channels: dark noise has no color.',
        unexplained('As in the search of the rows.'), compiled=True)
    slow_floor: float = constant(
        0.01, 'px', 'Standard deviation of each slow mode of the disparity, at least.',
        chosen('Path-traced pairs: .002 to .03 px.'))
    slow_share: float = constant(
        0.4, '1', 'The same, share of the median standard deviation of the disparities.',
        chosen('Disturbed pairs: .1 to .7.'))
    degree: int = constant(
        3, '1', 'Highest power of column and row in the slow modes.',
        unexplained('The fifth power changes nothing.'))
    alike: float = constant(
        2.0, '1', 'Factor of the standard deviation of the disparity of a patch.',
        chosen('Disparities of neighboring patches err alike: medians of 32 x 32 px scatter as '
               'much as single pixels.'))
    singular: float = constant(
        1e-4, '1', 'Share of the product of its diagonal from which the determinant of a 2 x 2 '
        'matrix is 0.', derived('Stripes have one direction.'), compiled=True)
    settled: float = constant(
        0.02, 'px', 'Step of a patch from which its place is taken, px of the pattern.',
        derived('A tenth of its error; the next step is much smaller.'), compiled=True)
    least_blur: float = constant(
        0.3, 'px', 'Least blur of the pattern.', derived('Less changes nothing.'))
    bend: float = constant(
        0.4, 'px', 'Largest bend of the disparity over a patch.',
        derived('Moves its border by as much, its middle by nothing.'))
    tilt: float = constant(
        0.8, 'px / px', 'Steepest disparity of a usable surface.',
        unexplained('Steeper ones are seen by a few pixels only.'))
    confidence: float = constant(
        0.9, '1', 'Least confidence of a usable range.', unexplained('The usual limit.'))
    rounds: int = constant(
        6, '1', 'Steps of a patch.', chosen('The seventh moves it by less than .01 px.'))
    farthest: float = constant(
        8.0, 'px', 'Largest way of a patch from its prediction.',
        derived('A structure of the pattern: farther ones are caught by chance.'))
    explained: float = constant(
        0.5, '1', 'Share of the colors of a patch that the pattern must explain.',
        chosen('Chance patches reach .3.'))
    correlated: float = constant(
        3.0, '1', 'Factor of the standard deviation of a patch.',
        chosen('The errors of neighboring pixels are alike after demosaicing, and patches '
               'overlap: the whitened residuals scatter by 1.'))
    floor: float = constant(
        0.03, 'px', 'Least standard deviation of a patch, px of the pattern.',
        chosen('What is left on noise-free pairs.'))
    band: int = constant(
        96, 'px', 'Rows of the pattern that are blurred at once, at least.',
        chosen('More than a usual blur reaches, few enough for a cache. No result depends on it.'))


@dataclass(frozen=True)
class FindTuning(Constants):
    """From matches to the geometry, or to the reason why there is none."""

    least_matches: int = constant(
        24, '1', 'Matches, with depth, that must agree.', chosen('Chance gives fewer than ten.'))
    least_features: int = constant(
        200, '1', 'Features from which an image without matches shows something else.',
        unexplained('Fewer are a dark image, or one out of focus.'))
    brightest: float = constant(
        0.9, '1', 'Share of the values of an image that are darker than `dark` if it is dark.',
        unexplained('A lamp may be seen.'))
    dark: float = constant(
        12.0, 'DN', 'Largest value of a dark image.', chosen('Dark level and noise.'))
    least_share: float = constant(
        0.5, '1', 'Share of the matches with depth that must agree.',
        chosen('Path-traced pairs .93 to 1, two projectors .5.'))
    match_std: float = constant(
        0.6, 'px', 'Standard deviation of one SIFT match, px of the image.',
        chosen('.3 px on sharp images, .7 on blurred ones; the scale does the rest.'))
    depth_step: float = constant(
        2.0, 'px', 'Largest disparity between the pixels around a match.',
        derived('More is an edge.'))
    confidence: float = constant(
        0.5, '1', 'Least confidence of a range at a match.',
        chosen('Also where stereo is poor; wrong ones are outliers.'))
    trial_rounds: int = constant(
        12, '1', 'Steps of the adjustment from each start.', unexplained('Enough to compare.'))
    spacing: int = constant(
        9, 'px', 'Distance of the patches.', derived('They hardly overlap.'))
    most_sites: int = constant(
        4000, '1', 'Largest number of patches, about.', derived('Bounds the time.'))
    blurs: tuple = constant(
        (0.5, 0.8, 1.2, 1.8, 2.7, 4.0, 6.0), 'px', 'Blurs of the image that are tried, standard '
        'deviations; a parabola goes between them.',
        chosen('A patch errs by .1 px under the right blur, by .4 px under one that is .5 px '
               'off.'))
    blur_sites: int = constant(
        150, '1', 'Patches by which the blur is chosen.', unexplained('Bounds the time.'))
    repeats: int = constant(
        2, '1', 'Times that the patches are placed.', chosen('The third changes nothing.'))
    least_patches: int = constant(
        40, '1', 'Patches from which they are used instead of the matches.',
        derived('Seven for each unknown.'))
    gain: float = constant(
        0.03, '1', 'Gain of cost per patch from which a freer lens is believed.',
        chosen('Undisturbed pairs gain up to .01; k1 = .02 gains .2.'))
    least_gain: float = constant(
        15.0, '1', 'Least such gain.', derived('Chance of a millionth.'))
    unmodeled: float = constant(
        1.5, '1', 'Factor of the standard deviations of what was found.',
        chosen('Root mean square of the errors of the center on disturbed pairs, in standard '
               'deviations without it.'))
    column_gain: float = constant(
        2.0, '1', 'Such a gain of a column of the center that is free: the pattern is cropped.',
        derived('Two standard deviations of the prior.'))
    known: float = constant(
        3.0, 'px', 'Largest standard deviation of a prediction at other depths, px of the '
        'pattern.', chosen('The structure of the pattern is nine: dense matching finds it.'))
    beyond: float = constant(
        0.15, '1', 'How far beyond the middle half of the depths predictions must be known.',
        unexplained('Half-occluded surfaces are about there.'))
    chance: float = constant(
        0.02, '1', 'Share of the features of an image that agree by chance.',
        chosen('Other seeds of the pattern: .01.'))
    most: float = constant(
        0.9, '1', 'Share of the points that must lie on a plane to call a scene plane.',
        derived('Some points are wrong.'))
    plane: float = constant(
        1.0, 'px', 'Largest distance of these from the plane, disparity.',
        chosen('Enough relief to tell a projection from a picture.'))
    bright: float = constant(
        0.4, '1', 'Share of the light of the pattern from which a place is lit.',
        unexplained('Other light is seldom as strong as the projector.'))
    beyond_share: float = constant(
        0.2, '1', 'Share of the surface that may be lit beyond the pattern.',
        unexplained('A picture is smaller than the scene.'))
    second_share: float = constant(
        0.2, '1', 'Share of the matches that may form a second image of the pattern unnoticed.',
        unexplained('Fewer do no harm.'))
    second_agree: float = constant(
        0.6, '1', 'Share of those that must agree among themselves.',
        derived('Chance matches do not.'))
    largest_residual: float = constant(
        4.0, 'px', 'Largest median residual, px of the pattern.',
        derived('Half a structure of the pattern.'))


@dataclass(frozen=True)
class TrackTuning(Constants):
    """From pair to pair."""

    spacing: int = constant(
        22, 'px', 'Distance of the patches.', chosen('Some 200 patches at 640 x 480.'))
    most_sites: int = constant(
        150, '1', 'Largest number of patches, about.', derived('Bounds the time to 2 ms.'))
    watched: int = constant(
        45, '1', 'Patches that decide whether all are needed.',
        derived('Their median is known to a fifth of the error of one.'))
    rounds: int = constant(
        3, '1', 'Steps of a patch.', chosen('They begin near their places.'))
    least_patches: int = constant(
        30, '1', 'Patches below which a pair says nothing.', derived('Five for each coordinate.'))
    least_share: float = constant(
        0.5, '1', 'Share of the patches that must be found, of what is usual.',
        chosen('.9 to 1 at rest, .0 to .4 after a jump.'))
    learning: float = constant(
        0.1, '1', 'Weight of a pair in what is usual.', unexplained('Ten pairs.'))
    refresh: int = constant(
        8, 'pairs', 'Pairs after which the model is brought up to date.',
        derived('A warm projector moves by .02 px of the pattern per pair; .2 px is the error of '
                'a patch.'))
    restless: float = constant(
        1.5, '1', 'Median distance of the patches from their predictions from which the model is '
        'brought up to date at once, residuals.',
        derived('At rest the median of 60 patches changes by a tenth: five deviations.'))
    bump: float = constant(
        0.5, 'px', 'Median distance of the patches from their predictions, px of the pattern, '
        'from which the pose is forgotten.', chosen('.05 to .2 at rest beyond the noise.'))
    weights: tuple = constant(
        (0.5, 0.7, 0.9, 0.97), '1', 'Weights of what was known, of which the one that leaves the '
        'least uncertainty is taken.', derived('Covariance intersection (Julier and Uhlmann '
                                               '1997): pairs of one scene err alike.'))
    drift: float = constant(
        0.00002, '1', 'Standard deviation by which the unknowns change from pair to pair; of a '
        'pose in depths of the scene.', chosen('A warm projector: .02 px of the pattern.'))
    largest_wait: int = constant(
        64, 'pairs', 'Largest number of pairs between two searches that find nothing.',
        derived('A search takes as long as 30 pairs.'))


@dataclass(frozen=True)
class ColorTuning(Constants):
    """The map of colors."""

    blur: float = constant(
        1.0, 'px', 'Blur of both images before colors are compared.',
        unexplained('Takes the noise of single pixels.'))
    rounds: int = constant(
        3, '1', 'Fits, each without the outliers of the last.', unexplained('Usual.'))
    outlier: float = constant(
        3.0, '1', 'Median errors from which a color does not count.',
        derived('Colored surfaces have a map of their own.'))


@dataclass(frozen=True)
class Tuning(Constants):
    """All constants of the projector's geometry."""

    matching: MatchingTuning = MatchingTuning()
    prior: PriorTuning = PriorTuning()
    start: StartTuning = StartTuning()
    patches: PatchTuning = PatchTuning()
    find: FindTuning = FindTuning()
    track: TrackTuning = TrackTuning()
    color: ColorTuning = ColorTuning()
    adjustment: AdjustmentTuning = AdjustmentTuning()


TUNING = Tuning()

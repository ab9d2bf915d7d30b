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
All constants of the surface method: value, unit, reason and provenance of each.

`TUNING` is what holds under an aperiodic pattern. `tuning_for` changes it for other patterns.
Constants that say `compiled` are part of the kernels, which bind them at import. The others are
read from the tuning that a `SurfaceMethod` gets. docs/tuning.md lists them all.

Words used here: see `grid_kernels`. DN: one step of an 8-bit channel. *Misfit*: squared difference
of two chromaticities over its variance. A revision such as 53fe5ba is one of this repository.

"""

from dataclasses import dataclass, replace
import math

from .fitted import load_model
from ..constants import (
    Change, changed, chosen, constant, Constants, derived, ROBUST_STD, unexplained)

FIRST = 'The value of the first version (3f22c9b).'
TRUST = load_model('trust')
SLOW = load_model('slow')
SPREAD = load_model('spread')
PERIOD = load_model('period')
STEPS = load_model('steps')
TEMPER = load_model('temper')
QUALITY = load_model('quality')


@dataclass(frozen=True)
class GridTuning(Constants):
    """The half grid and its tiles."""

    pad: int = constant(
        8, 'nodes', 'Unknown nodes around the half grid: kernels may read beyond the image.',
        derived('The margin of a wide window, 7 nodes and 1 more; and a step of 4 nodes plus the '
                'margin of a cost patch, 4 nodes.'), compiled=True)
    tile_rows: int = constant(
        8, 'nodes', 'Rows of a tile: one decision about smoothness holds for a whole tile.',
        chosen('Tiles are small enough for depth edges and large enough for separable sums.'),
        compiled=True)
    tile_columns: int = constant(
        32, 'nodes', 'Columns of a tile.',
        chosen('A whole number of SIMD vectors of 8 or 16 float32 values.'), compiled=True)


@dataclass(frozen=True)
class RawTuning(Constants):
    """Compression and hot pixels."""

    rows: tuple = constant(
        (8, 61), 'px', 'First row and distance of the rows that are looked at.',
        derived('8 rows of an image of 480, even and odd ones.'))
    least_rows: int = constant(
        8, 'px', 'At least so many rows of a small image are looked at for compression.',
        derived('As many as of an image of 480.'))
    least_columns: int = constant(
        64, 'px', 'Width of an image below which nothing is looked for.',
        chosen('Fewer samples show nothing.'))
    least_change: float = constant(
        0.05, 'DN', 'Added to mean changes before their ratio.',
        derived('Far below the change by rounding; an image without colors has a ratio of 1.'))
    pairing: float = constant(
        0.18, '1', 'Log ratio of the changes of chroma on even and on odd columns above which '
        'chroma is subsampled.',
        chosen('Sensor images stay within .02, whatever their mosaic and blur. JPEG 4:2:0 of '
               'quality 30 to 95: .6 to 1.7; YUV 4:2:2: .25.'))
    chance: float = constant(
        4.0, '1', 'Added to twice `pairing`: this over the root of the number of samples.',
        derived('Three deviations of the sum of two log ratios of means of absolute differences, '
                'half correlated.'))
    luma: tuple = constant(
        (0.299, 0.587, 0.114), '1', 'Weights of r, g and b in the luma of JPEG and of video.',
        derived('ITU-R BT.601.'))
    block: int = constant(
        8, 'px', 'Rows and columns of a block of luma.', derived('ITU-T T.81 (JPEG).'))
    block_rows: int = constant(
        5, 'blocks', 'Every so many rows of blocks are transformed to find the quantization.',
        chosen('960 blocks are left at 640 x 480, some .004 s, in compressed pairs only.'))
    frequencies: tuple = constant(
        ((0, 1), (1, 0), (1, 1), (0, 2), (2, 0)), '1', 'Vertical and horizontal frequencies that '
        'are looked at.', chosen('The strongest ones, with the smallest quantization.'))
    largest_quantization: int = constant(
        80, 'DN', 'Largest quantization that is looked for.',
        derived('That of quality 8: 6 times the 11 or 12 of quality 50.'))
    beyond_zero: float = constant(
        0.75, '1', 'Share of the quantization from which a value tells about it.',
        derived('Zero is a multiple of every number.'))
    least_values: int = constant(
        30, '1', 'Values beyond the first multiple below which a quantization is not looked for.',
        chosen('The mean cosine of 30 random phases is .13. Values near one multiple only may be '
               'the tail of any distribution.'))
    periodic: float = constant(
        0.5, '1', 'Mean cosine of the phases from which values are multiples of a number.',
        chosen('Five scenes: JPEG 85, 60 and 40 are found to 1 DN, clean images and JPEG 95 have '
               'none. The best number wins: its divisors fit less well.'))
    quantizations: tuple = constant(
        (1.0, 4.0, 11.0, 19.0, 40.0), 'DN', 'Quantizations of `luma_surroundings`, '
        '`chroma_smoothing` and `discord_distances`.', derived('JPEG 95, 85, 60, 40, 18.'))
    luma_surroundings: tuple = constant(
        (1.5, 2.0, 2.5, 2.5, 2.5), 'px', 'Standard deviation of the surroundings whose brightness '
        'luma '
        'is divided by.',
        chosen('Share of right pixels, casting, 1.5 and 2.5 px: JPEG 95 .921 and .903, JPEG 60 '
               '.836 and .870.'))
    chroma_smoothing: tuple = constant(
        (1.0, 1.5, 2.0, 2.5, 2.5), 'px', 'Standard deviation of the average of what luma does not '
        'tell.',
        chosen('Share of right pixels, effector_bin, 1.2 and 2 px: JPEG 95 .637 and .616, JPEG 60 '
               '.620 and .649.'))
    dark_cell: int = constant(
        8, 'px', 'Width of the cells whose means show the dark level of compressed images.',
        derived('A block of JPEG: its mean keeps most of the precision.'))
    least_light: float = constant(
        48.0, 'DN', 'Sum of the channels from which a node shows the noise of compressed images.',
        chosen('Where it is dark compression removes all noise. A half dark image (effector_bin) '
               'had a noise scale of .1, the smallest one; its lit nodes say 1 to 3.'))
    discord_distances: tuple = constant(
        (0.5, 0.5, 0.5, 0.5, 0.3), 'px^0.5', 'As `trust.discord_distance`, in compressed images.',
        chosen('True planes contradict each other by the noise of compression. .3: casting, JPEG '
               '40 .816 right, now .875; effector_bin, JPEG 95 .763, now .816. Wrong 2.1 -> 3.2 '
               'and 9.3 -> 9.2 %. Below quality 20 matches of chance are common.'))
    std_factors: tuple = constant(
        (1.0, 1.0, 1.05, 1.2, 1.2), '1', 'Factor of the standard deviation in compressed images.',
        chosen('z68 of JPEG 40 without it: effector_bin 1.64, casting 1.18.'))
    trusted_light: tuple = constant(
        (30.0, 150.0), 'DN', 'Sum of the channels from which log-odds of compressed images begin '
        'to count, and from which they count fully.',
        chosen('Log-odds of 3 to 4: .99 right above 60 DN, .9 from 30 to 60 DN, .72 below.'))
    dark_odds: float = constant(
        0.3, '1', 'Factor of the log-odds, as distance from `even_odds`, below the first of them.',
        chosen('Below 30 DN, log-odds of 3.5 and 5 are .72 and .87 right.'))
    even_odds: float = constant(
        0.4, '1', 'Log-odds that this factor leaves as they are.',
        chosen('Those of `matching.min_confidence`: density stays, confidence falls.'))
    added_odds: float = constant(
        0.4, '1', 'Added to the log-odds of compressed images where they count fully.',
        chosen('Log-odds of 0 to 1: .72 right, five scenes at four qualities.'))
    spike: int = constant(
        40, 'DN', 'Height above the pixels around from which a pixel counts as hot.',
        chosen('.03 to .04 % of the values of clean images, .2 to .3 % with 1 % hot pixels.'))
    hot_share: float = constant(
        0.0012, '1', 'Share of such values above which an image is mended.',
        chosen('Between the two.'))
    outlier: int = constant(
        30, 'DN', 'Height above (below) the pixels around from which a value is replaced.',
        chosen('1 % hot pixels, printed: density .960 -> .972 for 20, 30 and 40.'))


@dataclass(frozen=True)
class ViewTuning(Constants):
    """From images to chromaticities and their variance."""

    silent_variance: float = constant(
        4.0, '1', 'Variance of a chromaticity without information: black, overexposed or outside.',
        chosen('Was 1. Polished brass: density .73 -> .83; scenes with dark metal .870 -> .891 at '
               'the same share of wrong ranges (94460d8).'), compiled=True)
    softening: float = constant(
        0.5, 'DN', 'Added to the brightness before division: keeps the chromaticity of black '
        'finite.', chosen('Was 3, which took half of the color of dark metal and none of its '
                          'noise (6389bb1).'))
    noise: tuple = constant(
        (6.0, 0.25, 0.0006), 'DN^2, DN, 1', 'Camera noise: variance of the sum of the channels = '
        'floor + shot s + relative s^2.',
        unexplained('A plausible camera; the scale is measured in each pair. ' + FIRST))
    pixel_variance: float = constant(
        0.75, 'px^2', 'Variance of the point spread of a sum of two pixels behind a mosaic.',
        derived('Linear demosaicing, (1 2 1) / 4, adds 1/2 px^2, a sum of two pixels 1/4 px^2.'))
    least_gain: float = constant(
        0.02, '1', 'Smallest gain of second differences that is worth the time.',
        chosen('Below it, unequal blur is left as it is (66e73be).'))
    largest_gain: float = constant(
        0.25, '1', 'Largest gain of second differences that evens out blur.',
        unexplained('Still tame: larger gains amplify noise (66e73be).'))
    folded_area: float = constant(
        0.1, '1', 'Area ratio below which the distortion model has folded.',
        chosen('Where a lens polynomial turns back, the area of a node falls to 0 (7c1c921).'))
    largest_dark_level: int = constant(
        24, 'DN', 'Largest estimate of the dark level: what is above it is light.',
        unexplained(FIRST))
    dark_level_rank: int = constant(
        200, 'pixels', 'One of so many pixels may be darker than the estimated dark level.',
        unexplained('Half a percent, so that no single pixel decides (df75737).'),
        compiled=True)
    dark_needs_black: bool = constant(
        False, '1', 'The dark level is estimated only where all channels are dark.',
        derived('Under hue_field one channel is dark everywhere.'))
    dark_difference: float = constant(
        2.5, 'DN', 'Difference of the dark levels of both views that is no chance.',
        chosen('Clean pairs stay within 2 DN.'), off=-1.0)
    usual_dark_level: float = constant(
        3.0, 'DN', 'Largest dark level that is assumed where nothing dark is seen.',
        chosen('Cameras are built so that black is just above 0.'))
    balance_blocks: tuple = constant(
        (0, 0), '1', 'Columns and rows of the blocks whose color balance is compared; 0: means of '
        'the images suffice.', derived('Every part of an aperiodic pattern holds all hues.'))
    least_block: float = constant(
        12.0, 'DN', 'Sum of the channels from which the balance of a block counts.',
        derived('As `coarse.full_trust`.'))
    least_blocks: int = constant(
        12, '1', 'Blocks below which nothing is said.', chosen('A scatter needs some.'))
    sure_blocks: float = constant(
        1.0, '1', 'Difference of the balances, as a factor of their spread, from which cameras '
        'differ.', chosen('The two cameras may see different parts of slow colors. Four standard '
                          'errors of a mean, .4 of the spread, took that for gains: sealed pairs '
                          'under one sine were off by 4 px.'))
    block_difference: float = constant(
        0.08, '1', 'Smallest difference of the log balance for gains of their own.',
        chosen('Other contents explain .04. Smaller ones are found from matches.'), off=math.inf)
    sample_step: int = constant(
        5, 'px', 'Largest distance of the pixels that dark level and channel means look at.',
        chosen('Odd, so that all pixels of a mosaic count alike. Of 16 px, the means of a view '
               'with few lit pixels were off by 15 %.'))
    sample_rows: int = constant(
        32, '1', 'Rows and columns that the samples have at least in small images.',
        unexplained('Images below 512 px are sampled more densely (9662ae5).'))
    least_brightness: float = constant(
        1e-3, 'DN', 'Smallest brightness that a variance is divided by.',
        derived('Far below one step of the camera; prevents division by 0.'), compiled=True)
    channel_offset: float = constant(
        0.5, 'DN', 'Added to the mean of a channel before ratios of channels.',
        derived('Half a step of the camera; keeps the ratio of black images finite.'))
    channel_gain_limits: tuple = constant(
        (0.25, 4.0), '1', 'Smallest and largest gain of a channel.',
        unexplained('Bounds how much the noise of a weak channel is amplified. ' + FIRST))
    same_camera_balance: float = constant(
        0.12, '1', 'Difference of the log channel balance of two cameras that share their gains.',
        unexplained('Cameras of one type stay below it under an aperiodic pattern (61b5d22).'))
    unlike_contrast: float = constant(
        2.5, '1', 'Ratio of the contrasts of the colors of both views from which the weaker one '
        'is raised.',
        chosen('Gamma or crosstalk .15 in one camera: 1.4 to 1.9, which the color matrix mends. '
               'Crosstalk .3: 10, and no node matches.'), off=math.inf)
    left_contrast: float = constant(
        2.0, '1', 'Ratio of the contrasts that is left to the color matrix.',
        chosen('1 and 1.5: no ranges on effector_bin, whose dim nodes then drown in noise; '
               'casting and airplane .92 and .97 right with each of them.'))
    faint_contrast: float = constant(
        0.35, '1', 'Contrast of the colors of both views below which it is raised.',
        chosen('Crosstalk .2 in both: .42 to .45, raised right .876 -> .895 and .946 -> .940 '
               '(effector_bin, casting). Crosstalk .25: .26 to .28, .823 -> .870 and .937 -> '
               '.938.'))
    usual_contrast: float = constant(
        1.05, '1', 'Contrast of colors to which it is raised.',
        chosen('That of the default pattern. .6: right .769 -> .784, wrong above confidence .9 '
               '1.7 -> 2.2 % (effector_bin, crosstalk .3 in both).'))
    contrast_step: int = constant(
        4, 'nodes', 'Distance of the nodes that tell the contrast.', derived('5,000 are enough.'))
    contrast_nodes: int = constant(
        150, '1', 'Bright nodes below which the contrast is not known.',
        chosen('A variance of fewer is known to 12 %.'))
    averaging_radius: int = constant(
        0, 'nodes', 'Radius over which colors are averaged; 0: they are not.',
        derived('Steep colors need no average.'))
    averaging_period: int = constant(
        200, 'px', 'Length of a color cycle per node of averaging radius.',
        chosen('One sweep or sine, 640 px wide, right within 1 px, clean and noisier scenes: '
               'radius 2 .873 and .833, 3 .854 and .882, 4 .819 and .892.'))
    largest_averaging_radius: int = constant(
        4, 'nodes', 'Largest radius over which slow colors are averaged.',
        chosen('18 px. The value of the first version for slow patterns (e4ddeb0).'))
    alike_slope: float = constant(
        1.5, '1', 'Largest change per node of colors that are averaged, in median slopes.',
        chosen('1.25: .859 and .874, clean and noisier scenes; 1.5: .854 and .882; 1.75: .847 and '
               '.884. Averages of all colors around: .630 to .794 and .722 to .965.'))
    alike_noise: float = constant(
        1.0, '1', 'The same in standard deviations of the noise of a node, added in squares.',
        chosen('0: where noise is as large as the slope, averages take the colors that its noise '
               'has made alike. A dim plane: median error .51 -> .39 px, z68 2.1 -> 1.4; 2 and 3 '
               'lose depth edges.'))
    averaged_noise: float = constant(
        2.0, '1', 'Factor of the variance of averaged colors for the correlation of neighbors.',
        chosen('The noise of neighbors is correlated: averaging helps half as much as counting '
               'says (e4ddeb0, averages over a box).'))
    least_inside_share: float = constant(
        1e-3, '1', 'Smallest share of nodes inside the image that a mean is divided by.',
        derived('Less than one node of the surroundings; prevents division by 0.'))
    noise_weights: tuple = constant(
        (0.15, 1.0), '1', 'Weight of a node that shows only noise: demosaiced, independent.',
        unexplained('What camera noise adds to squared gradients under both kinds of cameras '
                    '(61b5d22).'))
    noise_steps: tuple = constant(
        (0.85, 0.95), '1', 'Change to the next pixel over change to the next but one: demosaiced '
        'noise below the first, independent noise above the second.',
        chosen('Independent noise has a ratio of 1, linear interpolation lowers it (61b5d22).'))
    least_change: float = constant(
        1e-6, 'DN', 'Smallest change that the other one is divided by.',
        derived('Far below one step of the camera; prevents division by 0.'))
    noise_rows: tuple = constant(
        (8, 32), 'px', 'First row and distance of the rows that this ratio is read from.',
        unexplained('15 rows of an image of 480 (61b5d22).'))


@dataclass(frozen=True)
class CoarseTuning(Constants):
    """The semi-global search (Hirschmueller 2008) on the coarse grid."""

    image_width: float = constant(
        320.0, 'px', 'Width of an image per factor of two between coarse grid and half grid.',
        chosen('4 px per node at 640 columns, 8 px from 1280 columns on (3f22c9b).'))
    color_scale: float = constant(
        64.0, '1', 'Steps of int16 per unit of chromaticity.',
        unexplained('Four path costs of eight capped costs and a penalty fit into int16. '
                    + FIRST))
    full_trust: float = constant(
        12.0, 'DN', 'Sum of the channels from which a color is fully trusted.',
        unexplained(FIRST + ' 6 or 3: brass .005 and .013 less dense.'))
    cost_cap: int = constant(
        160, '1 / color_scale', 'Largest cost of one pair of nodes.', unexplained(FIRST))
    neutral_cost: int = constant(
        70, '1 / color_scale', 'Cost of a dark node, the same at every disparity.',
        chosen('Was 80. Dark nodes cost a little less than chance, so that very dark metal '
               'follows its surroundings (3c5ad7c).'))
    small_step: int = constant(
        60, 'cost of 8 nodes', 'Penalty of a step of one node between neighbors (P1 of '
        'Hirschmueller 2008).', unexplained(FIRST))
    large_step: int = constant(
        600, 'cost of 8 nodes', 'Penalty of a larger step (P2 of Hirschmueller 2008).',
        unexplained(FIRST))
    largest_smoothness: float = constant(
        10.0, '1', 'Largest factor of the penalties.',
        derived('Four path costs of eight capped nodes and one penalty fit into int16 (e6ba5e0).'))
    smoothness: float = constant(
        1.0, '1', 'Factor of the penalties that suits the pattern.',
        derived('The penalties are meant for aperiodic patterns.'))
    texture: float = constant(
        0.35, '1', 'Weight of the brightness of the surface beside color.',
        chosen('Colors tell nearly all under an aperiodic pattern: 0 gives the same density, '
               '.01 % more wrong ranges (docs/evaluation.md).'))
    texture_surroundings: int = constant(
        9, 'coarse nodes', 'Width of the surroundings that brightness is compared with.',
        unexplained('Wider than print, narrower than shading (e4ddeb0).'))
    texture_offset: float = constant(
        12.0, 'DN', 'Added to the brightness before its logarithm: noise of dark places is no '
        'texture.', unexplained('As `full_trust` (e4ddeb0).'))
    largest_texture: float = constant(
        1.0, '1', 'Largest log contrast of texture.',
        unexplained('Bounds what a highlight counts (e4ddeb0).'))
    agreement: int = constant(
        2, 'coarse nodes', 'Largest difference between the matches left to right and right to '
        'left.', chosen('Was 1. On walls at grazing angles several left nodes meet one right node '
                        '(3c5ad7c).'), compiled=True)
    guard_cost: int = constant(
        8000, 'cost of 8 nodes', 'Path cost that loses against any other and leaves room to add.',
        derived('More than 8 cost_cap + 10 large_step, and 4 of it fit into int16.'),
        compiled=True)
    seed_variance: float = constant(
        0.09, 'px^2', 'Variance of a seed that no round has refined.',
        chosen('A standard deviation of .3 px (61b5d22); without rounds the median error is .35 '
               'px (docs/evaluation.md).'))


@dataclass(frozen=True)
class PairTuning(Constants):
    """How the colors of both cameras are compared, and what is measured of a pair for that."""

    phase_variance: float = constant(
        0.04, 'px^2', 'Variance of the place of a color: demosaicing and blur move it.',
        unexplained(FIRST + ' .02: boards 3 % better or worse, held-out scenes on a worse curve.'),
        compiled=True)
    largest_blur_gain: float = constant(
        1 / 3, '1', 'Largest gain of second differences that blur the left view of a plane.',
        derived('This gain makes three nodes their mean.'), compiled=True)
    least_foreshortening: float = constant(
        0.25, 'px per px', 'Smallest width in the right image of 1 px of the left image.',
        chosen('A steeper face is a depth edge. No other value was tried (64053c6).'),
        compiled=True)
    quartile: float = constant(
        0.5754, '1', 'First quartile of the misfit where planes are right.',
        derived('First quartile of chi-square with two degrees of freedom: -2 ln(3/4).'))
    parts: tuple = constant(
        (3, 4), '1', 'Rows and columns of parts of the image whose noise scale is asked for.',
        unexplained('A border of a quarter of the image.'))
    least_part: int = constant(
        20, '1', 'Matches below which a part is not asked.',
        derived('A part of an image of 320 x 240 px has 50, of which some are hidden.'))
    adapt_steps: tuple = constant(
        (8, 4), 'nodes', 'Rows and columns between the nodes that noise and colors are measured '
        'from.', chosen('2400 nodes are left at 640 x 480 (0fbf028).'))
    least_samples: int = constant(
        100, 'nodes', 'Compared nodes below which noise and colors are not measured.',
        unexplained('A quartile of fewer nodes is too uncertain.'))
    scale_limits: tuple = constant(
        (0.1, 100.0), '1', 'Smallest and largest factor of the assumed noise.',
        unexplained('Wide limits, against images without any right plane.'))
    dim_variance: float = constant(
        0.06, '1', 'Variance of a chromaticity from which a node is dim.',
        chosen('Lit surfaces have .002 to .03, a compressed dark background .1 to .3.'))
    bright_share: float = constant(
        0.75, '1', 'Share of nodes that are not dim below which dim ones do not count.',
        derived('The first quartile would be theirs. Uncompressed pairs have .98 and more.'))
    color_prior: float = constant(
        50.0, 'nodes', 'Weight of the prior that both cameras see equal colors: added to the '
        'diagonal of the normal equations.',
        unexplained('Steadies images with little color.'))
    color_matching: bool = constant(
        True, '1', 'Measure the color difference of the cameras from each pair '
        '(`matching.color_matching`).', derived('Steep colors tell color and place apart.'))


@dataclass(frozen=True)
class UnlikeTuning(Constants):
    """By how much the two views differ in blur and color, and when that is evened out."""

    blur: bool = constant(
        True, '1', 'Measure unequal blur (`matching.blur_matching`).',
        derived('The blur of steep colors shows.'))
    color: bool = constant(
        True, '1', 'Measure unequal colors over the image (`matching.color_matching`).',
        derived('Steep colors tell color and place apart.'))
    quiet_scale: float = constant(
        0.35, '1', 'Noise scale (`PairModel.scale`) up to which no difference is looked for.',
        chosen('Clean pairs have .2 to .3; a blur of sigma 2 px has 27, bands of +-20 % have 1.2. '
               'Saves .001 to .002 s.'))
    quiet_part: float = constant(
        1.4, '1', 'The same of the worst part of the image.',
        chosen('Clean pairs of ten scenes have .1 to .55, a glossy sphere 1.2. A right view whose '
               'blur grows to a sigma of 2 px at one border: 1.6 and 3.4 where the whole has .2 '
               'to .35. .8: 20 % more time for the sphere.'))
    steep_slope: float = constant(
        0.3, '1 per node', 'Median slope of the colors along the rows below which small '
        'differences of the cameras are looked for, too.',
        chosen('The default pattern has .38 to .59 on nine scenes, 13 cycles of a sine have .2.'))
    slowest_change: float = constant(
        14.0, '1 per width', 'The same, over `slope_distance` and times the width of the image, '
        'below which colors without detail are averaged, and not evened out: a gain that varies '
        'over the image is then a surface.',
        chosen('One sweep 9 to 12, one sine 7, three sweeps 25 to 33, 16 pale sines 32. One sweep '
               'named unknown, four noisy scenes: right .43 -> .88; clean casting and airplane '
               '.85 -> .85.'), off=0.0)
    slope_distance: int = constant(
        3, 'nodes', 'Distance of the nodes that tell whether colors change slowly.',
        chosen('Noise makes .034 .037 to .041 over one node, .036 over three.'))
    slope_step: int = constant(
        8, 'nodes', 'Distance of the rows that tell the slope.',
        derived('Some 10 000 pairs of nodes.'))
    first_steps: tuple = constant(
        (16, 4), 'nodes', 'Rows and columns between the nodes of the first look.',
        chosen('1200 nodes are left at 640 x 480, .001 s.'))
    next_steps: tuple = constant(
        (8, 4), 'nodes', 'The same of later looks, where the first one has found something.',
        chosen('As `pair.adapt_steps`.'))
    band_steps: tuple = constant(
        (2, 4), 'nodes', 'The same where the gains of rows are measured.',
        derived('Every bin of rows holds samples.'))
    spread_cell: int = constant(
        12, 'nodes', 'Size of the cells whose colors are compared before any match.',
        chosen('24 px: a blur of sigma 3 px takes a tenth of their contrast.'))
    full_cell: float = constant(
        0.9, '1', 'Share of informed nodes from which a cell counts.',
        chosen('Nodes without information have no color.'))
    least_cells: int = constant(
        64, 'cells', 'Cells below which nothing is compared.',
        chosen('Fewer do not show a spread.'))
    least_covariance: float = constant(
        1e-5, '1', 'Added to the variance of the colors of cells.',
        derived('Images without color then differ by nothing.'))
    least_spread: float = constant(
        1.5, '1', 'Ratio of the spread of the colors of both views from which it is evened out.',
        chosen('Other contents change it by a fifth at most.'))
    least_samples: int = constant(
        200, 'nodes', 'Matched nodes below which nothing is measured.',
        chosen('Twelve nodes per coefficient.'))
    least_explained: float = constant(
        0.5, '1', 'Share of the spread of the colors that the matches must explain.',
        chosen('Matches of chance explain nothing; the views are then left as they are.'))
    again_share: float = constant(
        0.1, '1', 'Share of the least differences that count where some were evened out already.',
        chosen('What is measured anyway may be removed well.'))
    robust_std: float = constant(
        ROBUST_STD, '1', 'Standard deviation of a normal distribution over its median absolute '
        'deviation.', derived('1 over the third quartile of the normal distribution.'))
    repeats: int = constant(
        4, '1', 'Looks at the same matches.',
        chosen('A sigma of 3 px is found to .6 px^2 after four, to 3 px^2 after two.'))
    searches: int = constant(
        2, '1', 'Searches after the first one.',
        chosen('The first matches under a sigma of 3 px are rough; the second ones are not.'))
    first_turns: int = constant(
        2, '1', 'Turns of the robust regression in the first look.',
        chosen('Enough to see that nothing differs.'))
    turns: int = constant(
        4, '1', 'The same in later looks.',
        chosen('Fewer leave a part of the blur to the matrix.'))
    robust: float = constant(
        9.0, '1', 'Misfit at which a node has half of its weight (Cauchy).',
        derived('As `planes.robust_misfit`.'))
    place_std: float = constant(
        0.3, 'px', 'Standard deviation of the places of the first matches: a difference along the '
        'gradient of the color counts for less.',
        chosen('Seeds scatter by .35 px, fitted planes by less.'))
    least_scale: float = constant(
        1e-3, '1', 'Smallest scatter of a chromaticity.',
        derived('Below the rounding of 8 bits.'))
    least_share: float = constant(
        0.01, '1', 'Smallest share of a channel.',
        derived('Keeps the logarithm of a dark channel finite.'))
    least_slope: float = constant(
        1e-9, '1 / px', 'Added to a slope that is divided by.', derived('Prevents division by 0.'))
    least_inside: float = constant(
        1e-3, '1', 'Smallest share of the surroundings inside the image that is divided by.',
        derived('As `views.least_inside_share`.'))
    blur_levels: int = constant(
        3, '1', 'Blurred images between which blur over the image is interpolated, less one.',
        chosen('A linear function of the place needs few.'))
    even_blur: float = constant(
        0.15, '1', 'Relative range of the blur below which it counts as even.',
        chosen('Less does not show in the matches.'))
    bell_reach: float = constant(
        3.5, 'sigma', 'Reach of the bell that blurs.',
        derived('Beyond it lies .0005 of the bell.'))
    least_bell: float = constant(
        0.25, 'nodes^2', 'Variance below which three taps take the place of a bell.',
        derived('A sampled bell of less than half a node is too narrow.'))
    blur_step: float = constant(
        0.6, '1', 'Share of the measured blur that one look evens out.',
        chosen('The first matches are rough. Share of right pixels under a sigma of 3 px of the '
               'right (left) view with 1, .6, .5: casting .828 .823 .826 (.816 .822 .822), '
               'effector_bin .756 .754 .752 (.737 .734 .742): no difference that matters.'))
    discord_blurs: tuple = constant(
        (1.0, 4.0), 'px^2', 'Blur that was evened out at which `discord_distances` hold; below '
        'the first one nothing is doubted.',
        chosen('Clean pairs under one or three sweeps stay below .7. 4: a sigma of 2 px.'))
    discord_distances: tuple = constant(
        (0.3, 0.5), 'px^0.5', 'As `trust.discord_distance`.',
        chosen('True planes of blurred colors contradict each other by more. Share of right '
               'pixels with .3 and .5, a sigma of 3 px of the right view: casting .823 and .846, '
               'effector_bin .754 and .781; wrong 3.9 and 4.6, 13.7 and 14.4 %.'))
    lift_per_blur: float = constant(
        0.2, 'px^-2', 'By how much log-odds rise with blur evened out, before they are doubted.',
        chosen('Log-odds of -.5 to .4 are .55 to .67 right at a sigma of 2 px, .47 to .55 at '
               '3 px, four scenes. Density, 2 and 3 px of the right view: casting .913 -> '
               '.933, .875 -> .902; effector_bin .918 -> .938, .875 -> .915.'))
    largest_lift: float = constant(
        0.9, '1', 'Largest such rise.',
        chosen('Nodes of log-odds below -.5 are wrong more often than right.'))
    doubt_per_blur: float = constant(
        0.12, 'px^-2', 'By how much the factor of the log-odds falls with blur evened out.',
        chosen('Log-odds of 3 to 4 are .93 right at a sigma of 2 px of the right view, .88 at 3 '
               'px, four scenes. Was .068: wrong ranges of confidence above .9 at 2 px, casting '
               '.26 -> .19 %, airplane .09 -> .04 %.'))
    std_per_blur: float = constant(
        0.031, 'px^-2', 'By how much the factor of the standard deviation rises with it.',
        chosen('z68 without it, a sigma of 3 px of the right view: casting .95, effector_bin '
               '1.75; 2 px: .80 and 1.41.'))
    least_factor: float = constant(
        0.4, '1', 'Smallest factor of the log-odds, as distance from `even_odds`.',
        chosen('The information of the colors is never gone altogether.'))
    even_odds: float = constant(
        0.4, '1', 'Log-odds that this factor leaves as they are.',
        derived('As `raw.even_odds`.'))
    least_oblique: float = constant(
        0.35, '1', 'Covariance of unequal blur between rows and columns over its variance from '
        'which the blur is oblique.',
        chosen('Lenses out of focus stay below .1; motion along a diagonal has 1.'))
    small_bell: float = constant(
        0.4, 'nodes^2', 'Sum of the variances of the three by three weights of oblique blur.',
        derived('The weight of the node itself stays positive.'))
    common: bool = constant(
        True, '1', 'Doubt pairs that are blurred in both views alike.',
        derived('Aperiodic colors have edges that are as sharp as the views.'), off=False)
    edge_rows: int = constant(
        16, 'px', 'Distance of the rows whose sharpest edges are looked at.',
        chosen('30 rows of an image of 480, .0005 s.'))
    edge_reach: int = constant(
        13, 'px', 'Columns over which the height of an edge is measured.',
        chosen('Edges under a sigma of 3 px are as wide.'))
    least_edge: int = constant(
        40, 'DN', 'Height of an edge above which it counts.', derived('As `raw.spike`.'))
    least_edges: int = constant(
        500, 'px', 'Places on edges below which sharpness is unknown.',
        chosen('The sharpest of them are few.'))
    edge_rank: int = constant(
        200, '1', 'One of so many places on edges is sharper than what counts as the sharpness.',
        chosen('Single pixels do not decide.'))
    sharpnesses: tuple = constant(
        (0.42, 0.7), '1', 'Change over two pixels at the sharpest edges, over their height, at '
        'which `common_blurs` hold.',
        chosen('Five scenes: sharp .85 to .99, projector out of focus .71 to .92, sigma of 1.5 px '
               '.60 to .73, 3 px .40 to .48.'))
    common_blurs: tuple = constant(
        (9.0, 1.0), 'px^2', 'Blur of both views.', derived('A sigma of 3 px; `discord_blurs`.'))
    blur_prior: float = constant(
        9.0, 'px^2', 'Standard deviation of the prior of unequal blur.',
        derived('A sigma of 3 px is plausible.'))
    gain_prior: float = constant(
        0.3, '1', 'Standard deviation of the prior of log gains and of matrix elements.',
        chosen('Lenses and filters of cameras differ by so much.'))
    gamma_prior: float = constant(
        0.5, '1', 'Standard deviation of the prior of an exponent.',
        chosen('One linear camera beside one with the curve of a screen is plausible.'))
    certain: float = constant(
        6.0, '1', 'Standard deviations from which a difference is significant.',
        chosen('Clean pairs stay at 7 for differences that do not matter.'))
    least_blur: float = constant(
        0.5, 'px^2', 'Mean unequal blur below which the views are left as they are.',
        chosen('Clean pairs stay below .3 px^2. Less costs nothing.'))
    large_blur: float = constant(
        3.0, 'px^2', 'Unequal blur from which the search is repeated.',
        chosen('A sigma of 1.5 px costs the search nothing.'))
    curved_share: float = constant(
        0.3, '1', 'Share of the unequal blur that a quadratic polynomial must change.',
        chosen('A right view out of focus in its corners .53 to 1.9, first look of five scenes; '
               'even blur and worn rigs .02 to .51.'))
    certain_curve: float = constant(
        10.0, '1', 'Ratio of a quadratic coefficient to its standard deviation from which it '
        'counts.', chosen('In the same looks 19 to 72, and 2.3 to 6.2. Without it, right views '
                          'blurred by 3 px: right .855 -> .841.'))
    least_variance: float = constant(
        0.05, 'px^2', 'Smallest blur that is worth the time.',
        derived('Far below the 3/4 px^2 that every pixel has.'))
    least_gain: float = constant(
        0.12, '1', 'Mean log gain below which the colors are left as they are.',
        chosen('Aperiodic colors in two dimensions are nearly immune, and `color_matrix` removes '
               'constant gains.'))
    gentle_gain: float = constant(
        0.01, '1', 'The same where the colors change slowly (`steep_slope`).',
        chosen('16 sines: a gain of .025 that stays makes a median error of .1 px, without it '
               '.006 px.'))
    large_gain: float = constant(
        0.15, '1', 'Mean log gain from which the search is repeated.',
        chosen('The search bears less without loss.'))
    large_mix: float = constant(
        0.4, '1', 'The same of the exponent and of the matrix.',
        chosen('Crosstalk of .1 and less costs the search nothing.'))
    least_gamma: float = constant(
        0.1, '1', 'The same of the exponent.', chosen('Clean pairs stay below .05.'))
    least_matrix: float = constant(
        0.1, '1', 'The same of the matrix, which `pair_model.color_matrix` measures, too.',
        chosen('Clean pairs stay below .05.'))
    least_band: float = constant(
        0.02, '1', 'Log gain of rows (standard deviation) that counts as color bands.',
        chosen('Clean pairs stay below .01.'))
    certain_band: float = constant(
        4.0, '1', 'Ratio of the variance of the gains of rows to that of noise that is '
        'significant.', chosen('Clean pairs stay below 2.'))
    least_row_weight: float = constant(
        100.0, '1', 'Weight of a row whose gain is asked.',
        derived('A standard deviation of .1.'))
    band_rows: int = constant(
        4, 'px', 'Raw rows of a bin of color bands.',
        chosen('A band is some tens of rows high.'))
    band_taps: int = constant(
        7, 'bins', 'Length of the window over bins.', derived('Three standard deviations.'))
    band_smoothing: float = constant(
        1.0, 'bins', 'Standard deviation of the window over bins.',
        chosen('Every gain then has hundreds of samples.'))
    band_turns: int = constant(
        3, '1', 'Turns between the bands of both cameras.',
        chosen('Bands of both cameras differ in their phase, and are told apart quickly.'))


@dataclass(frozen=True)
class PlaneTuning(Constants):
    """Planes by least squares."""

    radius: int = constant(
        4, 'nodes', 'Radius of the least-squares window.',
        chosen('9 x 9 nodes. 13 x 13 near depth edges: density +.0005 in ten held-out scenes, '
               '.16 % more wrong.'), compiled=True)
    wide_radius: int = constant(
        7, 'nodes', 'Radius of the window where one surface fills a tile and its surroundings.',
        chosen('White targets: mean error .0035 .. .0068 % instead of .0053 .. .0104 % '
               '(66e73be).'), compiled=True)
    span: int = constant(
        4, 'nodes', 'Distance over which planes are compared: windows round off creases, so '
        'adjacent planes agree.',
        chosen('Was 1: a concave corner had .4 % wrong ranges, now .05 % (a95bad4).'),
        compiled=True)
    least_weight: float = constant(
        1e-2, 'px^-2', 'Weight of a window that is more than rounding.',
        derived('A standard deviation of 10 px: no information about the disparity.'),
        compiled=True)
    least_signal_share: float = constant(
        0.02, '1', 'Share of the weight that is no noise below which a plane has no variance.',
        unexplained('Prevents division by a difference of nearly equal numbers.'),
        compiled=True)
    robust_misfit: float = constant(
        9.0, '1', 'Misfit at which a node has half of its weight (Cauchy).',
        unexplained(FIRST + ' Half of it and 1.5 times as much: other points on the same curve.'))
    ridge: float = constant(
        0.1, 'nodes^2', 'How firmly a slope keeps its last value.',
        chosen('Was .5, which pulled steep walls back to the slopes of their rough seeds '
               '(53fe5ba).'))
    rigid_ridge: float = constant(
        1e6, 'nodes^2', 'The same where slopes are switched off (`matching.slanted`).',
        derived('Far more than the 24 nodes^2 that a wide window has.'))
    steepest: float = constant(
        6.0, 'px per node', 'Largest slope of a plane.', unexplained(FIRST))
    gates: tuple = constant(
        (1.5, 1.5, 0.75), 'px', 'Distance from the plane of the center up to which a node counts, '
        'per round.',
        chosen('First was 3: wrong 1.20 -> .97 % in ten scenes (cd1891c). 2: within .001; 1 in '
               'the second round: .002 to .003 less dense.'))
    smooth_steps: tuple = constant(
        (3.0, 2.5, 1.25), 'px', 'Distance from the plane of a node `span` away up to which a tile '
        'is smooth, per round; the last also holds in the end.',
        chosen('Found with `span` (a95bad4). Larger steps: more wrong for little gain on slopes.'))
    row_stride: int = constant(
        2, 'nodes', 'Distance of the window rows that count in the first round near depth edges.',
        chosen('All rows: at most .001 denser.'))
    full_rounds: int = constant(
        2, 'rounds', 'Rounds that fit all tiles; later ones fit rough tiles only.',
        derived('Colors and noise are known better after the first round.'))
    noise_correlation: float = constant(
        1.0, '1', 'Factor of the variance of planes for noise that averaged colors share.',
        derived('Colors that are not averaged share no noise.'))


@dataclass(frozen=True)
class RowTuning(Constants):
    """How far the rows of the two views disagree, measured at the matches."""

    cell: int = constant(
        8, 'nodes', 'Rows and columns of a cell: one statement about its rows.',
        derived('A window of planes: what these have absorbed is eliminated from a cell.'),
        compiled=True)
    cell_step: int = constant(
        4, 'cells', 'Every so many cells of a line are asked, those of the next line in between.',
        chosen('300 cells are left at 640 x 480: the mean row error is known to .002 px.'),
        compiled=True)
    node_step: int = constant(
        2, 'nodes', 'Distance of the columns that count.',
        chosen('Half of the time for little information: neighbors share their noise.'),
        compiled=True)
    least_slope: float = constant(
        1e-6, 'px^-2', 'Smallest weight of slopes that is divided by.',
        derived('No information about the disparity; prevents division by 0.'), compiled=True)
    rounding: float = constant(
        1 / 32, 'px', 'How far outside the raw image a place still counts as inside.',
        derived('The resolution of the maps of OpenCV, as in `cameras.rectification`.'),
        compiled=True)
    beside: int = constant(
        3, 'nodes', 'Distance of the four nodes whose disparities tell whether a step is near.',
        chosen('Near `planes.radius`: the window of the node reaches over the step. 2: the same '
               'errors of yaw, within .001 degrees.'), compiled=True)
    step: float = constant(
        1.5, 'px', 'Difference of the disparities to one of these that is a step.',
        chosen('A slope of 1 in 4. .7 to 1.5: errors of yaw of effector_bin within .001 degrees.'),
        compiled=True)
    beside_weight: float = constant(
        0.25, '1', 'Factor of the weight of nodes beside a step.',
        chosen('Nodes away from steps scatter half as much. Nine knocks of effector_bin, against '
               '1: depth error 1.19 instead of 1.27 times that of the true calibration, largest '
               '1.43 instead of 1.68; yaw .0087 instead of .0095 degrees, focal ratio .0019 '
               'instead of .0038 %. 1/8 and less: cells are lost.'), compiled=True)
    least_nodes: int = constant(
        16, 'nodes', 'Compared nodes from which a cell says something.',
        derived('Half of the nodes that a cell asks.'))
    least_information: float = constant(
        20.0, 'px^-2', 'Information from which a cell says something about its rows.',
        chosen('Noise alone gives 5 to 15, the default pattern 100 to 400.'))
    margin: int = constant(
        20, 'nodes', 'Rows above and below the image from which rows may be taken.',
        derived('`rows.search.largest_offset`, 32 px, and what roll and scale add.'))


@dataclass(frozen=True)
class BendTuning(Constants):
    """Surfaces that bend within the window of a plane."""

    rounds: int = constant(
        1, 'rounds', 'Corrections of the planes of bent tiles; 0: none.',
        chosen('One takes most of the bias; each costs a fit of the bent tiles.'))
    span: int = constant(
        7, 'nodes', 'Distance of the nodes whose second difference shows a bend.',
        derived('Half of a wide window: windows so far apart share half of their nodes.'),
        compiled=True)
    largest_bend: float = constant(
        3.0, 'px', 'Second difference from which a node lies beside a depth edge.',
        chosen('A bend of twice what still counts as smooth.'), compiled=True)
    least_bend: float = constant(
        0.03, 'px', 'Second difference that is not worth a correction.',
        chosen('A wide window is off by .006 px there, as by rounding of steep colors.'))
    noise_ratio: float = constant(
        12.0, '1', 'Square of a second difference over the variance of planes that noise does not '
        'reach.', derived('Three independent planes have 6 times the variance; twice that.'))
    usual_misfit: float = constant(
        1.1, '1', 'Mean root misfit up to which planes fit.',
        chosen('Clean pairs stay below it, rows that are off by a quarter of a pixel do not.'))
    misfit_gain: float = constant(
        30.0, '1', 'By how much the variance of planes grows with the mean root misfit.',
        chosen('Rows off by .25 to 1 px: errors of 20 to 100 times the variance.'))
    least_share: float = constant(
        0.25, '1', 'Share of bent nodes above which a tile is corrected.',
        chosen('Single nodes are noise; .15: 1 % slower.'))
    row_stride: int = constant(
        2, 'nodes', 'Distance of the window rows that count near depth edges.',
        derived('As `planes.row_stride`: half of the time of windows with a gate.'),
        compiled=True)
    doubt: float = constant(
        0.2, 'px per px', 'Standard deviation per px of the correction: higher orders remain.',
        chosen('Waves, fillets, spheres of the simulator.'))
    misfit_cap: float = constant(
        30.0, '1', 'Largest misfit that counts.', derived('As `trust.misfit_cap`.'),
        compiled=True)


@dataclass(frozen=True)
class QualityTuning(Constants):
    """How well planes fit around a node, and what that says of their variance."""

    step: int = constant(
        6, 'nodes', 'Distance of the nodes at which the fit is looked at.',
        chosen('Their surroundings, 5 x 5 nodes, nearly touch. 4: half a percent slower.'))
    reach: int = constant(
        2, 'nodes', 'Radius of the surroundings whose pulls are summed.',
        chosen('5 x 5 nodes: large enough to show errors that neighbors share, and smaller than '
               'the window that the plane has taken them from.'), compiled=True)
    surroundings: int = constant(
        7, 'samples', 'Width of the surroundings over which samples are averaged.',
        chosen('Some 40 x 40 nodes. 20 x 20 nodes: the deviation scatters more than the errors '
               'do; 60 x 60: no better.'))
    least_share: float = constant(
        0.04, '1', 'Share of known samples below which nothing is said.',
        derived('Two of 7 x 7 samples.'))
    pull_cap: float = constant(
        7.0, '1', 'Largest root pull that counts.',
        chosen('Bounds what a depth edge says of its surroundings.'), compiled=True)
    uneven_cap: float = constant(
        1.5, 'px', 'Largest second difference that counts.',
        chosen('Bounds what a depth edge says of its surroundings.'), compiled=True)
    worst_variance: float = constant(
        4.0, 'px^2', 'Variance from which a plane says nothing.',
        chosen('A standard deviation of 2 px.'), compiled=True)
    pull_gain: float = constant(
        QUALITY['pull_gain'], '1', 'Factor of the variance per squared mean root pull where the '
        'second difference is 1 px; 0: variances stay.',
        QUALITY.provenance('pull_gain'), off=0.0)
    factor_limits: tuple = constant(
        (0.02, 200.0), '1', 'Smallest and largest factor of the variance.',
        chosen('Crosstalk in one camera asks for .06; the largest is far from any pair.'))
    uneven_power: float = constant(
        QUALITY['uneven_power'], '1', 'Power of the mean second difference, px, in that factor.',
        QUALITY.provenance('uneven_power'))
    even: float = constant(
        0.02, 'px', 'Smallest mean second difference that counts.',
        chosen('Noise of large planes; .01 and .05 scatter as much.'))


@dataclass(frozen=True)
class StepTuning(Constants):
    """Doubt about ranges beside steps of the disparity."""

    heights: tuple = constant(
        (1.0, 2.0), 'px', 'Range of the disparity over 5 x 5 nodes from which a node loses '
        'log-odds, and from which it loses all.',
        chosen('Wrong ranges of confidence above .9: medians of 3.2 to 3.8 px, right ones .2 px '
               '(effector_bin, ambient light, blur of both, gray). Log-odds of 2.5 to 3: 10 % '
               'wrong beside steps, 1 % elsewhere.'))
    largest_height: float = constant(
        8.0, 'px', 'Height of a step from which it does not tell how much a pair says.',
        chosen('Nodes at the borders of objects are wrong in any pair.'))
    rough_bends: tuple = constant(
        (0.2, 0.4), 'px', 'Mean second difference around a node from which steps begin to count, '
        'and from which they count fully.',
        chosen('A tilted board has differences without steps. tilt_30, motion of one view, share '
               'of right ranges above .9: 0 without it, .7 with it, .85 without this doubt.'))
    least_odds: float = constant(
        0.4, '1', 'Log-odds of the nodes that tell how much a pair says.',
        derived('Those of `matching.min_confidence`.'))
    usual_odds: tuple = constant(
        (3.4, 4.0), '1', 'Median of the log-odds beside steps up to which all is lost, and from '
        'which nothing.',
        chosen('Clean pairs of six scenes have 4.0 to 7; blur, compression, gray 1.5 to 3.7.'))
    least_samples: int = constant(
        30, '1', 'Samples beside steps below which nothing is doubted.',
        chosen('A median of fewer is chance.'))
    odds: float = constant(
        STEPS['odds'], '1', 'Log-odds that are lost.', STEPS.provenance('odds'), off=0.0)
    kept_odds: float = constant(
        1.9, '1', 'Log-odds that every node keeps: a confidence of .87.',
        derived('Below .9, and above every usual `matching.min_confidence`: no range is lost.'))


@dataclass(frozen=True)
class ContestTuning(Constants):
    """The contest of planes in small windows beside steps of the disparity."""

    reach: int = constant(
        1, 'nodes', 'Radius of the windows that are compared.',
        chosen('2: right .8928 -> .8922, mean of 29 pairs whose brightness counts.'),
        compiled=True)
    cap: float = constant(
        10.0, 'DN', 'Largest difference of a node, per channel.',
        chosen('7 to 20: right within .002, mean of 29 pairs.'), off=0.0)
    largest_gain: float = constant(
        4.0, '1', 'Largest factor between the brightness of both views.',
        unexplained('Beyond it the rounding of 8 bits decides.'))
    margin: float = constant(
        0.2, 'DN', 'By how much another plane must fit better, per node of a window and channel.',
        chosen('0: photographs .8934, simulated .8789, others .9281 right; .2: .8951, .8787, '
               '.9282; 1: .8949, .8757, .9256.'))
    alike: float = constant(
        0.1, 'px', 'Difference of a plane, at a node and per node, up to which it is the same.',
        chosen('Right .8527 with and without it, mean of 14 photographs; a quarter of the time.'),
        compiled=True)
    step: float = constant(
        1.5, 'px', 'Range of the disparity around a node from which it lies beside a step.',
        unexplained('Above the noise of planes, below the steps that matter.'))
    step_reach: int = constant(
        2, 'nodes', 'How far a step is looked for.',
        chosen('4: the same figures, nodes of the contest .61 -> .75; 1: right .0005 less.'))


@dataclass(frozen=True)
class SharedTuning(Constants):
    """Errors of colors that a whole window shares, under colors that change slowly."""

    near_span: int = constant(
        1, 'nodes', 'Half of the short way over which colors are compared.',
        derived('The shortest one.'))
    wide_span: int = constant(
        4, 'nodes', 'Half of the long way.',
        derived('16 px: a period of the usual patterns, over which their colors come back.'))
    steady: float = constant(
        0.8, '1', 'Slope over the long way, as a share of that over the short one, from which '
        'colors change slowly.',
        chosen('One sine and one sweep on four scenes: .85 to 1; hue_field: .40 to .43. Some '
               'repeating patterns exceed it: 16 sines have .7 to .9, patches .6 to 1.1.'))
    least_nodes: int = constant(
        100, 'nodes', 'Lit nodes below which nothing is said.', chosen('A median needs some.'))
    least_slope: float = constant(
        1e-4, '1/px', 'Smallest slope that is divided by.',
        derived('An error of one DN in a hundred then moves 100 px.'))
    least_share: float = constant(
        0.05, '1', 'Smallest known share of a window that is divided by.',
        derived('Four of its nodes.'))
    window: int = constant(
        9, 'nodes', 'Width and height of the window whose errors are averaged.',
        derived('That of the least squares.'))
    surroundings: int = constant(
        31, 'nodes', 'Width and height of the surroundings that share one variance.',
        chosen('A tenth of the image: an error of one sign is one sample.'))
    gain: float = constant(
        1.4, '1', 'Variance of the errors along the slope, per fourth power of the mean root of '
        'those across.',
        chosen('2.2 holds for normal errors without a direction. Those along one sine and one '
               'sweep are .5 to 1.2 times as large as those across, three scenes.'), off=0.0)
    rough: tuple = constant(
        (-0.5, -0.35), 'ln px', 'Median of the logarithm of the second difference of ranges from '
        'which brightness begins to hold nothing, and from which it holds nothing.',
        chosen('Slow colors, detailed brightness, five scenes: bare effector_bin and barrel -.33 '
               'to .16 (.39 to .51 of the ranges right), all others -.57 and less (.77 and more '
               'right).'))
    steepest: float = constant(
        2.0, '1', 'Slope of colors over its median up to which it counts in rough pairs.',
        chosen('effector_bin, one sine and one sweep, bare: wrong of those above .9 without a '
               'limit 30 to 82 %, 3: 9 to 94 %, 2: none is above .9; z68 .8 to 1.0, .8 to .9, '
               '.6 to .8.'))
    capped_odds: tuple = constant(
        ((0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 1.0), (7.06, 4.37, 3.04, 2.25, 1.71, 1.32, 0.77)), '1',
        'Standard deviations, px, and the log-odds that a normal error stays within 1 px.',
        derived('ln(p / (1 - p)) of p = erf(1 / (sqrt(2) std)). Larger deviations take no more: '
                'a range within 1 px is worth giving, with its deviation.'))


@dataclass(frozen=True)
class BrightnessTuning(Constants):
    """Brightness against its surroundings as a third carrier, and the search that it needs."""

    gray_difference: int = constant(
        2, 'DN', 'Largest difference of the channels of a pixel without color.',
        derived('The compression of JPEG leaves 1 or 2 DN in gray images.'))
    gray_share: float = constant(
        0.999, '1', 'Share of lit pixels without color from which an image is gray.',
        unexplained('A few damaged pixels may have a color.'))
    lit: int = constant(
        16, 'DN', 'Brightest channel up to which a pixel says nothing about color.',
        unexplained('As `dark` of core/account.py.'))
    radius: int = constant(
        2, 'nodes', 'Radius of the surroundings that the brightness of a node is compared with.',
        chosen('4: a gray pair .848 instead of .882 right, an unlit one .816 instead of .851; 1: '
               'median errors a quarter larger.'))
    offset: float = constant(
        12.0, 'DN', 'Added to the brightness before its logarithm.',
        unexplained('As `coarse.texture_offset`.'))
    brightness_cap: float = constant(
        12.0, '1', 'Largest misfit of brightness beside that of colors.',
        unexplained('Where brightness lies, it makes a node doubtful, not hopeless.'),
        compiled=True)
    quartile: float = constant(
        0.1015, '1', 'First quartile of the misfit of brightness where planes are right.',
        derived('First quartile of chi-square with one degree of freedom.'))
    surroundings: int = constant(
        41, 'nodes', 'Width of the surroundings that evens out light before the search.',
        chosen('Gloss of 30 % over 100 px: seeds right .53 -> .81; 9 and 21 lose up to .02 of '
               'textured pairs, 41 hardly any.'))
    level: float = constant(
        70.0, 'DN', 'Level of each channel in the images that are searched.',
        unexplained('Three times as bright places are not cut off.'))
    block: int = constant(
        3, 'px', 'Columns, and rows of nodes, of the windows of the search.',
        chosen('5: .01 fewer seeds within 1 px in five textured pairs, at the same time. 1: right '
               '.850 instead of .8585, eight pairs of casting and effector_bin.'))
    compared_window: int = constant(
        11, 'nodes', 'Width and height of the windows that tell which search is right, and '
        'whether views show one scene.',
        chosen('5: chance makes .27 of the windows of gray noise alike, 11: .08. Seeds of 19 '
               'photographs within 1 px: .784 and .786.'))
    least_better: float = constant(
        0.02, '1', 'By how much more alike the matches of one search must be on average, that '
        'the more alike match of each node counts.',
        chosen('Means over nodes of windows of 11: 20 simulated pairs -.004 to .007, where taking '
               'the more alike matches costs .004; 13 of 19 photographs beyond .02, where it '
               'brings .02.'))
    clearly_alike: float = constant(
        0.01, '1', 'By how much more alike a window of the worse search must be.',
        chosen('Repetitions of a pattern are as alike as the match: a plane under 28 sines, seeds '
               'within 1 px .889 with 0, .984; .1: .993, but teeth under sines .785, .770, .762.'))
    least_alike_alone: float = constant(
        0.7, '1', 'How alike windows must be where the plain search alone has a match.',
        chosen('Where no search is better: 0: wrong .045 -> .07 in simulated speckle; real pairs '
               '.002 more right.'))
    alike: float = constant(
        0.7, '1', 'How alike windows are that show the same surface.',
        unexplained('As `least_alike_alone`.'))
    agreeing_share: float = constant(
        0.15, '1', 'Share of nodes with such windows from which both views show one scene, '
        'whatever their rows say.',
        chosen('Photographs .18 to .97; right views of other scenes 0 to .04, of another pattern '
               'on the same one .13. Sines on a teapot: right 0 -> .55, codes on teeth .23 -> '
               '.61.'), off=math.inf)
    penalties: tuple = constant(
        (8, 32), 'per channel and node of a window', 'Penalties of a step of one pixel and of a '
        'larger step (P1, P2 of StereoSGBM).', derived("OpenCV's recommendation."))
    gradient_cap: int = constant(
        31, 'DN', 'Largest gradient that counts (preFilterCap of StereoSGBM).',
        unexplained('Lies between the defaults of the two matchers of OpenCV.'))
    agreement: int = constant(
        1, 'px', 'Largest difference of the matches left to right and right to left.',
        unexplained("As in the evaluation of OpenCV's matchers."))
    many_disparities: int = constant(
        96, 'px', 'Number of disparities above which a small pair tells which of them occur.',
        unexplained('That search takes as long as 16 disparities of the large one.'))
    disparity_step: int = constant(
        16, 'px', 'The number of disparities is a multiple of it.',
        derived("OpenCV's matchers take no other ones."))
    shrinking: int = constant(
        4, 'px', 'Width and height of the pixels of the small pair.',
        unexplained('A search of the small pair takes a 32nd of the time of the large one.'))
    alike_window: int = constant(
        5, 'px', 'Width and height of the windows of the small pair that must be alike.',
        unexplained('Chance rarely makes 25 px alike, and most surfaces are larger.'))
    least_alike: float = constant(
        0.85, '1', 'Normalized cross-correlation of such windows from which a match counts.',
        chosen('Eight pairs of casting whose disparities are -118 .. -62 px: -122 .. -65 px are '
               'left. .7: up to -212 or 41 px in four of them.'))
    least_surface: int = constant(
        12, 'px', 'Size of a surface in the small pair up to which it does not count.',
        chosen('Chance makes smaller ones; 14 x 14 px of the image. 8: disparities up to -212 px '
               'in one of those pairs.'))
    beyond_share: float = constant(
        0.002, '1', 'Share of the matches of the small pair that may lie beyond the disparities '
        'on either side.', chosen('0: disparities up to 47 px in two of those pairs.'))
    disparity_margin: int = constant(
        12, 'px', 'Disparities that are searched beyond those of the small pair.',
        derived('Three columns of the small pair.'))
    detail_radius: int = constant(
        7, 'nodes', 'Radius of the surroundings whose detail is asked for.',
        unexplained('As the wide window of the least squares.'))
    seed_std: float = constant(
        0.15, 'px', 'Standard deviation of what the seeds of a window of `planes.radius` say.',
        chosen('.25: .8687 instead of .8743 right, eight pairs of casting and effector_bin whose '
               'brightness counts; hi .81 instead of .93 %.'))
    faint_seed_std: float = constant(
        0.3, 'px', 'As `seed_std`, where faint colors of the pattern were raised.',
        chosen('.15: right .776 -> .769, wrong above confidence .9 .79 -> .62 %, z68 1.68 -> 1.51 '
               '(effector_bin, crosstalk .3 in both); casting .928 -> .927, .12 -> .08 %, 1.27 -> '
               '1.01.'))
    inertia: float = constant(
        0.5, '1', 'By how much the plane of a neighbor must fit better, see `neighbors.inertia`.',
        chosen('Unlit pair .793 -> .816 right; 1: .01 more right and .01 more wrong.'))
    seed_gate: float = constant(
        1.5, 'px', 'Distance of a seed up to which it holds a plane.',
        unexplained('As `planes.gates`.'))
    disputed_border: float = constant(
        4.0, 'px', 'Distance from the border of the right view up to which a seed replaces '
        'nothing.', derived('The windows of the search reach 2 px; a match moves by some px.'))
    disputed_std: float = constant(
        0.25, 'px', 'Standard deviation of seeds that replace planes.',
        unexplained('Found in whole px, with a fit between them.'))
    informed_likeness: float = constant(
        0.5, '1', 'How alike windows are where a plane is believed that has no information.',
        chosen('Photographs under slow colors, planes beside their seeds: above it .66 to .97 are '
               'right; below .3 on bare metal none.'), off=math.inf)
    uninformed_std: float = constant(
        0.5, 'px', 'Standard deviation of such planes.',
        chosen('Plaster under a sweep, without the likeness: right .639, wrong above confidence '
               '.9 .89 %; .25: .653, 2.95 %. Simulated cameras are as noisy as their model, and '
               'have no such planes.'))
    least_detail: float = constant(
        0.3, '1', 'Detail of a node below which it tells nothing, see `texture.detail`.',
        chosen('Bare surfaces under slow colors: .1; weak print: .9 (medians).'))
    quietest: float = constant(
        0.05, '1', 'Share of the lit nodes with the least detail, which show the noise of a pair.',
        unexplained('A few surfaces without print; fewer are damage, or black.'))
    clear_detail: float = constant(
        2.0, '1', 'Detail of a node, beside that of the quietest, from which it tells something.',
        chosen('First quartile of the nodes: bare surfaces under slow colors, simulated, 1.3 to '
               '1.5; ball, plane and mouse as photographed 1.2 to 1.3; metal and plaster 2.5.'))
    clear_share: float = constant(
        0.75, '1', 'Share of nodes with so much detail from which brightness counts, too.',
        chosen('Half of the nodes of a bare casting have shading, and half have nothing.'),
        off=math.inf)
    possible_share: float = constant(
        0.6, '1', 'As `clear_share`, from which the search for texture is asked whether it finds '
        'more.', chosen('Wood as photographed .68, a bare casting under slow colors .54. Means of '
                        'how alike its matches are, less those of the coarse search: .13; -.08 '
                        'to -.03 on bare surfaces.'), off=math.inf)
    least_noise: float = constant(
        0.007, '1', 'Least detail that the quietest nodes count as.',
        derived('Twice the quantization of the channels: 2 * 3 / 12 DN^2 of 70 DN^2 at 150 DN.'))
    detailed_share: float = constant(
        0.5, '1', 'Share of nodes with so much detail from which brightness counts.',
        unexplained('Half of the nodes.'), off=math.inf)
    least_explained: float = constant(
        0.8, '1', 'As `unlike.least_explained`, where brightness counts and the views fit well.',
        chosen('Colored patterns .91 to .98; gray speckle and faint colors of print .6 to .74: '
               'evening out their noise took half of the ranges.'))
    unlike_scale: float = constant(
        1.0, '1', 'Scale of the variance of colors or brightness above which the views differ.',
        chosen('.1 to .9; one view blurred by 2 px 4.9 in gray speckle and print, 20 in the '
               'default pattern.'))
    agreement_odds: float = constant(
        1.5, '1', 'Added to the log-odds of nodes whose plane the search confirms, and taken from '
        'those where it contradicts; neither where the plane fits better than the seed.',
        chosen('Accepted nodes are right by .98 where it confirms them, by .5 where it does not. '
               'Better planes: final log-odds were too low by -.4 to .6 (simulated), .1 to 2.2 '
               '(photographs).'),
        off=0.0)


@dataclass(frozen=True)
class NeighborTuning(Constants):
    """Nodes near depth edges try the planes of their neighbors."""

    halo: int = constant(
        2, 'nodes', 'Margin of a cost patch.',
        derived('A 3 x 3 mean, then the best of 3 x 3 shifted windows.'), compiled=True)
    patch_margin: int = constant(
        4, 'nodes', 'Columns of a patch beside its tile.',
        derived('At least `halo`, and a whole number of SIMD vectors in all.'), compiled=True)
    steps: tuple = constant(
        ((4, 1), (1,)), 'nodes', 'Distances of the neighbors that are tried, between the rounds.',
        chosen('4, 2 and 1: density +.001 for half of the time of this step again (e6ba5e0).'))
    misfit_cap: float = constant(
        60.0, '1', 'Largest misfit of a node in the cost of a plane: bounds what an outlier '
        'counts.',
        unexplained('Was 30; changed with the ridge (53fe5ba).'))
    neutral_share: float = constant(
        0.5, '1', 'Share of the cap that a node costs where the right image is dark.',
        unexplained(FIRST), compiled=True)
    inertia: float = constant(
        0.0, '1', 'By how much the plane of a neighbor must fit better than the own plane.',
        chosen('Without favor: wrong 1.20 -> .97 % in ten scenes (cd1891c).'))


@dataclass(frozen=True)
class TrustTuning(Constants):
    """Log-odds that a node is right within 1 px, and the reasons to reject it."""

    form: tuple = constant(
        TRUST['form'], '1', 'Quadratic form of one and the evidence, upper triangular.',
        TRUST.provenance('form'))
    hidden_odds: float = constant(
        TRUST['hidden_odds'], '1', 'Added to the log-odds of nodes that the right camera does not '
        'see.', TRUST.provenance('hidden_odds'))
    odds_offset: float = constant(
        0.0, '1', 'Added to the log-odds of all nodes.',
        derived('The form is fitted under an aperiodic pattern.'))
    misfit_cap: float = constant(
        30.0, '1', 'Largest misfit that counts as evidence.', unexplained(FIRST), compiled=True)
    variance_cap: float = constant(
        1.0, 'px^2', 'Largest variance of a plane that counts as evidence.',
        chosen('Planes above `vague_std` get no range anyway.'), compiled=True)
    distance_cap: float = constant(
        2.0, 'px', 'Largest distance of a neighbor from the plane that counts as evidence.',
        unexplained('A depth edge of any height is one edge.'), compiled=True)
    imbalance_cap: float = constant(
        1.0, '1', 'Largest deviation from the usual brightness ratio that counts as evidence.',
        derived('A ratio (l - r) / (l + r) lies within 1.'), compiled=True)
    imbalance_offset: float = constant(
        3.0, 'DN', 'Brightness below which most is noise and scattered light.',
        unexplained('Came with this evidence (a04dcb5).'), compiled=True)
    balance_step: int = constant(
        4, 'nodes', 'Distance of the samples of the usual brightness ratio.',
        chosen('One node in 16 (a04dcb5).'))
    balance_surroundings: int = constant(
        5, 'samples', 'Width of the surroundings whose ratio is the usual one.',
        chosen('Several samples, but hardly more than one surface (a04dcb5).'))
    least_balance_weight: float = constant(
        1e-3, '1', 'Smallest share of samples that a ratio is divided by.',
        derived('Less than one sample; prevents division by 0.'))
    variance_factor: float = constant(
        SPREAD['variance_factor'], '1', 'Factor of the variance of a plane: neighbors share '
        'noise.',
        SPREAD.provenance('variance_factor'), compiled=True)
    std_per_distance: float = constant(
        SPREAD['std_per_distance'], 'px per px', 'Standard deviation per distance of the '
        'neighbors from the plane: there the surface is no plane.',
        SPREAD.provenance('std_per_distance'), compiled=True)
    vague_std: float = constant(
        0.7, 'px', 'Standard deviation from which a plane is too uncertain to publish.',
        chosen('Was .35. Brass target: density .633 -> .691; ten scenes: .9525 -> .9531 '
               '(19b1c73).'))
    unmatched_share: float = constant(
        0.3, '1', 'Share of the misfit cap above which the reason is NO_MATCH.',
        chosen('A misfit of 9, as `planes.robust_misfit`. Only the reason depends on it.'),
        compiled=True)
    unlit: float = constant(
        1.0, 'DN', 'Sum of the channels below which a node gets no range.',
        derived('Less than one step of the camera is no light.'), compiled=True)
    joined_distance: float = constant(
        1.0, 'px', 'Distance from the plane of a neighbor up to which two nodes are joined to one '
        'segment.',
        unexplained(FIRST))
    full_brightness: float = constant(
        48.0, 'DN', 'Sum of the channels from which a node counts fully in a segment.',
        unexplained('What is dark matches by chance in patches (1f97cbd).'))
    full_size: int = constant(
        16, '1', 'What a bright node counts in a segment; a black one counts 1.',
        chosen('Whole numbers leave the sums exact (1f97cbd).'), compiled=True)
    island_odds: float = constant(
        -50.0, '1', 'Log-odds of a node in too small a segment.',
        derived('Below every min_confidence.'), compiled=True)
    unknown_odds: float = constant(
        -100.0, '1', 'Log-odds of a node without disparity.',
        derived('Below `island_odds`.'), compiled=True)
    hopeless_odds: float = constant(
        -200.0, '1', 'Log-odds where no range is possible.',
        derived('Below `unknown_odds`.'), compiled=True)
    odds_limits: tuple = constant(
        (-6.0, 14.0), '1', 'Log-odds of a node where they are interpolated.',
        chosen('14: a probability of 1 - 1e-6. A neighbor lowers the odds by 6 at most '
               '(912678e).'), compiled=True)
    hidden_distance: float = constant(
        1.0, 'px', 'Distance of two surfaces from which one hides the other in the right image.',
        unexplained(FIRST))
    hidden_slope: float = constant(
        0.25, 'px per node', 'By how much this distance grows with that of the two nodes.',
        unexplained(FIRST), compiled=True)
    footprint_limits: tuple = constant(
        (0.5, 4.0), 'px', 'Smallest and largest reach of a node in the right image.',
        unexplained(FIRST), compiled=True)
    discord_distance: float = constant(
        0.45, 'px^0.5', 'Root of the distance of the neighbors above which a node contradicts '
        'them.',
        chosen('.2 px. .3, which is .09 px: full well of 1000 electrons, effector_bin .705 right '
               'instead of .803; gamma of both .881 instead of .918; ambient light of 300 % .722 '
               'instead of .787. Wrong and hi are the same.'))
    discord_variance: float = constant(
        0.25, 'px^2', 'Variance of a plane below which its node may contradict its neighbors.',
        unexplained('.5 px: a vaguer plane contradicts by its noise.'))
    discord_share: float = constant(
        0.65, '1', 'Share of contradicting nodes above which matches are chance.',
        chosen('Some planes of real surfaces contradict their neighbors, too. Density of noise '
               '18-30 % -> below 1 % (9662ae5).'))
    steady_distance: float = constant(
        0.25, 'root px', 'Root of the distance of the neighbors from the plane of a node up to '
        'which the node loses nothing, where a search holds the planes.',
        chosen('Right nodes .12 to .19, wrong ones of confidence above .9 .37 to .47 (medians).'))
    unsteady_odds: float = constant(
        4.3, '1 per root px', 'Log-odds that such a node loses above it.',
        chosen('Logistic regression on 24 pairs of airplane, effector_nut, printed, tilt_30. '
               'Wrong '
               'of those above .9, effector_bin, gray: 11.4 -> 8.6 %.'))
    unsteady_floor: float = constant(
        1.4, '1', 'Log-odds that such a node keeps: a confidence of .8.',
        chosen('Without it .02 fewer right ranges.'))
    tempered_odds: float = constant(
        TEMPER['tempered_odds'], '1', 'Log-odds where the second difference is 1 px and other '
        'evidence says nothing, unless colors are aperiodic.',
        TEMPER.provenance('tempered_odds'))
    tempered_factor: float = constant(
        TEMPER['tempered_factor'], '1', 'Factor of the log-odds of other evidence there.',
        TEMPER.provenance('tempered_factor'))
    rough_odds: float = constant(
        TEMPER['rough_odds'], '1', 'Log-odds that a node loses where the second difference is e '
        'times as large.',
        TEMPER.provenance('rough_odds'))
    kept_odds: float = constant(
        1.0, '1', 'Log-odds that such a node keeps: a confidence of .73.',
        chosen('Without it .01 fewer right ranges; .45: .005, since pixels lie between nodes.'))
    discord_odds: float = constant(
        20.0, '1', 'Log-odds that nodes lose where all around contradict; 0: not asked.',
        chosen('More than any node has (9662ae5).'))
    alike_odds: float = constant(
        1.0, '1', 'Log-odds that nodes keep there whose surroundings are alike in both views.',
        chosen('Of these nodes, photographs of a teapot under six patterns, .6 to .9 are right.'),
        off=math.inf)
    discord_step: int = constant(
        2, 'nodes', 'Distance of the nodes that are asked.',
        chosen('A share needs no more (51e9ae3). 4: as a min_confidence .03 higher.'))
    discord_surroundings: int = constant(
        15, 'samples', 'Width of the surroundings in which they are counted.',
        unexplained('Some 30 x 30 nodes (9662ae5).'))


@dataclass(frozen=True)
class RepetitionTuning(Constants):
    """Doubt about the period of a pattern that repeats."""

    least_gap: float = constant(
        0.0, 'large steps', 'By how much more than the best match a repetition must cost to '
        'be ruled out; 0: the pattern has no repetitions.',
        derived('Aperiodic patterns have no repetitions.'))
    rival_distance: int = constant(
        2, 'coarse nodes', 'Distance up to which a disparity is the same match as the best one.',
        unexplained('What is nearer is the same minimum (2905f1a).'), compiled=True)
    surroundings: int = constant(
        41, 'coarse nodes', 'Width of the surroundings in which clear nodes are counted.',
        chosen('Repetitions are a matter of whole surfaces: textured scenes lose nothing '
               '(ef15cbb).'))
    clear_shares: tuple = constant(
        PERIOD['shares'], '1', 'Shares of clear nodes at which `odds` are given.',
        PERIOD.provenance('shares'))
    odds: tuple = constant(
        PERIOD['odds'], '1', 'Log-odds that the period is right at these shares.',
        PERIOD.provenance('odds'))
    noticed_gap: float = constant(
        2.0, 'large steps', 'As `least_gap`, to notice that colors match at several places.',
        chosen('Default pattern: at most .04 of the nodes; one view blurred by 3 px .11, ambient '
               'light of 300 % .21, rows 5 px off .24. Bare surfaces under repeating patches .42 '
               'to .69, under 16 sines .8.'))
    noticed_cost: float = constant(
        2.5, 'large steps', 'Cost of the best match from which a node has no match at all.',
        unexplained('What lies outside the limits matches by chance, at several places.'))
    noticed_share: float = constant(
        0.18, '1', 'Share of nodes with a rival from which an aperiodic pattern does not show if '
        'the colors are silent, too.',
        chosen('Gray speckle and white dots in place of the default pattern: .17 to .84.'))
    certain_share: float = constant(
        0.3, '1', 'Share of nodes with a rival from which it is not what the images show.',
        chosen('Between these figures.'))
    least_color_detail: float = constant(
        2.3, '1', 'Median of the detail of colors, see `texture.detail`, from which they show.',
        chosen('Default pattern 19 to 42, blurred by 3 px 3.0, in ambient light of 300 % 2.7 and '
               '10; gray speckle .5 to 1.1, white dots 1 to 2.1.'))
    steep_detail: float = constant(
        15.0, '1', 'Median of the detail of colors from which a pattern that nobody has named may '
        'be aperiodic.',
        chosen('Two-dimensional colors as photographed 21 to 125, default pattern 19 to 67. Sines '
               'and stripes whose repetitions lie outside the search 4 to 10.'), off=math.inf)
    unique_share: float = constant(
        0.06, '1', 'Share of nodes with a rival up to which it is.',
        chosen('The same patterns at most .05; stripes .07 and more.'))
    sure_share: float = constant(
        0.4, '1', 'Such a share that unequal blur does not explain.',
        chosen('One view blurred by 3 px: .05 to .24. Repeating colors: mostly .5 to .9.'))
    noticed_step: int = constant(
        2, 'coarse nodes', 'Distance of the nodes that are asked for that.',
        unexplained('A share needs no more.'))
    agreement: float = constant(
        1.0, 'coarse nodes', 'Difference of two searches up to which they agree.',
        unexplained('A period is longer.'))
    agreement_surroundings: int = constant(
        5, 'coarse nodes', 'Width of the surroundings in which agreement is counted.',
        unexplained('Smooths the borders of patches that agree.'))
    anchor_share: float = constant(
        0.002, '1', 'Share of coarse nodes at depth edges around from which they tell the period.',
        unexplained('The edge of one object; a lone bare wall has none.'))
    anchor_surroundings: int = constant(
        121, 'coarse nodes', 'Width of the surroundings in which depth edges are looked for.',
        chosen('Bare wall around a ball: .91 right; 41: .76. A lone wall has no edge anywhere.'))
    agreed_odds: tuple = constant(
        (0.9, 0.9, 1.1, 1.3, 2.0, 3.0, 5.0, 14.0), '1', 'As `odds`, where two searches agree.',
        chosen('Right at these shares on seventeen pairs: .93 .85 .87 .94 .95 .98 1; lower, since '
               'bare walls under 32 periods are right at half of the places.'))
    color_surroundings: int = constant(
        9, 'coarse nodes', 'Width of the surroundings whose colors are asked for the period.',
        chosen('5: a single node decides in part; 21: .06 to .1 where 9 has .03 to .09 at wrong '
               'periods.'))
    firmly_certain: tuple = constant(
        (0.5, 1.0), '1', 'Certainty by two searches from which that begins not to hold, and from '
        'which it does not.',
        chosen('Wrong periods above confidence .9: at most .2; textured pairs 1.'))
    color_gaps: tuple = constant(
        (0.1, 0.14), 'large steps', 'By how much more a repetition costs the colors around, '
        'where log-odds are `color_odds`.',
        chosen('Wrong periods above confidence .9 have .03 to .1, right ones .2 to .3 on bare '
               'surfaces. Wrong above .9, bare patches on airplane and casting: 17.6 -> 0 %, 4.5 '
               '-> 1.0 %; 23 photographs of periodic patterns .88 -> .65 %, right ones above .9 '
               '.57 -> .53.'))
    color_odds: tuple = constant(
        (2.0, 14.0), '1', 'Largest log-odds of the period there, unless searches agree widely.',
        chosen('A confidence of .88, and no limit.'))
    wide_agreement: tuple = constant(
        (0.55, 0.75), '1', 'Shares of agreement among `surroundings` from which the period begins '
        'to be certain, and from which it is.',
        chosen('133 pairs, six scenes: periods slip at .1 to .53 only; others have .63 to .97. '
               'Share of the right ranges above a confidence of .9, effector_bin and airplane: '
               '.56 -> .64, .46 -> .63.'))
    partly_clear: tuple = constant(
        (0.6, 0.8), '1', 'Shares of clear nodes between which that comes to hold.',
        chosen('Under gloss, two searches slip alike on a bare plane: .19 of it would be above a '
               'confidence of .9 with .3 and .6. Textured pairs have .7 and more.'))
    contested_odds: tuple = constant(
        (0.45, 0.45, 0.45, 0.45, 0.45, 0.6, 2.0, 14.0), '1', 'The same where they do not.',
        chosen('Right: .81 .71 .64 .57 .51 .85 on the same pairs.'))
    reasons: tuple = constant(
        ('NO_MATCH', 'INCONSISTENT', 'OUT_OF_RANGE', 'IMPLAUSIBLE'), 'Status', 'Reasons that a '
        'wrong period gives; they become AMBIGUOUS where the period is in doubt.',
        derived('What the tests of a node say about a plane in another place.'))


@dataclass(frozen=True)
class PixelTuning(Constants):
    """From nodes to pixels."""

    own_share: float = constant(
        0.25, '1', 'Share of a node in the log-odds of its pixels; the rest is interpolated.',
        chosen('False ranges .59 -> .56 % at .002 higher density (912678e).'), compiled=True)
    limit_margin: float = constant(
        0.5, 'px', 'By how much a plane may leave the disparity limits where its pixels do not.',
        derived('A pixel lies up to half a px from its node.'))
    least_probability: float = constant(
        1e-6, '1', 'Smallest distance of min_confidence from 0 and 1.',
        derived('Its log-odds are the largest of `trust.odds_limits`.'))


@dataclass(frozen=True)
class Tuning(Constants):
    """All constants of the surface method."""

    grid: GridTuning = GridTuning()
    raw: RawTuning = RawTuning()
    views: ViewTuning = ViewTuning()
    coarse: CoarseTuning = CoarseTuning()
    pair: PairTuning = PairTuning()
    rows: RowTuning = RowTuning()
    unlike: UnlikeTuning = UnlikeTuning()
    planes: PlaneTuning = PlaneTuning()
    bends: BendTuning = BendTuning()
    quality: QualityTuning = QualityTuning()
    steps: StepTuning = StepTuning()
    contest: ContestTuning = ContestTuning()
    shared: SharedTuning = SharedTuning()
    brightness: BrightnessTuning = BrightnessTuning()
    neighbors: NeighborTuning = NeighborTuning()
    trust: TrustTuning = TrustTuning()
    repetition: RepetitionTuning = RepetitionTuning()
    pixels: PixelTuning = PixelTuning()


TUNING = Tuning()  # under an aperiodic pattern

PERIODIC = {  # under a pattern whose parts do not hold all colors alike
    'coarse.texture': Change(2.0, unexplained(
        'Texture tells repetitions apart (e4ddeb0).')),
    'coarse.texture_offset': Change(48.0, unexplained(
        'Under such a weight the noise of dark places must not count (e4ddeb0).')),
    'coarse.smoothness': Change(2.0, unexplained(
        'Neighbors tell repetitions apart (e4ddeb0).')),
    'views.same_camera_balance': Change(math.inf, derived(
        'Both cameras may see different parts of the pattern: the blocks decide.')),
    'views.unlike_contrast': Change(math.inf, derived(
        'Both cameras may see different parts of the pattern.')),
    'views.balance_blocks': Change((12, 9), chosen(
        'A block of 53 px holds whole cycles of most patterns.')),
    'unlike.common': Change(False, derived('Slow colors have no sharp edges.')),
    'unlike.quiet_scale': Change(0.0, derived(
        'Small gains do not show in the scale, but move colors in one dimension.')),
    'unlike.least_gain': Change(TUNING.unlike.gentle_gain, derived(
        'Colors in one dimension: as `unlike.gentle_gain`.')),
    'views.dark_needs_black': Change(True, derived(
        'Channels that are never dark would lose a part of their light.')),
}


def slow(radius):
    """Return the changes under colors that change slowly and are averaged over a radius, nodes."""
    return {
        'views.averaging_radius': Change(radius, derived(
            'One node per `averaging_period` of a color cycle.')),
        'coarse.smoothness': Change(1.0, chosen('Slow patterns have few cycles (e4ddeb0).')),
        'planes.gates': Change((3.0, 1.5, 0.75), chosen(
            'Seeds are rougher. One sine, five scenes: .682 within 1 px, as before the narrower '
            'gates (c1b4124).')),
        'planes.smooth_steps': Change((6.4, 4.8, 2.4), chosen(
            'Noise makes planes rough. First steps of 16, 8, 5.3 and 3 px, one sweep: right .771, '
            '.778, .777 and .767; wrong of the casting 7.3, 4.1, 3.6 and 3.4 %.')),
        'pair.color_matching': Change(False, unexplained(
            'A shift of slow colors looks like a color difference of the cameras.')),
        'unlike.blur': Change(False, derived('Averaged colors do not show blur.')),
        'unlike.color': Change(False, unexplained(
            'A shift of slow colors looks like a color difference of the cameras.')),
        'rows.least_information': Change(math.inf, chosen(
            'Slow colors show no rows: what remains are depth edges, where the views differ.')),
        'planes.noise_correlation': Change(noise_correlation(radius), derived(
            'See `noise_correlation`: of whole windows; where fewer colors are alike it is too '
            'large. z68 of slow patterns .7 to .9 on clean scenes, 1.2 to 1.6 on noisier ones.')),
        'bends.rounds': Change(0, chosen(
            'Averaged colors say too little of the place for second differences.')),
        'quality.pull_gain': Change(0.0, derived(
            'Averaged colors share their noise: pulls of neighbors agree without any error.')),
        'neighbors.inertia': Change(0.5, chosen(
            'Slow colors fit many planes nearly as well. The favor of the first version was kept '
            '(c1b4124).')),
        'trust.odds_offset': Change(SLOW['odds_offset'], SLOW.provenance('odds_offset')),
        'trust.vague_std': Change(1.0, unexplained(
            'Slow colors tell the place less precisely (61b5d22).')),
    }


FITTED = 'planes', 'neighbors', 'trust', 'rows', 'bends', 'quality', 'pair', 'unlike'
"""Groups of constants that fit and judge."""


def detailed_tuning(tuning):
    """
    Return how planes are fitted and judged where a pair shows detail in its brightness.

    Detail then holds the planes, so that slow colors can be compared like others.

    """
    if tuning.views.averaging_radius:
        usual = changed(TUNING, PERIODIC)
        tuning = replace(tuning, **{name: getattr(usual, name) for name in FITTED})
    return replace(tuning, neighbors=replace(tuning.neighbors, inertia=tuning.brightness.inertia))


def slow_tuning(tuning, width):
    """
    Return how slow colors are fitted and judged.

    Under a pattern that is not known to be slow they are those of one cycle. tuning: under the
    pattern. width: of the image, px.

    """
    if tuning.views.averaging_radius:
        return tuning
    return changed(tuning, slow(max(1, averaging_radius(1, width))))


def careful_tuning(detailed):
    """Return a tuning for detail whose colors are changed only if they explain much of it."""
    return replace(detailed, unlike=replace(
        detailed.unlike, least_explained=detailed.brightness.least_explained))


def noise_correlation(radius):
    """
    Return what averaged colors make of the variance of planes that are fitted to them.

    Nodes that are averages over 2 radius + 1 nodes share their noise with their neighbors: a
    window holds fewer independent ones than it has nodes. The factor is that of a mean over the
    wide window, whose noise is white before it is averaged; 1 without averages.

    """
    box, window = 2 * radius + 1, 2 * TUNING.planes.wide_radius + 1
    squares = sum(min(at + 1, box, window, box + window - 1 - at) ** 2
                  for at in range(box + window - 1))
    return (squares / (box * window)) ** 2


def averaging_radius(cycles, width):
    """Return the radius, nodes, over which colors of some cycles per image are averaged."""
    views = TUNING.views
    return min(views.largest_averaging_radius, round(width / cycles / views.averaging_period))


def changes_for(expectation, width):
    """Return what differs from TUNING under a pattern; see `tuning_for`."""
    if expectation.aperiodic:
        return {}
    radius = averaging_radius(expectation.cycles, width)
    changes = dict(PERIODIC)
    if radius:
        changes |= slow(radius)
    if expectation.repeats:
        changes['repetition.least_gap'] = Change(changes['coarse.smoothness'].value, derived(
            'One large step, as `coarse.smoothness` makes it.'))
    return changes


def tuning_for(expectation, width):
    """
    Return the tuning under a pattern.

    Parameters
    ----------
    expectation : Expectation
        What is known of the pattern.
    width : int
        Of the image, px.

    Returns
    -------
    tuning : Tuning

    """
    return changed(TUNING, changes_for(expectation, width))

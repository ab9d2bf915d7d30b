# SPDX-License-Identifier: Apache-2.0
"""
The surface method: coarse to fine, with a slanted plane at every node.

1. Colors: each image is rectified at half resolution (the right one keeps its columns) and
   turned into chromaticity with a variance.
2. Coarse: a semi-global search over all disparities, on a sixteenth of the pixels or fewer.
3. Fine: least squares of a plane at every node, from the gradient of the chromaticity; between
   its rounds, nodes near depth edges try the planes of their neighbors.
4. Honest: what is hidden from the right camera, fits badly or is too uncertain gets no range.

The cost of all but the coarse step does not depend on the number of disparities. Arrays that
live on the half grid carry the frame that `_grid_kernels` describes.

"""

import math

import cv2
import numpy as np

from ..compiled.arena import Arena
from ..compiled.bands import BANDS
from ..patterns.expectation import Prior
from ..patterns.registry import is_aperiodic
from ..results import Measurement
from ..status import Status
from .coarse import CoarseSearch
from .coarse_kernels import seed_planes
from .grid_kernels import F4, PAD, TILE_COLUMNS, TILE_ROWS
from .neighbor_kernels import HALO, propagate
from .pixel_kernels import expand
from .plane_kernels import find_smooth_tiles, fit_planes, linearize, RADIUS, WIDE_RADIUS
from .trust_kernels import brightness_balance, find_hidden, judge, remove_islands, settle
from .view_kernels import add_color_sums
from .views import framed_area, SOFT, View

NOISE_WEIGHTS = 0.15, 1.0  # of a node that shows only noise: demosaiced, independent
INDEPENDENT = 0.85, 0.95   # change to the next pixel / to the next but one: see noise_weight
QUARTILE = 0.5754   # first quartile of chi-square with two degrees of freedom
ROBUST = F4(9.0)    # misfit at which a node counts half
RIDGE = F4(0.1)     # node^2: how firmly a slope keeps its last value
STEEPEST = F4(6.0)  # px per node
GATES = 1.5, 1.5, 0.75   # px from the plane of the center, per round
GATES_SLOW = 3.0, 1.5, 0.75  # likewise under a pattern whose colors change slowly
STEADY = 3.0, 2.5, 1.25  # px from the plane of a node SPAN away, likewise and in the end
STEADY_SLOW = 16.0, 12.0, 6.0  # likewise under such a pattern: creases do not show there
STEPS = (4, 1), (1,)  # nodes, per propagation between the rounds
TRUNCATION = F4(60.0)    # misfit beyond which a node says no more than that it does not fit
INERTIA_SLOW = 0.5  # by how much the plane of a neighbor must fit better under such a pattern
CONTINUOUS = F4(1.0)     # px between neighbors on one surface
BRIGHT = F4(48.0)   # DN of summed channels: of darker nodes more must agree to be no island
SEPARATE = F4(1.0)  # px between two surfaces that claim one place of the right image
COARSE_VARIANCE = F4(0.09)  # px^2, of a seed that nothing has refined
VAGUE = 0.7         # px: standard deviation of a plane that is too uncertain to publish
VAGUE_SLOW = 1.0    # px: likewise under a pattern whose colors change slowly
# Log-odds of being right within 1 px: a quadratic form of one and the evidence that
# `_trust_kernels.judge` lists. Fitted on simulated scenes, see docs/surface_method.md.
MODEL = np.array([
    [12.516, -0.863, -0.749, -16.460, -8.159, -5.095],
    [0, -0.002, -0.044, 0.104, 0.272, 0.545],
    [0, 0, -0.031, 0.661, 0.815, 0.208],
    [0, 0, 0, 10.139, -1.186, 1.850],
    [0, 0, 0, 0, 1.705, 2.141],
    [0, 0, 0, 0, 0, -4.752]], F4)
HIDDEN_ODDS = F4(-4.0)  # more than the fit (-1): there is no cheaper way to fewer false ranges
ODDS_SLOW = F4(-1.0)  # of all nodes under a pattern whose colors change slowly
BALANCE_STEP = 4    # nodes between samples of the brightness that two views of a surface have
BALANCE_SURROUNDINGS = 5, 5  # samples: several, but hardly more than one surface
ADAPT_STEPS = 8, 4  # nodes between samples: thousands are left at 640 x 480
THINNED = 2         # nodes between samples
SURROUNDINGS = 15, 15  # samples: here some planes of real surfaces lie closer to their neighbors
APART = F4(0.3)     # than this (px^0.5); where a larger share than this contradicts them,
DISCORD = F4(0.65)  # matches are chance,
DISCORD_ODDS = F4(20.0)  # and lose up to these log-odds
# Share of clear nodes around a node under a pattern that repeats, and log-odds that its period
# is the right one: measured on simulated scenes under 16 sines, see docs/surface_method.md.
PERIOD_ODDS = ((0.0, 0.1, 0.3, 0.5, 0.7, 0.85, 0.99, 1.0),
               (-0.6, -0.4, 0.4, 1.1, 2.1, 4.2, 5.5, 14.0))
WRONG_PERIOD_REASONS = (Status.NO_MATCH, Status.INCONSISTENT, Status.OUT_OF_RANGE,
                        Status.IMPLAUSIBLE)  # what a wrong period looks like


class SurfaceMethod:
    """
    Measures the pairs of one rig.

    Parameters
    ----------
    settings : Settings
    calibration : StereoCalibration
    limits : (float, float)
        Smallest and largest disparity, px.
    rectified_input : bool
        The images arrive rectified already.

    """

    def __init__(self, settings, calibration, limits, rectified_input=False):
        """Build the maps and allocate all buffers."""
        self.settings = settings
        self.geometry = calibration.geometry
        self.limits = np.array(limits, F4)
        height, width = self.geometry.height, self.geometry.width
        self.nodes = height // 2, width // 2
        shape = tuple(2 * PAD + whole(count, tile) for count, tile in zip(
            self.nodes, (TILE_ROWS, TILE_COLUMNS)))
        rows, columns = self.nodes
        self.inner = framed_area(rows, columns, PAD)
        arena = Arena()
        self.left = View(calibration.left, rows, columns, 2, shape, rectified_input, arena)
        self.right = View(calibration.right, rows, width - 1, 1, (shape[0], width),
                          rectified_input, arena)
        views = self.left, self.right
        known = np.concatenate([view.kernel_variance[np.isfinite(view.kernel_variance)]
                                for view in views])
        variance = np.median(known) if known.size else 0.0
        for view in views:
            view.even_out(variance, arena)
        prior = Prior.of(settings, width)
        # averaged colors change too slowly for their blur to show
        foreshortened = settings.matching.foreshortening and not prior.blur
        self.kernel = F4(variance if foreshortened else 0.0)
        self.blur = prior.blur
        self.vague = F4(VAGUE_SLOW if prior.blur else VAGUE)
        self.gates = np.array(GATES_SLOW if prior.blur else GATES, F4)
        self.steady = np.array(STEADY_SLOW if prior.blur else STEADY, F4)
        self.inertia = F4(INERTIA_SLOW if prior.blur else 0.0)
        self.correlation = F4(correlation(prior.blur))
        self.model = MODEL
        if prior.blur:
            self.model = MODEL.copy()
            self.model[0, 0] += ODDS_SLOW
        self.coarse = CoarseSearch(self.nodes, width, limits, prior, SOFT, arena)
        self.tiles = tiles_of(shape)
        self.planes = [arena.full(shape, value, F4) for value in (np.nan, 0, 0)]
        self.spare = [arena.empty(shape, F4) for _ in self.planes]
        self.copy_planes()
        self.weight, self.moment, self.variance, self.cost = (
            arena.zeros(shape, F4) for _ in range(4))
        self.trust, self.std, self.odds = (arena.zeros(shape, F4) for _ in range(3))
        # seeds that nothing compares count as fitting, as their cost does
        self.misfit = arena.full(shape, np.nan if settings.matching.refinements else 1.0, F4)
        self.evidence = arena.empty((len(MODEL) - 1, *self.nodes), F4)
        samples = (max(1, count // BALANCE_STEP) for count in self.nodes)
        self.balance = arena.zeros((2, *samples), F4)
        self.hidden = arena.zeros(shape, bool)
        self.owners = arena.empty((BANDS, width), np.int32), arena.empty((BANDS, width), F4)
        self.reason = arena.zeros(shape, np.uint8)
        self.segments = arena.empty((4, rows * columns), np.int32)
        self.reference = F4(np.mean(limits))
        self.matrix, self.scale, self.noise_weight = np.eye(2, 3, dtype=F4), F4(1), F4(1)
        if settings.matching.refinements:
            self.color_matrix()  # the black pair that warms the kernels does not come that far

    def measure(self, left, right, clock):
        """
        Measure one pair.

        Parameters
        ----------
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            Raw RGB images.
        clock : Stopwatch
            Told when a stage ends.

        Returns
        -------
        measurement : Measurement

        """
        matching = self.settings.matching
        color = self.settings.color
        levels = [self.left.load(left, color), self.right.load(right, color)]
        if self.same_cameras(levels):
            levels = shared(levels)
        gains = gains_of([mean for _, mean in levels]) if color.equalize else np.ones((2, 3), F4)
        for view, (dark, _), gain in zip((self.left, self.right), levels, gains):
            view.fill(dark, gain, color, self.blur)
        self.noise_weight = F4(noise_weight(left) / (1 + 2 * self.blur) ** 2)
        clock.lap('colors')
        self.seed()
        clock.lap('coarse')
        self.matrix, self.scale = np.eye(2, 3, dtype=F4), F4(1)
        self.cost.fill(1.0)
        self.variance.fill(COARSE_VARIANCE)
        for turn in range(matching.refinements):
            self.refine(turn, clock)
        if self.blur and matching.refinements:
            self.variance *= self.correlation
        self.judge()
        clock.lap('judge')
        return self.expand(clock)

    def refine(self, turn, clock):
        """Do one round: planes from neighbors (not in the first round), then least squares."""
        tiles = self.tiles
        if turn > 0 and self.settings.matching.propagation:
            tiles = self.propagate(STEPS[min(turn, len(STEPS)) - 1])
            clock.lap(f'propagate {turn}')
        # colors and noise are known better after the first round: everything is fitted anew
        fitted = self.tiles if turn < 2 else tiles
        self.linearize(fitted)
        rough = self.fit_planes(fitted, min(turn, len(GATES) - 1), 2 if turn == 0 else 1)
        clock.lap(f'fit {turn + 1}')
        self.linearize(tiles)
        if turn == 0:
            self.adapt()
        clock.lap(f'compare {turn + 1}')
        if turn > 0:
            self.polish(rough)
            clock.lap(f'polish {turn + 1}')

    def same_cameras(self, levels):
        """
        Return whether both cameras get the same gains; levels are those of left and right.

        Every part of an aperiodic pattern holds all hues alike, so that there a difference of
        the channel means is one of the cameras; of other patterns they may see different parts.

        """
        choice = self.settings.color.equalize_cameras
        if choice != 'automatic':
            return choice == 'shared'
        if not is_aperiodic(self.settings.pattern):
            return True
        balance = np.log((levels[0][1] + F4(0.5)) / (levels[1][1] + F4(0.5)))
        return np.ptp(balance) < SAME_BALANCE

    def seed(self):
        """Search all disparities on the coarse grid and give every node a first plane."""
        found = self.coarse.search(self.left, self.right)
        # tiles reach beyond the nodes, and what a fit left there belongs to the last pair
        rows, columns = (PAD + count for count in self.nodes)
        for plane, nothing in zip(self.planes, (np.nan, 0, 0)):
            plane[rows:] = nothing
            plane[:, columns:] = nothing
        # right coarse nodes are averages of columns that lie half a pixel further right
        seed_planes(found, self.coarse.factor, F4(-0.5), *self.nodes, *self.planes)

    def linearize(self, tiles):
        """Compare the nodes of some tiles with the places that their disparities point to."""
        left, right = self.left, self.right
        linearize(left.u, left.v, left.variance, right.u, right.v, right.variance, self.kernel,
                  self.matrix, *self.planes, tiles, ROBUST, self.scale, self.reference,
                  self.weight, self.moment, self.misfit)

    def fit_planes(self, tiles, turn, stride):
        """
        Fit planes to the linearized nodes of some tiles; return those that got no wide windows.

        turn: which of the gates and of `steady` hold; stride: of the window rows near depth edges.

        """
        step = self.steady[turn]
        reach = np.zeros(len(tiles), np.int8)
        smooth = np.flatnonzero(self.smooth(tiles, RADIUS, step))
        reach[smooth] = RADIUS
        if turn > 0:  # planes of seeds are too rough to tell how far a surface goes
            wide = self.smooth(tiles[smooth], WIDE_RADIUS, step)
            reach[smooth[wide]] = WIDE_RADIUS
        self.solve_planes(tiles, reach, self.gates[turn], stride)
        return tiles[reach < WIDE_RADIUS]

    def polish(self, tiles):
        """
        Fit those tiles once more, in wide windows, that only this round has shown to be smooth.

        A single noisy node of the round before keeps a tile and its surroundings from it.

        """
        smooth = tiles[self.smooth(tiles, WIDE_RADIUS)]
        if smooth.size:
            reach = np.full(len(smooth), WIDE_RADIUS, np.int8)  # no window with a gate
            self.solve_planes(smooth, reach, self.gates[-1], 1)

    def solve_planes(self, tiles, reach, gate, stride):
        """Replace the planes of some tiles, see `_plane_kernels.fit_planes`."""
        if len(tiles) < len(self.tiles):
            self.copy_planes()
        ridge = RIDGE if self.settings.matching.slanted else F4(1e6)
        fit_planes(self.weight, self.moment, *self.planes, tiles, reach, gate, stride,
                   self.noise_weight, ridge, STEEPEST, self.reference, *self.spare, self.variance)
        self.planes, self.spare = self.spare, self.planes

    def smooth(self, tiles, halo, step=None):
        """
        Return which tiles, with so many nodes around, one surface fills, bool (N,).

        step: px from the plane of a node SPAN away, as in the end if not given.

        """
        step = self.steady[-1] if step is None else step
        smooth = np.empty(len(tiles), bool)
        find_smooth_tiles(*self.planes, self.left.variance, tiles, halo, step, smooth)
        return smooth

    def copy_planes(self):
        """Make the spare planes equal before a part of them is written."""
        for plane, spare in zip(self.planes, self.spare):
            np.copyto(spare, plane)

    def propagate(self, steps):
        """Let nodes of rough tiles try the planes of their neighbors; return these tiles."""
        tiles = self.tiles[~self.smooth(self.tiles, HALO)]
        self.copy_planes()
        left, right = self.left, self.right
        for turn, step in enumerate(steps):
            # the planes of the first call cost what it found
            propagate(left.u, left.v, left.variance, right.u, right.v, right.variance,
                      self.kernel, self.matrix, self.scale, TRUNCATION, self.inertia,
                      *self.planes, tiles, step, turn > 0, *self.spare, self.cost)
            self.planes, self.spare = self.spare, self.planes
        return tiles

    def adapt(self):
        """Measure from the matches so far how colors and noise of this pair really are."""
        rows, columns = self.nodes
        area = np.s_[PAD + 1:PAD + rows:ADAPT_STEPS[0],
                     PAD + 1:PAD + columns:ADAPT_STEPS[1]]
        misfit = self.misfit[area]
        known = misfit[np.isfinite(misfit)]
        if known.size < 100:
            return
        at = known.size // 4
        self.scale = F4(np.clip(np.partition(known, at)[at] / QUARTILE, 0.1, 100.0))
        if self.settings.matching.color_matching and not self.blur:
            self.matrix = self.color_matrix()

    def color_matrix(self):
        """Return the affine map (2, 3) from right to left chromaticities of matched nodes."""
        # a prior of 100 nodes for equal cameras steadies images with little color
        normal, target = np.diag([50.0, 50.0, 50.0]), 50 * np.eye(3, 2)
        left, right = self.left, self.right
        add_color_sums(left.u, left.v, right.u, right.v, self.planes[0], self.misfit,
                       ROBUST * self.scale, *self.nodes, *ADAPT_STEPS, normal, target)
        # rows in memory as in `measure`: another layout would compile the kernels again
        return np.ascontiguousarray(np.linalg.solve(normal, target).T, F4)

    def judge(self):
        """Find out how far each node can be trusted, and why some cannot."""
        judge(*self.planes, self.cost, self.misfit, self.variance, self.left.s,
              self.right.s, self.usual_balance(), *self.nodes, self.model, self.evidence,
              self.trust)
        if not self.blur:
            self.distrust_discord()
        least_nodes = self.settings.matching.min_segment // 4
        if least_nodes > 1:
            remove_islands(*self.planes, self.trust, self.left.s, BRIGHT, *self.nodes,
                           CONTINUOUS, least_nodes, *self.segments)
        if self.settings.matching.occlusion_test:
            find_hidden(*self.planes[:2], self.trust, *self.nodes, self.geometry.width,
                        SEPARATE, self.hidden, *self.owners)
        color = self.settings.color
        settle(self.planes[0], self.variance, self.evidence, self.cost, self.trust,
               self.hidden, self.left.peak, self.left.s, *self.nodes,
               self.limits + np.array([-0.5, 0.5], F4), F4(color.saturation_level - 1),
               F4(color.min_signal), HIDDEN_ODDS, self.vague, self.std, self.odds,
               self.reason)
        if self.coarse.least_gap > 0:
            self.doubt_repetitions()

    def doubt_repetitions(self):
        """
        Trust no node more than that no repetition of the pattern was taken for its match.

        That is decided for whole surfaces: where a repetition costs about as much at many nodes,
        it may have won at all of them.

        """
        share = cv2.resize(self.coarse.clear_share, self.nodes[::-1],
                           interpolation=cv2.INTER_LINEAR)
        odds = np.interp(share, *PERIOD_ODDS).astype(F4)
        rows, columns = self.inner
        framed = np.s_[rows, columns.start - 1:columns.stop + 1]  # `settle` repeats the borders
        np.minimum(self.odds[framed], np.pad(odds, ((0, 0), (1, 1)), 'edge'),
                   out=self.odds[framed])
        self.explain_repetitions(odds)

    def explain_repetitions(self, odds):
        """Give nodes that have no range because the pattern repeats there that reason."""
        reason = self.reason[self.inner]
        reason[(odds < log_odds(self.settings.matching.min_confidence))
               & np.isin(reason, WRONG_PERIOD_REASONS)] = Status.AMBIGUOUS

    def usual_balance(self):
        """Return the brightness left against right around each node, float32 (rows, columns)."""
        brightness_balance(self.planes[0], self.misfit, self.left.s, self.right.s,
                           BALANCE_STEP, ROBUST, *self.balance)
        balance, weight = (cv2.blur(each, BALANCE_SURROUNDINGS) for each in self.balance)
        return cv2.resize(balance / np.maximum(weight, F4(1e-3)), self.nodes[::-1],
                          interpolation=cv2.INTER_LINEAR)

    def distrust_discord(self):
        """
        Trust nodes less where most planes around them contradict their neighbors.

        Noise, or two images of different things, match by chance here and there; a single such
        node looks as good as a true one, but not its surroundings.

        """
        rows, columns = self.nodes
        thinned = np.s_[::THINNED, ::THINNED]  # a share needs no more samples
        known = (self.variance[self.inner][thinned] < F4(0.25)).view(np.uint8)
        apart = (self.evidence[3][thinned] > APART).view(np.uint8) & known
        # border pixels are repeated, by both counts alike
        counts = [cv2.boxFilter(each, cv2.CV_32F, SURROUNDINGS, normalize=False)
                  for each in (apart, known)]
        share = counts[0] / np.maximum(counts[1], F4(1))
        excess = np.maximum(share - DISCORD, F4(0))
        if excess.any():
            excess = cv2.resize(excess, (columns, rows), interpolation=cv2.INTER_LINEAR)
            cv2.scaleAdd(excess, -float(DISCORD_ODDS / (F4(1) - DISCORD)), self.trust[self.inner],
                         dst=self.trust[self.inner])

    def expand(self, clock):
        """Return the measurement at every pixel."""
        shape = self.geometry.height, self.geometry.width
        disparity, depth, std, confidence = np.empty((4, *shape), F4)
        status = np.empty(shape, np.uint8)
        expand(*self.planes, self.std, self.odds, self.reason, *self.nodes,
               self.limits, F4(self.geometry.focal_baseline),
               F4(self.geometry.principal_offset),
               log_odds(self.settings.matching.min_confidence), disparity, depth, std,
               confidence, status)
        clock.lap('expand')
        return Measurement(disparity=disparity, disparity_std=std, confidence=confidence,
                           status=status, depth=depth)


def correlation(blur):
    """
    Return what averaged colors make of the variance of planes that are fitted to them.

    Nodes that are averages over 2 blur + 1 nodes share their noise with their neighbors: a window
    holds fewer independent ones than it has nodes. The factor is that of a mean over the wide
    window, whose noise is white before it is averaged; 1 without averages.

    """
    box, window = 2 * blur + 1, 2 * WIDE_RADIUS + 1
    shares = np.convolve(np.ones(box), np.ones(window))
    return ((shares ** 2).sum() / (box * window)) ** 2


def noise_weight(image):
    """
    Return the weight that mere noise has at a node of an image, uint8 (H, W, 3).

    The noise of a single-chip camera changes slowly from pixel to pixel, since demosaicing
    interpolates; that of other cameras (and of gray images without any pattern) does not, and
    has steeper gradients.

    """
    rows = image[8::32]
    if rows.shape[0] == 0 or rows.shape[1] < 3:
        return NOISE_WEIGHTS[1]
    near, far = (cv2.norm(rows[:, step:], rows[:, :-step], cv2.NORM_L1) / (rows.shape[1] - step)
                 for step in (1, 2))
    low, high = INDEPENDENT
    share = np.clip((near / max(far, 1e-6) - low) / (high - low), 0, 1)
    return NOISE_WEIGHTS[0] + share * (NOISE_WEIGHTS[1] - NOISE_WEIGHTS[0])


def shared(levels):
    """Give both cameras the same channel means: they may see different parts of the pattern."""
    mean = 0.5 * (levels[0][1] + levels[1][1])
    return [(dark, mean) for dark, _ in levels]


def gains_of(means):
    """
    Return the gains of the channels of both cameras, float32 (2, 3), from their means (DN).

    They make the cameras alike, and the channels half as unequal as they are (of logarithms):
    without that the hues of a weak channel count for little, fully amplified its noise for much.

    """
    means = np.array(means, np.float64) + 0.5
    balance = means / means.mean(axis=1, keepdims=True)
    common = np.sqrt(balance[0] * balance[1])
    return np.clip(np.sqrt(common) / balance, 0.25, 4.0).astype(F4)


SAME_BALANCE = 0.12  # of logarithms: cameras of one type under an aperiodic pattern


def tiles_of(shape):
    """Return the first row and column of every tile of a framed half grid, int32 (N, 2)."""
    rows = np.arange(PAD, shape[0] - PAD, TILE_ROWS)
    columns = np.arange(PAD, shape[1] - PAD, TILE_COLUMNS)
    return np.stack(np.meshgrid(rows, columns, indexing='ij'), axis=-1).reshape(-1, 2).astype(
        np.int32)


def whole(count, step):
    """Return count rounded up to a multiple of step."""
    return -(-count // step) * step


def log_odds(probability):
    """Return the log-odds of a probability 0..1, float32, finite."""
    p = min(max(probability, 1e-6), 1 - 1e-6)
    return F4(math.log(p / (1 - p)))

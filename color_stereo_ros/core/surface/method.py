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
from ..patterns.expectation import Expectation
from ..results import Measurement
from ..status import Status
from .coarse import CoarseSearch
from .coarse_kernels import seed_planes
from .grid_kernels import F4, PAD, TILE_COLUMNS, TILE_ROWS
from .neighbor_kernels import HALO, propagate
from .pixel_kernels import expand
from .plane_kernels import find_smooth_tiles, fit_planes, linearize, RADIUS, WIDE_RADIUS
from .trust_kernels import brightness_balance, find_hidden, judge, remove_islands, settle
from .tuning import tuning_for
from .view_kernels import add_color_sums
from .views import framed_area, View


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
    tuning : Tuning or None
        None: that which suits the pattern.

    """

    def __init__(self, settings, calibration, limits, rectified_input=False, tuning=None):
        """Build the maps and allocate all buffers."""
        self.settings = settings
        self.geometry = calibration.geometry
        if tuning is None:
            tuning = tuning_for(Expectation.of(settings.pattern), self.geometry.width)
        self.tuning = tuning
        self.load_constants(tuning)
        self.limits = np.array(limits, F4)
        height, width = self.geometry.height, self.geometry.width
        self.nodes = height // 2, width // 2
        shape = tuple(2 * PAD + whole(count, tile) for count, tile in zip(
            self.nodes, (TILE_ROWS, TILE_COLUMNS)))
        rows, columns = self.nodes
        self.inner = framed_area(rows, columns, PAD)
        arena = Arena()
        self.left = View(calibration.left, rows, columns, 2, shape, rectified_input,
                         tuning.views, arena)
        self.right = View(calibration.right, rows, width - 1, 1, (shape[0], width),
                          rectified_input, tuning.views, arena)
        views = self.left, self.right
        known = np.concatenate([view.kernel_variance[np.isfinite(view.kernel_variance)]
                                for view in views])
        variance = np.median(known) if known.size else 0.0
        for view in views:
            view.even_out(variance, arena)
        foreshortened = settings.matching.foreshortening and tuning.planes.foreshortening
        self.kernel = F4(variance if foreshortened else 0.0)
        self.coarse = CoarseSearch(self.nodes, width, limits, settings.matching, tuning, arena)
        self.tiles = tiles_of(shape)
        self.planes = [arena.full(shape, value, F4) for value in (np.nan, 0, 0)]
        self.spare = [arena.empty(shape, F4) for _ in self.planes]
        self.copy_planes()
        self.weight, self.moment, self.variance, self.cost = (
            arena.zeros(shape, F4) for _ in range(4))
        self.trust, self.std, self.odds = (arena.zeros(shape, F4) for _ in range(3))
        # seeds that nothing compares count as fitting, as their cost does
        self.misfit = arena.full(shape, np.nan if settings.matching.refinements else 1.0, F4)
        self.evidence = arena.empty((len(self.model) - 1, *self.nodes), F4)
        samples = (max(1, count // tuning.trust.balance_step) for count in self.nodes)
        self.balance = arena.zeros((2, *samples), F4)
        self.hidden = arena.zeros(shape, bool)
        self.owners = arena.empty((BANDS, width), np.int32), arena.empty((BANDS, width), F4)
        self.reason = arena.zeros(shape, np.uint8)
        self.segments = arena.empty((4, rows * columns), np.int32)
        self.reference = F4(np.mean(limits))
        self.matrix, self.scale, self.noise_weight = np.eye(2, 3, dtype=F4), F4(1), F4(1)
        if settings.matching.refinements:
            self.color_matrix()  # the black pair that warms the kernels does not come that far

    def load_constants(self, tuning):
        """Keep the constants that the kernels get as arguments in their types."""
        planes, trust = tuning.planes, tuning.trust
        self.robust, self.steepest = F4(planes.robust_misfit), F4(planes.steepest)
        self.ridge = F4(planes.ridge if self.settings.matching.slanted else planes.rigid_ridge)
        self.gates = np.array(planes.gates, F4)
        self.steady = np.array(planes.steadiness, F4)
        self.truncation = F4(tuning.neighbors.misfit_cap)
        self.inertia = F4(tuning.neighbors.inertia)
        self.model = np.array(trust.form, F4)
        self.model[0, 0] += F4(trust.odds_offset)
        self.vague = F4(trust.vague_std)
        self.hidden_odds = F4(trust.hidden_odds)
        self.least_odds = log_odds(self.settings.matching.min_confidence,
                                   tuning.pixels.least_probability)

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
        gains = np.ones((2, 3), F4)
        if color.equalize:
            gains = gains_of([mean for _, mean in levels], self.tuning.views)
        for view, (dark, _), gain in zip((self.left, self.right), levels, gains):
            view.fill(dark, gain, color)
        averaged = (1 + 2 * self.tuning.views.averaging_radius) ** 2
        self.noise_weight = F4(noise_weight(left, self.tuning.views) / averaged)
        clock.lap('colors')
        self.seed()
        clock.lap('coarse')
        self.matrix, self.scale = np.eye(2, 3, dtype=F4), F4(1)
        self.cost.fill(1.0)
        self.variance.fill(F4(self.tuning.coarse.seed_variance))
        for turn in range(matching.refinements):
            self.refine(turn, clock)
        if self.tuning.planes.noise_correlation != 1 and matching.refinements:
            self.variance *= F4(self.tuning.planes.noise_correlation)
        self.judge()
        clock.lap('judge')
        return self.expand(clock)

    def refine(self, turn, clock):
        """Do one round: planes from neighbors (not in the first round), then least squares."""
        planes, tiles = self.tuning.planes, self.tiles
        if turn > 0 and self.settings.matching.propagation:
            steps = self.tuning.neighbors.steps
            tiles = self.propagate(steps[min(turn, len(steps)) - 1])
            clock.lap(f'propagate {turn}')
        # colors and noise are known better after the first round: everything is fitted anew
        fitted = self.tiles if turn < planes.full_rounds else tiles
        self.linearize(fitted)
        rough = self.fit_planes(fitted, min(turn, len(self.gates) - 1),
                                planes.row_stride if turn == 0 else 1)
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
        the channel means is one of the cameras; of other patterns they may see different parts,
        and `same_camera_balance` is infinite.

        """
        choice = self.settings.color.equalize_cameras
        if choice != 'automatic':
            return choice == 'shared'
        offset = F4(self.tuning.views.channel_offset)
        balance = np.log((levels[0][1] + offset) / (levels[1][1] + offset))
        return np.ptp(balance) < self.tuning.views.same_camera_balance

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
                  self.matrix, *self.planes, tiles, self.robust, self.scale, self.reference,
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
        fit_planes(self.weight, self.moment, *self.planes, tiles, reach, gate, stride,
                   self.noise_weight, self.ridge, self.steepest, self.reference, *self.spare,
                   self.variance)
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
                      self.kernel, self.matrix, self.scale, self.truncation, self.inertia,
                      *self.planes, tiles, step, turn > 0, *self.spare, self.cost)
            self.planes, self.spare = self.spare, self.planes
        return tiles

    def adapt(self):
        """Measure from the matches so far how colors and noise of this pair really are."""
        tuning = self.tuning.planes
        steps = (slice(PAD + 1, PAD + count, step)
                 for count, step in zip(self.nodes, tuning.adapt_steps))
        misfit = self.misfit[tuple(steps)]
        known = misfit[np.isfinite(misfit)]
        if known.size < tuning.least_samples:
            return
        at = known.size // 4
        self.scale = F4(np.clip(np.partition(known, at)[at] / tuning.quartile,
                                *tuning.scale_limits))
        if self.settings.matching.color_matching and tuning.color_matching:
            self.matrix = self.color_matrix()

    def color_matrix(self):
        """Return the affine map (2, 3) from right to left chromaticities of matched nodes."""
        # a prior for equal cameras steadies images with little color
        prior = self.tuning.planes.color_prior
        normal, target = np.diag([prior, prior, prior]), prior * np.eye(3, 2)
        left, right = self.left, self.right
        add_color_sums(left.u, left.v, right.u, right.v, self.planes[0], self.misfit,
                       self.robust * self.scale, *self.nodes, *self.tuning.planes.adapt_steps,
                       normal, target)
        # rows in memory as in `measure`: another layout would compile the kernels again
        return np.ascontiguousarray(np.linalg.solve(normal, target).T, F4)

    def judge(self):
        """Find out how far each node can be trusted, and why some cannot."""
        judge(*self.planes, self.cost, self.misfit, self.variance, self.left.s,
              self.right.s, self.usual_balance(), *self.nodes, self.model, self.evidence,
              self.trust)
        trust = self.tuning.trust
        if trust.discord_odds:
            self.distrust_discord()
        least_nodes = self.settings.matching.min_segment // 4
        if least_nodes > 1:
            remove_islands(*self.planes, self.trust, self.left.s, F4(trust.bright), *self.nodes,
                           F4(trust.continuous), least_nodes, *self.segments)
        if self.settings.matching.occlusion_test:
            find_hidden(*self.planes[:2], self.trust, *self.nodes, self.geometry.width,
                        F4(trust.separate), self.hidden, *self.owners)
        color, margin = self.settings.color, self.tuning.pixels.limit_margin
        settle(self.planes[0], self.variance, self.evidence, self.cost, self.trust,
               self.hidden, self.left.peak, self.left.s, *self.nodes,
               self.limits + np.array([-margin, margin], F4), F4(color.saturation_level - 1),
               F4(color.min_signal), self.hidden_odds, self.vague, self.std, self.odds,
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
        repetition = self.tuning.repetition
        odds = np.interp(share, repetition.clear_shares, repetition.odds).astype(F4)
        rows, columns = self.inner
        framed = np.s_[rows, columns.start - 1:columns.stop + 1]  # `settle` repeats the borders
        np.minimum(self.odds[framed], np.pad(odds, ((0, 0), (1, 1)), 'edge'),
                   out=self.odds[framed])
        self.explain_repetitions(odds)

    def explain_repetitions(self, odds):
        """Give nodes that have no range because the pattern repeats there that reason."""
        reason = self.reason[self.inner]
        wrong_period = [Status[name] for name in self.tuning.repetition.reasons]
        reason[(odds < self.least_odds) & np.isin(reason, wrong_period)] = Status.AMBIGUOUS

    def usual_balance(self):
        """Return the brightness left against right around each node, float32 (rows, columns)."""
        trust = self.tuning.trust
        brightness_balance(self.planes[0], self.misfit, self.left.s, self.right.s,
                           trust.balance_step, self.robust, *self.balance)
        balance, weight = (cv2.blur(each, 2 * (trust.balance_surroundings,))
                           for each in self.balance)
        return cv2.resize(balance / np.maximum(weight, F4(trust.least_balance_weight)),
                          self.nodes[::-1], interpolation=cv2.INTER_LINEAR)

    def distrust_discord(self):
        """
        Trust nodes less where most planes around them contradict their neighbors.

        Noise, or two images of different things, match by chance here and there; a single such
        node looks as good as a true one, but not its surroundings.

        """
        trust = self.tuning.trust
        thinned = 2 * (slice(None, None, trust.discord_step),)  # a share needs no more samples
        known = (self.variance[self.inner][thinned] < F4(trust.discord_variance)).view(np.uint8)
        apart = (self.evidence[3][thinned] > F4(trust.discord_distance)).view(np.uint8) & known
        # border pixels are repeated, by both counts alike
        surroundings = 2 * (trust.discord_surroundings,)
        counts = [cv2.boxFilter(each, cv2.CV_32F, surroundings, normalize=False)
                  for each in (apart, known)]
        share = counts[0] / np.maximum(counts[1], F4(1))
        excess = np.maximum(share - F4(trust.discord_share), F4(0))
        if excess.any():
            excess = cv2.resize(excess, self.nodes[::-1], interpolation=cv2.INTER_LINEAR)
            loss = float(F4(trust.discord_odds) / (F4(1) - F4(trust.discord_share)))
            cv2.scaleAdd(excess, -loss, self.trust[self.inner], dst=self.trust[self.inner])

    def expand(self, clock):
        """Return the measurement at every pixel."""
        shape = self.geometry.height, self.geometry.width
        disparity, depth, std, confidence = np.empty((4, *shape), F4)
        status = np.empty(shape, np.uint8)
        expand(*self.planes, self.std, self.odds, self.reason, *self.nodes,
               self.limits, F4(self.geometry.focal_baseline),
               F4(self.geometry.principal_offset),
               self.least_odds, disparity, depth, std,
               confidence, status)
        clock.lap('expand')
        return Measurement(disparity=disparity, disparity_std=std, confidence=confidence,
                           status=status, depth=depth)


def noise_weight(image, tuning):
    """
    Return the weight that mere noise has at a node of an image, uint8 (H, W, 3).

    The noise of a single-chip camera changes slowly from pixel to pixel, since demosaicing
    interpolates; that of other cameras (and of gray images without any pattern) does not, and
    has steeper gradients. tuning: ViewTuning.

    """
    demosaiced, independent = tuning.noise_weights
    first, step = tuning.noise_rows
    rows = image[first::step]
    if rows.shape[0] == 0 or rows.shape[1] < 3:
        return independent
    near, far = (cv2.norm(rows[:, step:], rows[:, :-step], cv2.NORM_L1) / (rows.shape[1] - step)
                 for step in (1, 2))
    low, high = tuning.noise_steps
    share = np.clip((near / max(far, 1e-6) - low) / (high - low), 0, 1)
    return demosaiced + share * (independent - demosaiced)


def shared(levels):
    """Give both cameras the same channel means: they may see different parts of the pattern."""
    mean = 0.5 * (levels[0][1] + levels[1][1])
    return [(dark, mean) for dark, _ in levels]


def gains_of(means, tuning):
    """
    Return the gains of the channels of both cameras, float32 (2, 3), from their means (DN).

    They make the cameras alike, and the channels half as unequal as they are (of logarithms):
    without that the hues of a weak channel count for little, fully amplified its noise for much.
    tuning: ViewTuning.

    """
    means = np.array(means, np.float64) + tuning.channel_offset
    balance = means / means.mean(axis=1, keepdims=True)
    common = np.sqrt(balance[0] * balance[1])
    return np.clip(np.sqrt(common) / balance, *tuning.channel_gain_limits).astype(F4)


def tiles_of(shape):
    """Return the first row and column of every tile of a framed half grid, int32 (N, 2)."""
    rows = np.arange(PAD, shape[0] - PAD, TILE_ROWS)
    columns = np.arange(PAD, shape[1] - PAD, TILE_COLUMNS)
    return np.stack(np.meshgrid(rows, columns, indexing='ij'), axis=-1).reshape(-1, 2).astype(
        np.int32)


def whole(count, step):
    """Return count rounded up to a multiple of step."""
    return -(-count // step) * step


def log_odds(probability, least):
    """Return the log-odds of a probability, float32, as if within least .. 1 - least."""
    p = min(max(probability, least), 1 - least)
    return F4(math.log(p / (1 - p)))

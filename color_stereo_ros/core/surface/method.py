# SPDX-License-Identifier: Apache-2.0
"""
The surface method: coarse to fine, with a slanted plane at every node.

1. colors: each image is rectified at half resolution (the right one keeps its columns) and
   turned into chromaticity with a variance.
2. coarse: semi-global search over all disparities, on a sixteenth of the pixels or fewer. Its
   disparities are the seeds of the planes.
3. Rounds, `matching.refinements` of them:

   - propagate (from the second round on): nodes near depth edges try the planes of neighbors;
   - fit: least squares of a plane at every node, from the gradient of the chromaticity;
   - compare: the nodes are compared again under the new planes; the first round measures noise
     and colors of the pair from that;
   - polish (from the second round on): wide windows where this round has made tiles smooth.

4. rows: by how much the rows of the two views disagree. If that matters, the right view is read
   elsewhere and the pair is matched again, see `aligning`.
5. bend: planes of surfaces that bend within a window are put in the right place.
6. judge: how well planes fit corrects their variance; then log-odds, standard deviation and
   reason of every node. What is hidden from the right camera, fits badly or is too uncertain
   gets no range.
7. expand: from nodes to pixels.

These are the names of the stages in `RangeResult.seconds`; those of a round carry its number.
The time of all but the coarse stage does not depend on the number of disparities. Every stage owns
its buffers and takes what it reads as arguments. It returns what it wrote, or its docstring says
what it changes in place. `grid_kernels` explains the half grid.

"""

from dataclasses import replace

import numpy as np

from ..compiled import Arena
from ..patterns.expectation import Expectation
from ..rows.alignment import COUNT
from .aligning import Aligner, doubt
from .bends import Bends
from .brightness import BrightnessCarrier, is_gray
from .coarse import CoarseSearch
from .even import Evening
from .grid import HalfGrid
from .grid_kernels import F4, SILENT_VARIANCE
from .neighbors import propagate_planes, rough_tiles
from .pair_model import color_matrix, PairModel
from .pixels import measured_pixels
from .planes import LeastSquares, PlaneField
from .quality import Quality
from .rows import RowTracker
from .texture import detail, TextureSearch
from .trust import Trust
from .tuning import detailed_tuning, tuning_for
from .views import Views


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
    tuning : Tuning, optional
        Default: what suits the pattern.

    """

    def __init__(self, settings, calibration, limits, rectified_input=False, tuning=None):
        """Build the maps and allocate the buffers of all steps, in the order of the pipeline."""
        self.settings = settings
        self.geometry = calibration.geometry
        self.limits = np.array(limits, F4)
        grid = HalfGrid(self.geometry.height, self.geometry.width)
        arena = Arena()
        if tuning is None:
            tuning = tuning_for(Expectation.of(settings.pattern), self.geometry.width)
        self.tuning = tuning
        self.views = Views(calibration, grid, settings, tuning, rectified_input, arena)
        self.coarse = CoarseSearch(grid.nodes, grid.width, limits, settings.matching, tuning,
                                   arena)
        self.texture = TextureSearch(grid, limits, tuning)
        self.brightness = BrightnessCarrier(self.views, tuning, arena)
        self.expectation = Expectation.of(settings.pattern)
        self.in_force = tuning
        self.detailed = detailed_tuning(tuning)
        self.planes = PlaneField(grid, tuning.coarse.seed_variance,
                                 settings.matching.refinements > 0, arena)
        self.least_squares = LeastSquares(grid, limits, settings.matching, tuning.planes,
                                          arena)
        self.bends = Bends(grid, tuning.bends, arena)
        self.quality = Quality(grid, tuning.quality, arena)
        self.trust = Trust(grid, self.limits, settings, tuning, arena)
        self.rows = RowTracker(grid, tuning, arena)
        choice = settings.matching.row_alignment
        self.aligner = None if choice == 'off' else Aligner(
            (grid.width, grid.height), choice == 'correct')
        self.evening = Evening(settings.matching, tuning)
        self.third = None
        self.match_colors = settings.matching.color_matching and tuning.pair.color_matching
        if settings.matching.refinements:
            self.warm_refinements()
        self.warm_brightness()

    def warm_refinements(self):
        """Run the kernels of colors and bends: the black pair has nothing to match or unbend."""
        views, planes, solver = self.views, self.planes, self.least_squares
        color_matrix(views, planes, F4(1), self.tuning)
        self.bends.unbend(solver.linearized, views, planes, PairModel.neutral(views), solver,
                          planes.tiles[:1], np.ones(1, F4))

    def warm_brightness(self):
        """Run the kernels of pairs whose brightness counts: the black pair shows no detail."""
        views, planes, brightness = self.views, self.planes, self.brightness
        brightness.load(views)
        found = self.texture.search(views, False)
        self.coarse.rival_share()
        self.coarse.period_odds(found)
        brightness.rely_on(found, views.grid)
        self.linearize(views, planes.seed(found), PairModel.neutral(views), planes.tiles[:1])
        brightness.rest()

    def measure(self, left, right, clock, alignment=None, search=None):
        """
        Measure one pair.

        Parameters
        ----------
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            Raw RGB images.
        clock : Stopwatch
            Told when a stage ends, and what it wrote.
        alignment : Alignment, optional
            What is known of the rows of the views.
        search : callable, optional
            See `Aligner.align`.

        Returns
        -------
        measurement : Measurement

        """
        if self.aligner is None:
            alignment = None
            pair, seeds = self.match(left, right, np.zeros(COUNT), clock)
        else:
            alignment, pair, seeds = self.match_aligned(left, right, alignment, search, clock)
        views, planes = self.views, self.planes
        self.bend(views, planes, pair, clock)
        verdict = self.trust.judge(views, planes, seeds, self.brightness.confirmed(planes),
                                   self.brightness.light(views.left))
        if self.aligner is not None:
            verdict.log_odds[:] -= F4(doubt(alignment))
        self.make_std_true(verdict, planes, alignment)
        if identical(left, right):  # at disparity 0 there is nothing to measure
            np.minimum(verdict.log_odds, F4(0), out=verdict.log_odds)
        clock.lap('judge', verdict)
        fused = None if identical(left, right) else self.with_third_view(verdict, pair, clock)
        measurement = self.expanded(verdict, fused)
        clock.lap('expand', measurement)
        return replace(measurement, alignment=alignment, rival_share=self.rival_share)

    def use_projector(self, model, pattern):
        """
        Take the projector as a third view from the next pair on.

        Without effect unless `matching.third_view` allows it and the pattern never repeats.

        Parameters
        ----------
        model : ProjectorModel or None
            None: two views from here on.
        pattern : numpy.ndarray, uint8, shape (H, W, 3), or None
            What the projector shows, linear light.

        """
        if not self.may_use_projector:
            return
        first = self.third is None
        if first and model is not None:
            from .third.view import ThirdView
            self.third = ThirdView(self, Arena())
        if self.third is not None:
            self.third.adopt(model, pattern)
            if first:
                self.third.warm(self.planes, self.trust.verdict)

    @property
    def may_use_projector(self):
        """Return whether settings and pattern allow a third view."""
        matching = self.settings.matching
        return (matching.third_view != 'off' and self.expectation.aperiodic
                and matching.refinements > 0)

    def with_third_view(self, verdict, pair, clock):
        """
        Return what two cameras and projector hold of every node, None without a projector.

        Parameters
        ----------
        verdict : Verdict
            Of the two cameras; stays as it is.
        pair : PairModel
        clock : Stopwatch

        Returns
        -------
        fused : Fused or None

        """
        if self.third is None or self.third.projected is None or self.brightness.active:
            return None
        fused = self.third.fused(self.planes, verdict, self.least_squares.linearized, pair)
        clock.lap('third view', fused)
        return fused

    def measure_left(self, left, clock):
        """
        Measure with left camera and projector, without the right camera.

        Parameters
        ----------
        left : numpy.ndarray, uint8, shape (H, W, 3)
            Raw RGB image.
        clock : Stopwatch

        Returns
        -------
        measurement : Measurement or None
            None without a projector.

        """
        if self.third is None or self.third.projected is None:
            return None
        views = self.views.load(left, left, np.zeros(COUNT))
        clock.lap('colors', views)
        fused = self.third.measure_alone(PairModel.neutral(views))
        clock.lap('third view', fused)
        measurement = self.expanded(None, fused)
        clock.lap('expand', measurement)
        return measurement

    def expanded(self, verdict, fused):
        """Return the Measurement of the nodes of two views, or of three; see `with_third_view`."""
        least = self.trust.least_odds
        if fused is None:
            return measured_pixels(self.planes, verdict, self.geometry, self.limits, least)
        measurement = measured_pixels(fused.planes, fused.verdict, self.geometry, self.limits,
                                      least, fused.beyond)
        return replace(measurement, views=fused.views_of(measurement.status))

    def bend(self, views, planes, pair, clock):
        """
        Put planes of bent surfaces in the right place; variances know what colors share.

        Writes d, a, b, variance and misfit of planes. Where brightness counts, they stay.

        Parameters
        ----------
        views : Views
        planes : PlaneField
            After all rounds.
        pair : PairModel
        clock : Stopwatch

        """
        solver = self.least_squares
        if not self.brightness.active:
            if self.settings.matching.refinements:
                self.bends.correct(solver.linearized, views, planes, pair, solver)
                clock.lap('bend', planes)
            solver.correct_variance(planes)

    def make_std_true(self, verdict, planes, alignment):
        """
        Scale standard deviations by how well planes fit and by what is unknown of the rows.

        The log-odds stay: they are fitted to variances of the assumed noise, and know the misfit.
        Writes verdict.std and planes.variance.

        Parameters
        ----------
        verdict : Verdict
        planes : PlaneField
        alignment : Alignment or None

        """
        inner = self.views.grid.inner
        assumed = planes.variance[inner].copy()
        if self.settings.matching.refinements and not self.brightness.active:
            solver = self.least_squares
            self.quality.correct_variance(solver.linearized, planes, solver.reference)
        if alignment is not None:
            self.rows.widen(planes, alignment)
        known = (assumed > 0) & np.isfinite(assumed)
        verdict.std[inner][known] *= np.sqrt(planes.variance[inner][known] / assumed[known])

    def match_aligned(self, left, right, alignment, search, clock):
        """
        Match a pair until its rows agree; see `measure` for the arguments.

        Returns
        -------
        alignment : Alignment
            As the pair shows it.
        pair : PairModel
        seeds : Seeds
            Of the last match.

        """
        last = []

        def measured(prior):
            pair, seeds = self.match(left, right, prior.applied, clock)
            last[:] = [pair, seeds]
            found = self.rows.measure(self.views, self.planes, pair, prior, self.brightness)
            clock.lap('rows', found)
            return found

        return self.aligner.align(alignment, measured, search), *last

    def match(self, left, right, applied, clock):
        """
        Match one pair: colors, coarse search and all rounds.

        Parameters
        ----------
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            Raw RGB images.
        applied : numpy.ndarray, float64, shape (7,)
            By which the rows of the right view are corrected, px.
        clock : Stopwatch

        Returns
        -------
        pair : PairModel
        seeds : Seeds

        """
        views = self.views.load(left, right, applied)
        clock.lap('colors', views)
        seeds = self.seeds(views, self.gray(left, right))
        clock.lap('coarse', seeds)
        planes, pair = self.planes.seed(seeds), PairModel.neutral(views)
        if self.settings.matching.refinements:
            pair = self.fit_seeds(views, planes, pair, clock)
        if self.evening.on and not self.brightness.active:
            pair = self.even_out(views, planes, pair, clock)
        for turn in range(1, self.settings.matching.refinements):
            self.refine(turn, views, planes, pair, clock)
        return pair, seeds

    def gray(self, left, right):
        """Return whether neither raw image has any color."""
        tuning = self.tuning.brightness
        return is_gray(left, tuning) and is_gray(right, tuning)

    def seeds(self, views, gray):
        """
        Return the seeds of a pair, and decide which carriers count in it.

        Parameters
        ----------
        views : Views
        gray : bool
            Neither image has any color.

        Returns
        -------
        seeds : Seeds

        """
        brightness = self.brightness
        brightness.rest()
        self.rival_share = 0.0
        self.suit(self.tuning)
        if gray:
            self.suit(self.detailed)
            seeds = self.texture.search(views, gray)
            brightness.replace_colors(views)
            brightness.rely_on(seeds, views.grid)
            return seeds
        if self.expectation.aperiodic:
            coarse = self.coarse.search(views)
            share = self.coarse.rival_share()
            if share < self.tuning.repetition.noticed_share:
                return coarse
            self.rival_share = share
        brightness.load(views)
        return self.detailed_seeds(views)

    def detailed_seeds(self, views):
        """
        Return the seeds of the search for texture, or of the coarse search where there is none.

        Without detail at most nodes brightness does not count. Slow colors are then averaged, and
        otherwise fitted like others.

        """
        brightness, tuning = self.brightness, self.tuning.brightness
        slow = self.tuning.views.averaging_radius > 0
        quiet = detail(views, brightness, tuning, not slow) < F4(tuning.least_detail)
        lit = views.left.variance[views.grid.inner] < SILENT_VARIANCE
        detailed = lit.any() and np.mean(quiet[lit]) < 1 - tuning.detailed_share
        if detailed:
            self.suit(self.detailed)
        elif slow:
            views.average()
        coarse = self.coarse.seeds if self.expectation.aperiodic else self.coarse.search(views)
        if not detailed:
            brightness.rest()
            return coarse
        found = self.texture.search(views, False)
        brightness.rely_on(found, views.grid)
        if self.expectation.aperiodic or self.expectation.repeats:
            clear, odds = self.coarse.period_odds(found)
            return replace(found, clear_share=clear, period_odds=odds)
        return found

    def suit(self, tuning):
        """Fit and judge by the constants of a Tuning from here on."""
        if tuning is not self.in_force:
            self.least_squares.suit(tuning.planes)
            self.trust.suit(tuning)
            self.rows.suit(tuning)
            self.in_force = tuning

    def fit_seeds(self, views, planes, pair, clock):
        """
        Do the first round: fit the seeds, then measure noise and colors of the pair.

        Reads d, a, b of planes. Writes d, a, b, variance and misfit; cost stays 1.

        Parameters
        ----------
        views : Views
        planes : PlaneField
        pair : PairModel
            Equal cameras, plausible noise.
        clock : Stopwatch

        Returns
        -------
        pair : PairModel
            As the matches of this round show it.

        """
        solver = self.least_squares
        linearized = self.linearize(views, planes, pair, planes.tiles)
        solver.fit(linearized, views, planes, pair, planes.tiles, turn=0)
        clock.lap('fit 1', planes)
        self.linearize(views, planes, pair, planes.tiles, fold=False)
        pair = pair.measured(views, planes, self.match_colors, self.tuning)
        self.brightness.measure(views)
        clock.lap('compare 1', pair)
        return pair

    def even_out(self, views, planes, pair, clock):
        """
        Make the views alike in blur and color, as far as the first round shows a difference.

        Where the difference is large the search is repeated. Writes the views and all of planes.

        Parameters
        ----------
        views : Views
        planes : PlaneField
            After the first round.
        pair : PairModel
            As the first round has measured it.
        clock : Stopwatch

        Returns
        -------
        pair : PairModel
            That of the changed views; this one where nothing has changed.

        """
        if pair.scale > self.tuning.unlike.quiet_scale:
            if not self.evening.explains(views, planes) and self.evening.even_spread(views):
                pair = self.search_again(views, planes)
            for _ in range(self.tuning.unlike.searches + 1):
                changed, size = self.evening.improve(views, planes)
                if not changed:
                    break
                if size >= 1:
                    pair = self.search_again(views, planes)
                    continue
                pair = self.measured_anew(views, planes)
                break
        clock.lap('even out', pair)
        return pair

    def search_again(self, views, planes):
        """Search and fit seeds in views that have changed; return the PairModel."""
        neutral = PairModel.neutral(views)
        planes.seed(self.coarse.search(views))
        linearized = self.least_squares.linearize(views, planes, neutral, planes.tiles)
        self.least_squares.fit(linearized, views, planes, neutral, planes.tiles, turn=0)
        return self.measured_anew(views, planes)

    def measured_anew(self, views, planes):
        """Return the PairModel of views that have changed; the planes stay."""
        neutral = PairModel.neutral(views)
        self.least_squares.linearize(views, planes, neutral, planes.tiles)
        return neutral.measured(views, planes, self.match_colors, self.tuning)
    def linearize(self, views, planes, pair, tiles, fold=True):
        """Compare the nodes of some tiles in all carriers; see `LeastSquares.linearize`."""
        solver = self.least_squares
        linearized = solver.linearize(views, planes, pair, tiles)
        self.brightness.add(linearized, views, planes, tiles, solver.reference, fold)
        return linearized

    def refine(self, turn, views, planes, pair, clock):
        """
        Do a later round: planes from neighbors, least squares, wide windows where they now fit.

        Reads d, a, b of planes. Writes d, a, b, variance, misfit and, near depth edges, cost.

        Parameters
        ----------
        turn : int
            Number of the round, from 1: the seeds had round 0.
        views : Views
        planes : PlaneField
        pair : PairModel
            As the first round has measured it.
        clock : Stopwatch

        """
        solver, edges = self.least_squares, planes.tiles
        if self.settings.matching.propagation:
            edges = rough_tiles(views, planes, solver.smooth_steps[-1])
            propagate_planes(views, planes, pair, edges, turn, self.in_force.neighbors,
                             self.brightness)
            clock.lap(f'propagate {turn}', planes)
        # colors and noise are known better after the first round: everything is fitted anew
        fitted = planes.tiles if turn < self.in_force.planes.full_rounds else edges
        linearized = self.linearize(views, planes, pair, fitted)
        narrow = solver.fit(linearized, views, planes, pair, fitted, turn)
        clock.lap(f'fit {turn + 1}', planes)
        # only tiles near depth edges: the misfit of all others, which the trust reads, and their
        # linearized nodes stay those of the planes before this fit
        linearized = self.linearize(views, planes, pair, edges)
        clock.lap(f'compare {turn + 1}', pair)
        # the misfit of polished tiles is likewise that before they are polished
        solver.polish(linearized, views, planes, pair, narrow)
        clock.lap(f'polish {turn + 1}', planes)


def identical(left, right):
    """Return whether both raw images are the same; most pairs differ in their first rows."""
    return np.array_equal(left[:8], right[:8]) and np.array_equal(left, right)

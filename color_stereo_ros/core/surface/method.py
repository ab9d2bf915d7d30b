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
5. judge: log-odds, standard deviation and reason of every node. What is hidden from the right
   camera, fits badly or is too uncertain gets no range.
6. expand: from nodes to pixels.

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
from .coarse import CoarseSearch
from .even import Evening
from .grid import HalfGrid
from .grid_kernels import F4
from .neighbors import propagate_planes, rough_tiles
from .pair_model import color_matrix, PairModel
from .pixels import measured_pixels
from .planes import LeastSquares, PlaneField
from .quality import Quality
from .rows import RowTracker
from .trust import Trust
from .tuning import tuning_for
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
        self.match_colors = settings.matching.color_matching and tuning.pair.color_matching
        if settings.matching.refinements:
            # the black pair that warms the kernels has no colors to match
            color_matrix(self.views, self.planes, F4(1), tuning)

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
            pair, seeds = self.match(left, right, np.zeros(COUNT), clock)
        else:
            alignment, pair, seeds = self.match_aligned(left, right, alignment, search, clock)
        views, planes = self.views, self.planes
        if self.settings.matching.refinements:
            solver = self.least_squares
            self.bends.correct(solver.linearized, views, planes, pair, solver)
            clock.lap('bend', planes)
            self.quality.correct_variance(solver.linearized, planes, solver.reference)
        self.least_squares.correct_variance(planes)
        if self.aligner is not None:
            self.rows.widen(planes, alignment)
        verdict = self.trust.judge(views, planes, seeds)
        if self.aligner is not None:
            verdict.log_odds[:] -= F4(doubt(alignment))
        clock.lap('judge', verdict)
        measurement = measured_pixels(planes, verdict, self.geometry, self.limits,
                                      self.trust.least_odds)
        clock.lap('expand', measurement)
        return replace(measurement, alignment=alignment if self.aligner else None)

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
            found = self.rows.measure(self.views, self.planes, pair, prior)
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
        seeds = self.coarse.search(views)
        clock.lap('coarse', seeds)
        planes, pair = self.planes.seed(seeds), PairModel.neutral(views)
        if self.settings.matching.refinements:
            pair = self.fit_seeds(views, planes, pair, clock)
        if self.evening.on:
            pair = self.even_out(views, planes, pair, clock)
        for turn in range(1, self.settings.matching.refinements):
            self.refine(turn, views, planes, pair, clock)
        return pair, seeds

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
        linearized = solver.linearize(views, planes, pair, planes.tiles)
        solver.fit(linearized, views, planes, pair, planes.tiles, turn=0)
        clock.lap('fit 1', planes)
        solver.linearize(views, planes, pair, planes.tiles)
        pair = pair.measured(views, planes, self.match_colors, self.tuning)
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
            propagate_planes(views, planes, pair, edges, turn, self.tuning.neighbors)
            clock.lap(f'propagate {turn}', planes)
        # colors and noise are known better after the first round: everything is fitted anew
        fitted = planes.tiles if turn < self.tuning.planes.full_rounds else edges
        linearized = solver.linearize(views, planes, pair, fitted)
        narrow = solver.fit(linearized, views, planes, pair, fitted, turn)
        clock.lap(f'fit {turn + 1}', planes)
        # only tiles near depth edges: the misfit of all others, which the trust reads, and their
        # linearized nodes stay those of the planes before this fit
        linearized = solver.linearize(views, planes, pair, edges)
        clock.lap(f'compare {turn + 1}', pair)
        # the misfit of polished tiles is likewise that before they are polished
        solver.polish(linearized, views, planes, pair, narrow)
        clock.lap(f'polish {turn + 1}', planes)

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

4. bend: planes of surfaces that bend within a window are put in the right place.
5. judge: how well planes fit corrects their variance; then log-odds, standard deviation and
   reason of every node. What is hidden from the right camera, fits badly or is too uncertain
   gets no range.
6. expand: from nodes to pixels.

These are the names of the stages in `RangeResult.seconds`; those of a round carry its number.
The time of all but the coarse stage does not depend on the number of disparities. Every stage owns
its buffers and takes what it reads as arguments. It returns what it wrote, or its docstring says
what it changes in place. `grid_kernels` explains the half grid.

"""

import numpy as np

from ..compiled import Arena
from ..patterns.expectation import Expectation
from .bends import Bends
from .coarse import CoarseSearch
from .grid import HalfGrid
from .grid_kernels import F4
from .neighbors import propagate_planes, rough_tiles
from .pair_model import color_matrix, PairModel
from .pixels import measured_pixels
from .planes import LeastSquares, PlaneField
from .quality import Quality
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
        self.views = Views(calibration, grid, settings, tuning.views, rectified_input, arena)
        self.coarse = CoarseSearch(grid.nodes, grid.width, limits, settings.matching, tuning,
                                   arena)
        self.planes = PlaneField(grid, tuning.coarse.seed_variance,
                                 settings.matching.refinements > 0, arena)
        self.least_squares = LeastSquares(grid, limits, settings.matching, tuning.planes,
                                          arena)
        self.bends = Bends(grid, tuning.bends, arena)
        self.quality = Quality(grid, tuning.quality, arena)
        self.trust = Trust(grid, self.limits, settings, tuning, arena)
        self.match_colors = settings.matching.color_matching and tuning.pair.color_matching
        if settings.matching.refinements:
            # the black pair that warms the kernels has no colors to match
            color_matrix(self.views, self.planes, F4(1), tuning)

    def measure(self, left, right, clock):
        """
        Measure one pair.

        Parameters
        ----------
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            Raw RGB images.
        clock : Stopwatch
            Told when a stage ends, and what it wrote.

        Returns
        -------
        measurement : Measurement

        """
        views = self.views.load(left, right)
        clock.lap('colors', views)
        seeds = self.coarse.search(views)
        clock.lap('coarse', seeds)
        planes, pair = self.planes.seed(seeds), PairModel.neutral(views)
        if self.settings.matching.refinements:
            pair = self.fit_seeds(views, planes, pair, clock)
        for turn in range(1, self.settings.matching.refinements):
            self.refine(turn, views, planes, pair, clock)
        if self.settings.matching.refinements:
            self.correct(views, planes, pair, clock)
        self.least_squares.correct_variance(planes)
        verdict = self.trust.judge(views, planes, seeds)
        clock.lap('judge', verdict)
        measurement = measured_pixels(planes, verdict, self.geometry, self.limits,
                                      self.trust.least_odds)
        clock.lap('expand', measurement)
        return measurement

    def correct(self, views, planes, pair, clock):
        """
        Correct planes for bends, and their variance for how well they fit.

        Parameters
        ----------
        views : Views
        planes : PlaneField
        pair : PairModel
        clock : Stopwatch

        """
        solver = self.least_squares
        self.bends.correct(solver.linearized, views, planes, pair, solver)
        clock.lap('bend', planes)
        self.quality.correct_variance(solver.linearized, planes, solver.reference)

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

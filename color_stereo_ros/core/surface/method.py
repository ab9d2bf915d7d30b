# SPDX-License-Identifier: Apache-2.0
"""
The surface method: coarse to fine, with a slanted plane at every node.

1. Views: each image is rectified at half resolution (the right one keeps its columns) and
   turned into chromaticity with a variance.
2. Coarse search: semi-global, over all disparities, on a sixteenth of the pixels or fewer.
3. Rounds: least squares of a plane at every node, from the gradient of the chromaticity; between
   the rounds, nodes near depth edges try the planes of their neighbors.
4. Trust: what is hidden from the right camera, fits badly or is too uncertain gets no range.

The cost of all but the coarse step does not depend on the number of disparities. Every step owns
its buffers, takes what it reads as arguments and returns what it wrote. `grid_kernels` explains
the half grid.

"""

import numpy as np

from ..compiled.arena import Arena
from ..patterns.expectation import Expectation
from .coarse import CoarseSearch
from .grid import HalfGrid
from .grid_kernels import F4
from .neighbors import propagate_planes, rough_tiles
from .pair_model import color_matrix, PairModel
from .pixels import measured_pixels
from .planes import LeastSquares, PlaneField
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
        self.trust = Trust(grid, self.limits, settings, tuning, arena)
        self.match_colors = settings.matching.color_matching and tuning.planes.color_matching
        if settings.matching.refinements:
            # the black pair that warms the kernels has no colors to match
            color_matrix(self.views, self.planes, F4(1), tuning.planes)

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
        for turn in range(self.settings.matching.refinements):
            pair = self.refine(turn, views, planes, pair, clock)
        self.least_squares.correct(planes)
        verdict = self.trust.judge(views, planes, seeds)
        clock.lap('judge', verdict)
        measurement = measured_pixels(planes, verdict, self.geometry, self.limits,
                                      self.trust.least_odds)
        clock.lap('expand', measurement)
        return measurement

    def refine(self, turn, views, planes, pair, clock):
        """
        Do one round: planes from neighbors (not in the first round), then least squares.

        Returns
        -------
        pair : PairModel
            As the matches of this round show it.

        """
        solver, tiles = self.least_squares, planes.tiles
        if turn > 0 and self.settings.matching.propagation:
            tiles = rough_tiles(views, planes, solver.steady[-1])
            propagate_planes(views, planes, pair, tiles, turn, self.tuning.neighbors)
            clock.lap(f'propagate {turn}', planes)
        # colors and noise are known better after the first round: everything is fitted anew
        fitted = planes.tiles if turn < self.tuning.planes.full_rounds else tiles
        linearized = solver.linearize(views, planes, pair, fitted)
        rough = solver.fit(linearized, views, planes, pair, fitted, turn)
        clock.lap(f'fit {turn + 1}', planes)
        linearized = solver.linearize(views, planes, pair, tiles)
        if turn == 0:
            pair = pair.measured(views, planes, self.match_colors, self.tuning.planes)
        clock.lap(f'compare {turn + 1}', pair)
        if turn > 0:
            solver.polish(linearized, views, planes, pair, rough)
            clock.lap(f'polish {turn + 1}', planes)
        return pair

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
"""By how much the rows of the two views disagree, measured at the matches of a pair."""

import cv2
import numpy as np

from .grid_kernels import F4
from .row_kernels import (
    CELL, CELL_STEP, COUNT, DISPARITY, INFORMATION, MISFIT, PLACE, PULL, QUANTITIES, row_cells,
    STRUCTURE)
from ..rows.alignment import RowEvidence, terms
from ..rows.estimate import median, significant, updated, warm
from ..rows.tuning import TUNING as ROWS


class RowTracker:
    """
    Measures the row error that the matches of a pair show.

    Parameters
    ----------
    grid : HalfGrid
    tuning : Tuning
    arena : Arena

    """

    def __init__(self, grid, tuning, arena):
        """Allocate the cells."""
        self.grid, self.before, self.turn = grid, 0, 0
        warm()
        self.suit(tuning)
        lines, columns = (-(-count // CELL) for count in grid.nodes)
        self.shape = lines, columns
        self.cells = arena.zeros((lines, -(-columns // CELL_STEP), len(QUANTITIES)), F4)
        self.more_cells = arena.zeros(self.cells.shape, F4)
        self.middle = np.broadcast_to(
            2.0 * CELL * np.arange(lines)[:, None] + CELL - 0.5, self.cells.shape[:2])

    def suit(self, tuning):
        """Ask by the constants of a Tuning from here on."""
        self.tuning = tuning.rows
        self.robust_misfit = F4(tuning.planes.robust_misfit)
        self.variance_factor = tuning.trust.variance_factor

    def measure(self, views, planes, pair, prior, brightness=None):
        """
        Return the alignment that the matches and a prior show together.

        Parameters
        ----------
        views : Views
            The right one with its rows corrected by prior.applied.
        planes : PlaneField
            The planes of the nodes so far.
        pair : PairModel
            What the two views of the pair differ by.
        prior : Alignment
            What is known of the rows before the pair.
        brightness : BrightnessCarrier, optional
            Where it is active its rows count beside those of the colors.

        Returns
        -------
        alignment : Alignment

        """
        self.turn = prior.turn
        cells = self.ask(views, planes, pair, brightness)
        least = self.tuning.least_information
        count, information = cells[..., COUNT], cells[..., INFORMATION]
        structured = self.structured(cells)
        used = ((count >= self.tuning.least_nodes) & (information > least)
                & (cells[..., STRUCTURE] > least))
        told = cells[used].astype(np.float64)
        few = max(ROWS.estimate.least_cells, ROWS.use.least_share * max(structured, self.before))
        matched = len(told) >= few
        if not structured and (matched or not self.before):
            return prior.but(observable=False, agreeing=True, misfit=np.nan, scatter=np.nan,
                             evidence=RowEvidence.none())
        if not matched:
            return prior.but(observable=False, agreeing=False, misfit=np.inf, scatter=np.nan,
                             evidence=RowEvidence.none())
        number = told[:, COUNT]
        x, y = told[:, PLACE] / number + 0.5, self.middle[used]
        misfit = median(told[:, MISFIT] / number)
        dy = told[:, PULL] / told[:, INFORMATION] + terms(x, y, prior.size) @ prior.applied
        found = updated(prior, x, y, dy, told[:, INFORMATION], told[:, DISPARITY] / number)
        steady = found.observable and found.scatter < ROWS.use.steady
        return found.but(agreeing=misfit < ROWS.use.poor or steady, misfit=misfit)

    def structured(self, cells):
        """Return how many cells have vertical structure; 0 if too few to show rows."""
        count, lit = (np.count_nonzero(cells[..., STRUCTURE] > each)
                      for each in (self.tuning.least_information, 0))
        few = max(ROWS.estimate.least_cells, ROWS.use.least_structured * lit)
        return 0 if count < few else count

    def look(self, views, planes, pair, brightness):
        """Keep how much structure the views have before they are made alike; see `measure`."""
        self.before = self.structured(self.ask(views, planes, pair, brightness))

    def ask(self, views, planes, pair, brightness):
        """Return the sums of all cells, over colors and brightness; see `measure`."""
        left, right, cells = views.left, views.right, self.cells
        row_cells(left.u, left.v, left.variance, right.u, right.v, right.variance, pair.matrix,
                  planes.d, self.robust_misfit, pair.scale, *self.grid.nodes,
                  self.turn % CELL_STEP, cells)
        if brightness is not None and brightness.active:
            (left, left_var), (right, right_var) = brightness.planes
            same = np.eye(2, 3, dtype=F4)
            row_cells(left, np.zeros_like(left), left_var, right, np.zeros_like(right), right_var,
                      same, planes.d, self.robust_misfit, brightness.scale, *self.grid.nodes,
                      self.turn % CELL_STEP, self.more_cells)
            cells += self.more_cells
        return cells

    def widen(self, planes, alignment):
        """
        Add to planes.variance what the row error that is left does to the disparities.

        Parameters
        ----------
        planes : PlaneField
            The planes of the nodes so far.
        alignment : Alignment
            What is known of the rows.

        """
        if not (alignment.known and (alignment.applied.any() or significant(alignment))):
            return
        lines, columns = self.shape
        x, y = np.meshgrid(2.0 * CELL * np.arange(columns) + CELL - 0.5,
                           2.0 * CELL * np.arange(lines) + CELL - 0.5)
        if len(alignment.evidence.x):  # the place in the right image
            x = x - median(alignment.evidence.disparity)
        there = terms(x, y, alignment.size)
        rest = there @ (alignment.coefficients - alignment.applied)
        variance = rest * rest + np.einsum('...i,ij,...j', there, alignment.covariance, there)
        excess = np.maximum(variance - ROWS.use.silent ** 2, 0)
        if not excess.any():
            return
        excess *= ROWS.use.coverage ** 2 / self.variance_factor
        rows, columns = self.grid.nodes
        planes.variance[self.grid.inner] += cv2.resize(
            excess.astype(F4), (self.shape[1] * CELL, self.shape[0] * CELL),
            interpolation=cv2.INTER_LINEAR)[:rows, :columns]

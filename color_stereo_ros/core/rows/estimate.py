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
"""From evidence to alignments: robust least squares, what is carried on, what is corrected."""

from functools import lru_cache

import numpy as np

from .alignment import RowEvidence, terms
from .estimate_kernels import fit_robustly
from .tuning import TUNING

UNSEEN = np.diag(np.reciprocal(np.square(TUNING.estimate.prior_std)))
"""Information about the coefficients before anything is seen, px^-2."""


def median(values):
    """Return the upper median, a float, of float64 (N,); NumPy's own takes ten times as long."""
    middle = len(values) // 2
    return float(np.partition(values, middle)[middle])


def updated(prior, x, y, dy, information, disparity):
    """
    Return the alignment that a pair and what was known before show together.

    Parameters
    ----------
    prior : Alignment
        What is known of the rows before the pair.
    x, y, dy : numpy.ndarray, float64, shape (N,)
        Place in the right image and row error there, px.
    information : numpy.ndarray, float64, shape (N,)
        Of dy, px^-2, up to a common factor.
    disparity : numpy.ndarray, float64, shape (N,)
        px.

    Returns
    -------
    alignment : Alignment
        `observable` and `evidence` are those of the pair; `applied` is that of the prior. Where
        the pair shows no rows, the coefficients are those of the prior.

    """
    tuning = TUNING.estimate
    # process noise: a mounting may yield from pair to pair
    carried = UNSEEN + tuning.keep * (np.linalg.inv(prior.covariance) - UNSEEN)
    if len(dy) < tuning.least_cells:
        return _unseen(prior, carried)
    there = terms(x, y, prior.size)
    found, weight = robust_fit(there, dy, information, prior.coefficients)
    own = _limited(there.T @ (weight[:, None] * there))
    mean = weight @ there / weight.sum()
    if not mean @ np.linalg.solve(own + UNSEEN, mean) < tuning.vague ** 2:
        return _unseen(prior, carried)
    center = prior.coefficients
    if weight @ np.square(there @ (found - center)) / weight.sum() > tuning.bump ** 2:
        carried, center = UNSEEN, np.zeros(len(found))
    total = carried + own
    return prior.but(
        coefficients=np.linalg.solve(total, carried @ center + own @ found),
        covariance=np.linalg.inv(total), observable=True,
        scatter=median(np.abs(dy - there @ found)) / tuning.half,
        evidence=RowEvidence(x, y, dy, 1 / np.sqrt(np.maximum(weight, tuning.least_weight)),
                             disparity))


def _unseen(prior, carried):
    """Return what is left of a prior after a pair that shows no rows; carried: information."""
    return prior.but(covariance=np.linalg.inv(carried), observable=False, scatter=np.nan,
                     evidence=RowEvidence.none())


def robust_fit(there, dy, information, center):
    """
    Fit coefficients by iteratively reweighted least squares with Cauchy weights.

    Parameters
    ----------
    there : numpy.ndarray, float64, shape (N, 7)
        See `alignment.terms`.
    dy, information : numpy.ndarray, float64, shape (N,)
        px and px^-2; the latter up to a common factor.
    center : numpy.ndarray, float64, shape (7,)
        Where to begin, px.

    Returns
    -------
    coefficients : numpy.ndarray, float64, shape (7,)
        px.
    weight : numpy.ndarray, float64, shape (N,)
        Inverse variance of each dy as it counts, px^-2.

    """
    deviation = 1 / np.sqrt(information) + TUNING.estimate.least_scatter
    center, weight = center.copy(), np.empty(len(dy))
    fit_robustly(there, dy, deviation, UNSEEN, center, weight)
    return center, weight


def warm():
    """Compile what `robust_fit` runs, before the first pair shows rows."""
    places = np.arange(TUNING.estimate.least_cells, dtype=np.float64)
    size = len(places), len(places)
    robust_fit(terms(places, places, size), places, np.ones_like(places), np.zeros(len(UNSEEN)))


def _limited(normal):
    """Return the information of one pair, bounded by `floor_std`: (N^-1 + floor^2)^-1."""
    floor = TUNING.estimate.floor_std ** 2
    return np.linalg.solve(np.eye(len(normal)) + floor * normal, normal)


def applicable(alignment):
    """
    Return the coefficients by which the rows of the next pair are to be corrected.

    Parameters
    ----------
    alignment : Alignment
        What is known of the rows.

    Returns
    -------
    applied : numpy.ndarray, float64, shape (7,)
        px; exactly 0 where the rows agree, and exactly those applied so far where nearly nothing
        would change.

    """
    use, there = TUNING.use, _everywhere(alignment.size)
    if not significant(alignment):
        return np.zeros_like(alignment.coefficients)
    change = there @ (alignment.coefficients - alignment.applied)
    if alignment.applied.any() and np.abs(change).max() < use.least_change:
        return alignment.applied
    return alignment.coefficients


def significant(alignment):
    """Return whether the rows disagree by more than is worth a correction, and than chance."""
    use, there = TUNING.use, _everywhere(alignment.size)
    coefficients, covariance = alignment.coefficients, alignment.covariance
    least = use.least_error_left if alignment.applied.any() else use.least_error
    variance = np.einsum('ij,ij->i', there @ covariance, there)
    weight = 1 / (TUNING.estimate.useful ** 2 + variance)
    error = weight @ np.square(there @ coefficients) / weight.sum()
    return bool(error > least ** 2 and coefficients @ np.linalg.solve(covariance, coefficients)
                > use.least_chi_square)


def field_apart(one, other):
    """Return by how much two alignments differ, root mean square over the image, px."""
    apart = _everywhere(one.size) @ (one.coefficients - other.coefficients)
    return float(np.sqrt(np.mean(apart * apart)))


def failed(alignment, sentence):
    """Return an alignment after a search in vain: the next one waits twice as long."""
    tries = alignment.tries + 1
    return alignment.but(searched=sentence, tries=tries,
                         wait=min(2 ** tries, TUNING.search.largest_wait))


def resumed(current, found, sentence):
    """
    Return what to go on with after a search beside the pairs.

    Parameters
    ----------
    current : Alignment
        Carried now.
    found : Alignment or None
        Of the search.
    sentence : str
        What was found that cannot be corrected; '' if nothing.

    Returns
    -------
    alignment : Alignment
        The next pairs must confirm it before another search begins.

    """
    if found is None or field_apart(found, current) < TUNING.use.bump:
        return failed(current, sentence)
    return failed(found.but(tries=current.tries, agreeing=False), sentence)


def left_over(alignment):
    """Return the row error left in a pair, root mean square over its evidence, px."""
    evidence = alignment.evidence
    if not (alignment.observable and len(evidence.x)):
        return 0.0
    rest = alignment.rest(evidence.x, evidence.y)
    return float(np.sqrt(np.average(rest * rest, weights=1 / np.square(evidence.sigma))))


@lru_cache(maxsize=8)
def _everywhere(size):
    """Return the terms at 5 x 5 places of an image, float64 (25, 7)."""
    width, height = size
    x, y = np.meshgrid(np.linspace(0, width - 1, 5), np.linspace(0, height - 1, 5))
    return terms(x, y, size).reshape(25, -1)

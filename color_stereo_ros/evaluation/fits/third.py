# SPDX-License-Identifier: Apache-2.0
"""Fit the trust in the third view and what it says of two cameras (models/third.yaml)."""

from dataclasses import dataclass

import numpy as np

from ...core import ColorStereo
from ...core.surface.third.fusion import evidence_of, MODEL_NAMES, quadratic
from ...core.surface.third.tuning import TUNING
from .pairs import simulated
from .regression import equal_shares, logistic_fit
from .trust import products, quadratic_form

RIGHT = 1.0  # px: what confidence means
FIRM = 1e-3  # as in `trust`
HOLD = 2e-6
MOST = 6000   # nodes of one pair and one form: more tell nothing new


@dataclass(frozen=True, eq=False)
class Samples:
    """Nodes of one pair; arrays of N."""

    own: np.ndarray
    """float64 (N, 4), of the plane of the third view, see `fusion.evidence_of`."""
    evidence: np.ndarray
    """float64 (N, 6), see `fusion.EVIDENCE`."""
    agree: np.ndarray
    """bool, both planes say the same."""
    firm: np.ndarray
    """bool, two cameras know, and the third view agrees."""
    treated: np.ndarray
    """bool, the third view has a plane."""
    error_two: np.ndarray
    """px, of the plane of the two cameras."""
    error_third: np.ndarray
    """px, of the plane of the third view."""


def pairs_of(scenes, options):
    """Return the pairs of this fit: every scene under the default pattern."""
    return [simulated(name, cache=options.cache, seed=options.seed, quick=options.quick)
            for name in options.progress(scenes)]


def fit(pairs, options):
    """Fit to pairs, see `trust.fit`; returns all parameters of models/third.yaml."""
    samples = [samples_of(pair) for pair in options.progress(pairs)]
    return fitted_model(samples), [f'pairs: {len(samples)}, nodes: '
                                   f'{sum(len(each.treated) for each in samples)}']


def samples_of(pair):
    """Measure a pair with its projector and return its Samples."""
    stereo = ColorStereo(pair.calibration, pair.settings)
    stereo.use_projector(pair.projector)
    stereo.process(pair.left, pair.right)
    return samples_from(stereo, pair.disparity, np.isfinite(pair.disparity))


def samples_from(stereo, disparity, seen):
    """
    Return the Samples of the pair that an object has measured last.

    Parameters
    ----------
    stereo : ColorStereo
    disparity : numpy.ndarray, shape (H, W)
        Truth, px.
    seen : numpy.ndarray, bool, shape (H, W)
        Pixels that count.

    """
    method = stereo._method
    third, grid = method.third, method.views.grid
    found = third.found
    given = third.fusion.inputs(found, method.trust.verdict, method.planes)
    at_nodes = np.s_[:2 * grid.rows:2, :2 * grid.columns:2]
    inner = grid.inner

    def error(planes):
        d, a, b = (plane[inner].astype(float) for plane in (planes.d, planes.a, planes.b))
        return np.nan_to_num(np.abs(d - 0.25 * (a + b) - disparity[at_nodes]), nan=1e3)

    used = (seen[at_nodes] & np.isfinite(disparity[at_nodes])
            & (method.views.left.s[inner] > method.tuning.trust.unlit)
            & (given.treated | given.firm))
    own = evidence_of(found.planes, found.around, grid)
    return Samples(own[:, used].T.astype(float), given.evidence[:, used].T.astype(float),
                   given.agree[used], given.firm[used], given.treated[used],
                   error(method.planes)[used], error(found.planes)[used])


def fitted_model(samples):
    """Return the parameters, a dict of lists, that fit some Samples; each pair counts alike."""
    third = form_of([(each.own[each.treated], each.error_third[each.treated]) for each in samples])
    low, high = TUNING.use.odds_limits

    def kept(choose, error):
        chosen = []
        for each in samples:
            evidence = each.evidence.copy()
            evidence[:, 1] = np.where(
                each.treated, np.clip(quadratic(third, each.own.T), low, high), low)
            at = choose(each)
            chosen.append((evidence[at], getattr(each, error)[at]))
        return form_of(chosen)

    def apart(each):
        return each.treated & ~each.agree & ~each.firm

    found = {'form': third,
             'agree': kept(lambda each: each.agree & ~each.firm, 'error_two'),
             'two_apart': kept(apart, 'error_two'), 'third_apart': kept(apart, 'error_third'),
             'firm': kept(lambda each: each.firm, 'error_two')}
    return {name: np.round(found[name], 3).tolist() for name in MODEL_NAMES}


def thinned(evidence, error):
    """Return at most MOST of the samples, evenly chosen."""
    step = max(1, len(error) // MOST)
    return evidence[::step], error[::step]


def form_of(samples):
    """Return the quadratic form that fits pairs of (evidence (N, K), error (N,)); all alike."""
    samples = [thinned(*each) for each in samples if len(each[1])]
    inputs = np.concatenate([products(evidence) for evidence, _ in samples])
    right = np.concatenate([error <= RIGHT for _, error in samples])
    first, second = np.triu_indices(samples[0][0].shape[1] + 1)
    joint = (first > 0) & (second > 0)
    return quadratic_form(logistic_fit(inputs, right, equal_shares([len(e) for _, e in samples]),
                                       HOLD + FIRM * joint * inputs.var(axis=0)))

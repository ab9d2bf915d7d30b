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
"""Fit the trust in the third view and what it says of two cameras (models/third.yaml)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .pairs import Pair, simulated
from .regression import equal_shares, logistic_fit
from .spread import fitted_spread, LEAST
from .trust import products, quadratic_form
from ...core import ColorStereo, make_pattern, Settings
from ...core.projector.finding import ProjectorFinder
from ...core.projector.patches import Measured
from ...core.surface.third.fusion import APART_OF_NEIGHBORS, MODEL_NAMES
from ...core.surface.third.fusion_kernels import AGREE, APART, FIRM
from ...core.surface.third.tuning import TUNING

RIGHT = 1.0  # px: what confidence means
STIFF = 1e-3  # as in `trust`
HOLD = 2e-6
FEWEST = 100  # nodes from which a percentile says something
MOST = 9000   # nodes of one pair and one form: more tell nothing new
CORNERS = (0, 0), (0, 1), (1, 0), (1, 1)  # pixels of a node


@dataclass(frozen=True, eq=False)
class Samples:
    """Nodes of one pair; arrays of N."""

    own: np.ndarray
    """float64 (N, 4), of the plane of the third view, see `fusion.Inputs`."""
    evidence: np.ndarray
    """float64 (N, 8), see `fusion.EVIDENCE`."""
    kind: np.ndarray
    """uint8, see `fusion.Inputs`."""
    treated: np.ndarray
    """bool, the third view has a plane."""
    possible: np.ndarray
    """bool, the two cameras may have a range."""
    right_two: np.ndarray
    """Share of the pixels of the node where the plane of the two cameras is right."""
    right_third: np.ndarray
    """The same of the plane of the third view."""
    alone: np.ndarray
    """bool, only left camera and projector see the node."""
    error: np.ndarray
    """Of the plane of the third view at the first pixel of the node, px."""
    variance: np.ndarray
    """Of its least squares, px^2."""
    geometry: np.ndarray
    """By the geometry of the projector, px^2."""


def pairs_of(scenes, options):
    """Return the pairs of this fit: every scene under the default pattern."""
    if options.light:
        folders = [folder for name in scenes
                   for folder in sorted(Path(options.light).glob(f'{name}*'))]
        return [lit_pair(folder, options) for folder in options.progress(folders)]
    return [simulated(name, cache=options.cache, seed=options.seed, quick=options.quick)
            for name in options.progress(scenes)]


def lit_pair(folder, options):
    """Return the Pair of a folder of light, see `stress.light`; its projector is found from it."""
    from ..stress import light
    from ..stress.disturbances import DISTURBANCES
    from ..stress.shot import Shots
    scene, rig = light.load(folder, folder.name), DISTURBANCES['none'].rig(1.0)
    shots = Shots(scene, options.seed)
    pair, truth = shots.pair(rig, 1), shots.truth(rig.mounting)
    near, far = scene.depth_limits
    settings = Settings().updated({'range.min_depth': near, 'range.max_depth': far,
                                   'matching.third_view': 'automatic'})
    result = ColorStereo(scene.calibration, settings).process(*pair)
    size = result.geometry.width, result.geometry.height
    projector = ProjectorFinder(make_pattern(settings.pattern), size).find(
        Measured.of(result)).model
    return Pair(scene.name, scene.calibration, settings, *pair, truth.disparity, truth.visible,
                truth.lit & ~truth.visible, projector)


def fit(pairs, options):
    """Fit to pairs, see `trust.fit`; returns all parameters of models/third.yaml."""
    samples = [samples_of(pair) for pair in options.progress(pairs)]
    report = [f'pairs: {len(samples)}, nodes: {sum(len(each.treated) for each in samples)}']
    return fitted_model(samples), report, left_out([pair.name for pair in pairs], samples)


def left_out(names, samples):
    """
    Return how honest a fit to the other pairs is on each pair.

    Returns
    -------
    found : dict
        Name of a pair to `calibration` (mean distance between predicted and true share of right
        pixels) and `z68` (of the nodes that only left camera and projector see).

    """
    found = {}
    for place, name in enumerate(names if len(names) > 1 else ()):
        model = fitted_model([*samples[:place], *samples[place + 1:]])
        found[name] = {'calibration': round(calibration(model, samples[place]), 4),
                       'z68': round(z68_alone(model, samples[place]), 2)}
    return found


def calibration(model, sample):
    """Return the mean distance between predicted and true share of right pixels, in ten bins."""
    odds, right = judged(model, sample)
    predicted = 1 / (1 + np.exp(-np.clip(odds, -50, 50)))
    bins = np.minimum((10 * predicted).astype(int), 9)
    count, said, true = (np.bincount(bins, weights, 10) for weights in (None, predicted, right))
    return float(np.abs(said - true).sum() / count.sum())


def judged(model, sample):
    """Return the log-odds of every node as the fusion has them, and the share that is right."""
    evidence = with_odds(model['form'], sample)
    two, third = (np.full(len(sample.kind), -np.inf) for _ in range(2))
    for kind, name in ((AGREE, 'agree'), (FIRM, 'firm'), (APART, 'two_apart')):
        at = (sample.kind == kind) & ((kind != APART) | sample.possible)
        two[at] = odds_of(model[name], evidence[at])
    at = (sample.kind == APART) & sample.treated
    third[at] = odds_of(model['third_apart'], evidence[at])
    return np.maximum(two, third), np.where(third > two, sample.right_third, sample.right_two)


def z68_alone(model, sample):
    """Return z68 of the nodes that only left camera and projector see; NaN where there are few."""
    error, variance, distance, geometry = spread_of(model['form'], sample)
    if len(error) < FEWEST:
        return float('nan')
    std = np.sqrt(model['variance_factor'] * variance
                  + (model['std_per_distance'] * distance) ** 2 + geometry)
    return float(np.percentile(error / std, 68))


def spread_of(form, sample):
    """Return error, variance, distance of the neighbors and variance by the geometry; (N,)."""
    used = sample.treated & sample.alone
    used[used] = odds_of(form, sample.own[used]) > 0
    return (np.abs(sample.error[used]), np.maximum(sample.variance[used], LEAST),
            sample.own[used, APART_OF_NEIGHBORS] ** 2,
            TUNING.spread.geometry_share * sample.geometry[used])


def samples_of(pair):
    """Measure a pair with its projector and return its Samples."""
    stereo = ColorStereo(pair.calibration, pair.settings.updated(
        {'matching.third_view': 'automatic'}))
    stereo.use_projector(pair.projector)
    stereo.process(pair.left, pair.right)
    return samples_from(stereo, pair.disparity, pair.alone)


def samples_from(stereo, disparity, alone):
    """
    Return the Samples of the pair that an object has measured last.

    Parameters
    ----------
    stereo : ColorStereo
        The sensor.
    disparity : numpy.ndarray, shape (H, W)
        Truth, px; where it is NaN nothing counts.
    alone : numpy.ndarray, bool, shape (H, W)
        Seen by left camera and projector only.

    """
    method = stereo._method
    third, grid = method.third, method.views.grid
    found = third.found
    given = third.fusion.inputs(found, method.trust.verdict, method.planes)
    inner = grid.inner
    truth = np.stack([disparity[y:2 * grid.rows:2, x:2 * grid.columns:2] for y, x in CORNERS])

    def right(planes):
        d, a, b = (plane[inner].astype(float) for plane in (planes.d, planes.a, planes.b))
        pixels = np.stack([d + 0.5 * (a * (x - 0.5) + b * (y - 0.5)) for y, x in CORNERS])
        return np.mean(np.nan_to_num(np.abs(pixels - truth), nan=1e3) <= RIGHT, axis=0)

    used = (np.isfinite(truth).all(axis=0) & (given.kind > 0)
            & (method.views.left.s[inner] > method.tuning.trust.unlit))
    d, a, b = (each[inner] for each in (found.planes.d, found.planes.a, found.planes.b))
    return Samples(given.own[:, used].T.astype(float), given.evidence[:, used].T.astype(float),
                   given.kind[used], given.treated[used], given.possible[used],
                   right(method.planes)[used], right(found.planes)[used],
                   alone[:2 * grid.rows:2, :2 * grid.columns:2][used],
                   (d - 0.25 * (a + b) - truth[0])[used], found.planes.variance[inner][used],
                   found.geometry[used])


def fitted_model(samples):
    """Return the parameters, a dict of lists, that fit some Samples; each pair counts alike."""
    third = form_of([(each.own[each.treated], each.right_third[each.treated])
                     for each in samples])

    def kept(choose, right):
        chosen = []
        for each in samples:
            evidence, at = with_odds(third, each), choose(each)
            chosen.append((evidence[at], getattr(each, right)[at]))
        return form_of(chosen)

    found = {'form': third,
             'agree': kept(lambda each: each.kind == AGREE, 'right_two'),
             'two_apart': kept(lambda each: (each.kind == APART) & each.possible, 'right_two'),
             'third_apart': kept(lambda each: (each.kind == APART) & each.treated, 'right_third'),
             'firm': kept(lambda each: each.kind == FIRM, 'right_two')}
    factor, slope = fitted_spread([spread_of(third, each) for each in samples])
    return {**{name: np.round(found[name], 3).tolist() for name in MODEL_NAMES},
            'variance_factor': round(factor, 3), 'std_per_distance': round(slope, 3)}


def with_odds(form, sample):
    """Return the evidence of a sample with the log-odds that a form gives the third view."""
    low, high = TUNING.use.odds_limits
    evidence = sample.evidence.copy()
    evidence[:, 1] = np.where(sample.treated, np.clip(odds_of(form, sample.own), low, high), low)
    return evidence


def odds_of(form, evidence):
    """Return x . form x of x = (1, evidence), evidence (N, K)."""
    x = np.concatenate([np.ones((len(evidence), 1)), evidence], axis=1)
    return np.sum((x @ np.asarray(form)) * x, axis=1)


def thinned(evidence, right):
    """Return at most MOST of the samples, evenly chosen."""
    step = max(1, len(right) // MOST)
    return evidence[::step], right[::step]


def form_of(samples):
    """Return the quadratic form that fits pairs of (evidence (N, K), share (N,)); all alike."""
    samples = [thinned(*each) for each in samples if len(each[1])]
    inputs = np.concatenate([products(evidence) for evidence, _ in samples])
    right = np.concatenate([share for _, share in samples])
    first, second = np.triu_indices(samples[0][0].shape[1] + 1)
    joint = (first > 0) & (second > 0)
    return quadratic_form(logistic_fit(inputs, right, equal_shares([len(e) for e, _ in samples]),
                                       HOLD + STIFF * joint * inputs.var(axis=0)))

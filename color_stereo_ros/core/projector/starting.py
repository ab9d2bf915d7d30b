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
"""
Starts of the adjustment: geometries that explain some of the matches roughly.

Two kinds of start do not fail together. The linear fit of a 3 x 4 projection (Hartley and
Zisserman 2004, 7.1) needs no prior, but depth: it is useless where the scene is nearly flat. The
pose under a given field of view works on a plane, too, but the field of view is a guess.

"""

import cv2
import numpy as np

from .adjustment import lens_of, model_of, usual_prior
from .tuning import TUNING

TINY = np.finfo(np.float64).tiny


def starts(evidence, size, earlier=None):
    """
    Yield models from which the adjustment may start.

    Parameters
    ----------
    evidence : Evidence
        Where the patches of the pattern were found.
    size : (int, int)
        Width and height of the pattern, px.
    earlier : ProjectorModel, optional
        The geometry of an earlier pair.

    Yields
    ------
    model : ProjectorModel

    """
    if earlier is not None:
        yield earlier
        yield from posed(evidence, lens_of(earlier), size)
    mean = usual_prior(size, 1.0).mean
    for degrees in TUNING.start.fields_of_view:
        lens = mean.copy()
        lens[0] = np.log(0.5 / np.tan(np.radians(degrees) / 2))
        yield from posed(evidence, lens, size)
    yield from linear(evidence, size)


def posed(evidence, lens, size):
    """
    Yield the pose that explains most matches under a known lens, if there is one.

    OpenCV 5 refuses points whose variance is below 1e-5: a scene of some millimeters, in meters.
    So the points are scaled. Samples that lie on one spot are still refused.

    """
    tuning = TUNING.start
    guess = model_of(lens, np.eye(3), np.zeros(3), size)
    reach = max(evidence.points.std(), TINY)
    try:
        done, turn, translation, _ = cv2.solvePnPRansac(
            (evidence.points / reach).reshape(-1, 1, 3), evidence.places.reshape(-1, 1, 2),
            np.array(guess.camera_matrix), None, iterationsCount=tuning.tries,
            reprojectionError=tuning.reach * size[0], flags=cv2.SOLVEPNP_SQPNP)
    except cv2.error:
        return
    if done and np.isfinite(turn).all() and np.isfinite(translation).all():
        yield model_of(lens, cv2.Rodrigues(turn)[0], reach * translation.ravel(), size)


def linear(evidence, size):
    """Yield the linear fit of a projection to those matches that agree with it, if any."""
    tuning = TUNING.start
    count = len(evidence)
    if count < 2 * tuning.least:
        return
    random = np.random.default_rng(tuning.seed)
    points, places = evidence.points, evidence.places
    samples = np.stack([random.choice(count, tuning.least, replace=False)
                        for _ in range(tuning.tries)])
    projections = np.stack([projection(points[each], places[each]) for each in samples])
    errors = _errors(projections, points, places)
    best = errors < tuning.close * size[0]
    chosen = best[np.argmax(best.sum(axis=1))]
    for _ in range(tuning.repeats):
        if np.count_nonzero(chosen) < tuning.least:
            return
        found = projection(points[chosen], places[chosen])
        chosen = _errors(found[None], points, places)[0] < tuning.close * size[0]
    model = decomposed(found, points[chosen], size)
    if model is not None:
        yield model


def _errors(projections, points, places):
    """Return the distances (M, N), px; inf behind the projector."""
    x, y, depth = np.moveaxis(
        np.einsum('mij,nj->mni', projections[:, :, :3], points) + projections[:, None, :, 3],
        -1, 0)
    with np.errstate(all='ignore'):
        error = np.hypot(x / depth - places[:, 0], y / depth - places[:, 1])
    return np.where(np.isfinite(error), error, np.inf)


def projection(points, places):
    """
    Return the 3 x 4 projection that explains points best (Hartley and Zisserman 2004, alg. 7.1).

    Parameters
    ----------
    points : numpy.ndarray, float64, shape (N, 3)
        N >= 6.
    places : numpy.ndarray, float64, shape (N, 2)
        Column and row in the pattern, px.

    Returns
    -------
    projection : numpy.ndarray, float64, shape (3, 4)
        Of norm 1; its sign is open.

    """
    middle, center = points.mean(axis=0), places.mean(axis=0)
    reach = max(np.abs(points - middle).max(), TINY)
    extent = max(np.abs(places - center).max(), TINY)
    X = np.column_stack([(points - middle) / reach, np.ones(len(points))])
    u, v = ((places - center) / extent).T
    nothing = np.zeros_like(X)
    equations = np.vstack([np.hstack([X, nothing, -u[:, None] * X]),
                           np.hstack([nothing, X, -v[:, None] * X])])
    _, vectors = np.linalg.eigh(equations.T @ equations)
    back = np.array([[extent, 0, center[0]], [0, extent, center[1]], [0, 0, 1]])
    into = np.eye(4)
    into[:3] /= reach
    into[:3, 3] = -middle / reach
    found = back @ vectors[:, 0].reshape(3, 4) @ into
    return found / np.linalg.norm(found)


def decomposed(found, points, size):
    """Return the model of a projection with points in front of it; None where there is none."""
    if np.linalg.det(found[:, :3]) == 0:
        return None
    if np.mean(points @ found[2, :3] + found[2, 3] > 0) < 0.5:
        found = -found
    # M = K R: the RQ decomposition
    K, rotation = cv2.RQDecomp3x3(found[:, :3])[1:3]
    signs = np.sign(np.diag(K))
    K, rotation = K * signs, signs[:, None] * rotation
    translation = np.linalg.solve(K, found[:, 3])
    K = K / K[2, 2]
    if np.linalg.det(rotation) < 0 or not np.isfinite(K).all():
        return None  # mirrored
    width = size[0]
    lens = np.array([np.log(K[0, 0] / width), np.log(K[1, 1] / K[0, 0]), K[0, 1] / K[0, 0],
                     K[0, 2] / width, K[1, 2] / width, 0.0])
    return model_of(lens, rotation, translation, size)

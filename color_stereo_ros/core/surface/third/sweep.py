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
Where the pattern lights a node of the left image, as a function of the disparity.

With the ray r = ((x - cx) / fx, (y - cy) / fy, 1) of a rectified left pixel and its distance
Z = f B / (d - d0), the point is X = Z r. In the frame of the projector R X + t is proportional to

    R r + t (d - d0) / (f B)

which is linear in x, y and d. The projector needs no rectification: every disparity of the two
cameras names one place of the pattern, along an epipolar line of any direction.

"""

import cv2
import numpy as np

from .tuning import TUNING
from ...projector.adjustment import predicted, to_unknowns

F4 = np.float32


def sweep_matrix(model, geometry):
    """
    Return the matrix that takes (x, y, 1, d) to homogeneous pixels of the pattern.

    Parameters
    ----------
    model : ProjectorModel
        Its lens distortion is not part of the matrix, see `straightened`.
    geometry : RectifiedGeometry
        Of the rectified pair.

    Returns
    -------
    sweep : numpy.ndarray, float64, shape (3, 4)

    """
    ray = np.array([[1 / geometry.focal_x, 0, -geometry.center_x_left / geometry.focal_x],
                    [0, 1 / geometry.focal_y, -geometry.center_y / geometry.focal_y],
                    [0, 0, 1]])
    plane = model.camera_matrix @ model.rotation @ ray
    shift = model.camera_matrix @ model.translation / geometry.focal_baseline
    sweep = np.column_stack([plane, shift])
    sweep[:, 2] -= shift * geometry.principal_offset
    return sweep


def places(sweep, x, y, d):
    """Return column and row of the pattern, px, that light pixels (x, y) at disparities d."""
    u, v, w = np.tensordot(sweep, np.stack(np.broadcast_arrays(x, y, 1.0, d)), axes=1)
    w = np.where(w > 0, w, np.nan)
    return u / w, v / w


def straightened(pattern, model, rows=slice(None)):
    """
    Return the pattern as a projector without distortion would have to show it.

    Parameters
    ----------
    pattern : numpy.ndarray, shape (H, W, 3)
        The image that the projector shows, linear light.
    model : ProjectorModel
        Geometry of the projector.
    rows : slice
        The rows of the result.

    Returns
    -------
    pattern : numpy.ndarray, float32, shape (h, W, 3)
        Linear light 0..1.

    """
    if not model.distortion:
        return _light(pattern[rows])
    u, v = unbent_places(model, pattern.shape[:2], rows)
    reach = 2  # of the cubic, px
    first = max(int(np.floor(v.min())) - reach, 0)
    last = max(int(np.ceil(v.max())) + reach + 1, 1)
    first = min(first, len(pattern) - 1)
    v -= F4(first)
    return cv2.remap(_light(pattern[first:last]), u, v, cv2.INTER_CUBIC,
                     borderMode=cv2.BORDER_REPLICATE)


def _light(pattern):
    """Return a pattern as light 0..1, float32."""
    light = pattern.astype(F4)
    if pattern.dtype == np.uint8:
        light *= F4(TUNING.sweep.unit)
    return light


def unbent_places(model, shape, rows):
    """Return what a lens shows at the places of an ideal one: float32 u and v of some rows."""
    u, v = np.arange(shape[1], dtype=F4), np.arange(shape[0], dtype=F4)[rows, None]
    (fx, skew, cu), (_, fy, cv), _ = model.camera_matrix
    y = (v - F4(cv)) * F4(1 / fy)
    x = (u - F4(cu) - F4(skew) * y) * F4(1 / fx)
    stretch = F4(model.distortion) * (x * x + y * y)
    # K (1 + k r^2) (x, y) = (u, v) + k r^2 K (x, y)
    return u + stretch * (u - F4(cu)), v + stretch * (v - F4(cv))


def prepared_for(model, prepared, geometry, limits):
    """
    Return for which model the pattern is straightened and blurred, when another was before.

    From pair to pair a model changes by little. The images of the pattern take longer than a pair,
    and are kept until they would be wrong by what counts.

    Parameters
    ----------
    model : ProjectorModel
        Of this pair.
    prepared : ProjectorModel or None
        That of the images so far.
    geometry : RectifiedGeometry
        Of the rectified pair.
    limits : numpy.ndarray, shape (2,)
        Smallest and largest disparity, px.

    Returns
    -------
    prepared : ProjectorModel
        The same object, or the model of this pair.

    """
    tuning = TUNING.sweep
    if model is prepared:
        return model
    if prepared is None or prepared.size != model.size:
        return model
    if lens_change(model, prepared)[1] > tuning.prepared_places:
        return model
    middle = float(np.mean(limits))
    sweeps = [sweep_matrix(each, geometry) for each in (model, prepared)]
    for measure in (magnification, places_per_disparity):
        new, old = (measure(sweep, geometry, middle) for sweep in sweeps)
        if not abs(new - old) < tuning.prepared_scale * old:
            return model
    return prepared


def lens_change(model, prepared):
    """
    Return what takes places of one projector to the images of the pattern made for another one.

    An image that was straightened for one lens shows the light of a slightly different lens almost
    at an affine map of its places: a change of k1 is mostly one of scale.

    Parameters
    ----------
    model, prepared : ProjectorModel
        Of the places, and of the images.

    Returns
    -------
    change : numpy.ndarray, float64, shape (3, 3)
        Of homogeneous places, px of the pattern.
    apart : float
        By how much this is off at most, px.

    """
    (width, height), count = model.size, TUNING.sweep.lens_samples
    u, v = np.meshgrid(np.linspace(0, width - 1, count), np.linspace(0, height - 1, count))
    pixels = np.stack([u, v, np.ones_like(u)], axis=-1).reshape(-1, 3)

    def moved(lens):
        rays = pixels @ np.linalg.inv(lens.camera_matrix).T
        stretch = lens.distortion * (rays[:, :1] ** 2 + rays[:, 1:2] ** 2)
        return (stretch * rays)[:, :2] @ lens.camera_matrix[:2, :2].T

    away = moved(model) - moved(prepared)
    fitted = np.linalg.lstsq(pixels, away, rcond=None)[0]
    change = np.eye(3)
    change[:2] += fitted.T
    return change, float(np.abs(away - pixels @ fitted).max())


def geometry_variance(model, geometry, d):
    """
    Return what the uncertainty of the projector does to a disparity over the image.

    Parameters
    ----------
    model : ProjectorModel
        Geometry of the projector.
    geometry : RectifiedGeometry
        Of the rectified pair.
    d : float
        px.

    Returns
    -------
    variance : numpy.ndarray, float64, shape (h, w)
        px^2, at places that divide the image evenly.

    """
    (w, h), least = TUNING.sweep.samples, TUNING.sweep.least_shift
    if not model.covariance.any():
        return np.zeros((h, w))
    x, y = np.meshgrid((np.arange(w) + 0.5) * geometry.width / w - 0.5,
                       (np.arange(h) + 0.5) * geometry.height / h - 0.5)
    depth = geometry.focal_baseline / max(d - geometry.principal_offset, least)
    points = depth * np.stack([(x - geometry.center_x_left) / geometry.focal_x,
                               (y - geometry.center_y) / geometry.focal_y,
                               np.ones_like(x)], axis=-1).reshape(-1, 3)
    jacobian, along = predicted(model, points)[1:3]
    # dZ = -Z^2 / (f B) dd
    along = along * -depth ** 2 / geometry.focal_baseline
    square = np.maximum(np.sum(along ** 2, axis=1), least)
    gain = np.einsum('ni,nij->nj', along, jacobian) / square[:, None]
    return np.einsum('ni,ij,nj->n', gain, to_unknowns(model), gain).reshape(h, w)


def packed(light):
    """Return light 0..1, float (H, W, 3), in the bytes of uint32 (H W,); light < 0 becomes 0."""
    np.maximum(light, 0, out=light)
    pixels = cv2.convertScaleAbs(light, alpha=1 / TUNING.sweep.unit)
    return cv2.merge([*cv2.split(pixels), np.zeros(pixels.shape[:2], np.uint8)]).view(
        np.uint32).reshape(-1)


def magnification(sweep, geometry, d):
    """Return how many pixels of the pattern light one pixel in the middle of the left image."""
    x, y = geometry.width / 2, geometry.height / 2
    (u, v) = places(sweep, np.array([x, x + 1, x]), np.array([y, y, y + 1]), d)
    across = np.array([[u[1] - u[0], u[2] - u[0]], [v[1] - v[0], v[2] - v[0]]])
    return float(np.sqrt(abs(np.linalg.det(across))))


def places_per_disparity(sweep, geometry, d):
    """Return how many pixels of the pattern a disparity of 1 px moves the place, in the middle."""
    u, v = places(sweep, geometry.width / 2, geometry.height / 2, np.array([d - 0.5, d + 0.5]))
    return float(np.hypot(u[1] - u[0], v[1] - v[0]))

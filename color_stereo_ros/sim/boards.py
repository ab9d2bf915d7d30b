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
Exact images of calibration boards, and where their corners lie.

Mitsuba is not needed. Every pixel has cells, each the mean of the drawing over its area: through
the lens, by many samples where an edge crosses it. The lens blurs the cells, the pixel is their
mean, and the electronics of the rig follow. A blur of whole pixels is no lens: its weights at
distances of 0, 1, 2 px make the profile of an edge a polygon, which moves corners by .01 px.

"""

from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np

from .board_kernels import board_means
from .electronics import expose
from .fields import Reader
from .geometry import Pose
from .rig import read_camera

LEVELS = (0.04, 0.82, 0.3)  # radiance of black, white and the surroundings; print on cardboard
FINE = 4        # cells of a pixel along either axis; the blur of .5 px spans enough of them
BORDER = 0.01   # m of white paper around the squares
BENDS = 3       # steps that find where a ray meets a bent board; the bend is small
FAR = 1e3       # m; a ray that meets the plane beyond sees the surroundings


@dataclass(frozen=True, eq=False)
class BoardView:
    """What one camera sees of a board, with the truth."""

    image: np.ndarray
    """uint8 (H, W, 3), raw RGB; what `electronics.expose` returns for other settings."""
    pixels: np.ndarray
    """float64 (N, 2), exact column and row of every corner, px; also outside of the image."""
    inside: np.ndarray
    """bool (N,), whether the corner lies in the image."""


def board_camera(model, **electronics):
    """
    Return the simulated camera of a calibrated one.

    Parameters
    ----------
    model : color_stereo_ros.core.cameras.calibration.CameraModel
        The camera as calibrated.
    **electronics
        Fields of a camera of a rig (docs/simulation.md), for example `bayer='none'`.

    Returns
    -------
    camera : Camera
        Exposure 1 and a lens blur of 0.5 px where they are not given.

    """
    K = model.K
    fields = {'width': model.width, 'height': model.height, 'focal': [K[0, 0], K[1, 1]],
              'center': [K[0, 2], K[1, 2]], 'skew': K[0, 1],
              'distortion_model': model.distortion_model, 'distortion': model.D.tolist(),
              'exposure': 1.0, 'lens_blur': 0.5, **electronics}
    return read_camera(model.name, Reader(fields, f'camera {model.name}', None))


def board_view(camera, board, pose, *, seed=0, bend=(0.0, 0.0), levels=LEVELS, border=BORDER):
    """
    Render what a camera sees of a board.

    Parameters
    ----------
    camera : Camera
        Of a rig, or from `board_camera`; its place does not matter.
    board : color_stereo_ros.calibration.boards.Board
        The calibration board.
    pose : Pose
        Camera frame from board frame.
    seed : int or numpy.random.SeedSequence
        Of the noise.
    bend : (float, float)
        Bow along x and along y, m: the middle of the board lies so much farther along its z
        than the edges of the outline, z = b (1 - s^2) with s = -1 .. 1 from edge to edge.
    levels : (float, float, float)
        Radiance of black, white and the surroundings.
    border : float
        Width of the white paper around the squares, m.

    Returns
    -------
    view : BoardView

    """
    drawing = board.drawing
    cells = np.empty((FINE * camera.shape[0], FINE * camera.shape[1]), np.float32)
    board_means(_plane_points(camera, board, pose, bend), drawing.x, drawing.y, drawing.dark,
                np.ascontiguousarray(drawing.disks, np.float64), border,
                np.array(levels, np.float64), cells)
    if camera.lens_blur > 0:
        cells = cv2.GaussianBlur(cells, (0, 0), FINE * camera.lens_blur)
    radiance = cv2.resize(cells, camera.shape[::-1], interpolation=cv2.INTER_AREA)
    image = expose(np.repeat(radiance[..., None].astype(np.float64), 3, axis=2),
                   replace(camera, lens_blur=0.0), camera.exposure or 1.0, seed)
    corners = board.corners.copy()
    corners[:, 2] = bent(corners[:, :2], board.size_m, bend)
    local = pose.to_parent(corners)
    pixels = np.full((len(corners), 2), np.nan)
    ahead = local[:, 2] > 1e-6
    pixels[ahead] = np.column_stack(camera.pixels(camera.lens.distort(
        local[ahead, :2] / local[ahead, 2:], camera.D)))
    inside = ((pixels >= -0.5) & (pixels < np.array(camera.shape[::-1]) - 0.5)).all(axis=1)
    return BoardView(image, pixels, inside)


def board_pair(calibration, board, pose, *, seed=0, bend=(0.0, 0.0), levels=LEVELS,
               border=BORDER, **electronics):
    """
    Render what both cameras of a calibrated pair see of a board.

    Parameters
    ----------
    calibration : StereoCalibration
        Of the two cameras.
    board : Board
        The calibration board.
    pose : Pose
        Left camera's frame from board frame.
    seed : int
        Of the noise; the same seed gives the same bytes.
    bend, levels, border
        See `board_view`.
    **electronics
        See `board_camera`.

    Returns
    -------
    left, right : BoardView

    """
    rotation, translation = calibration.right_from_left
    poses = pose, Pose(rotation, translation) @ pose
    return tuple(
        board_view(board_camera(model, **electronics), board, place, bend=bend, levels=levels,
                   border=border, seed=np.random.SeedSequence([seed, side]))
        for side, (model, place) in enumerate(zip((calibration.left, calibration.right), poses)))


def bent(points, size, bend):
    """Return z of points (N, 2) of a board of some size with a bow, m; see `board_view`."""
    share = 2 * np.asarray(points) / np.asarray(size) - 1
    return (1 - share ** 2) @ np.asarray(bend, np.float64)


def _plane_points(camera, board, pose, bend):
    """Return what the corners of the pixels see of the board, float64 (H + 1, W + 1, 2), m."""
    rays = _corner_rays(camera.lens, camera.shape, camera.K.tobytes(), camera.D.tobytes())
    directions = rays @ pose.rotation
    origin = pose.to_child(np.zeros(3))
    with np.errstate(divide='ignore', invalid='ignore'):
        along = -origin[2] / directions[..., 2]
        for _ in range(BENDS if np.any(bend) else 0):
            points = origin[:2] + along[..., None] * directions[..., :2]
            # Beyond the board the bow would not be small any more.
            held = np.clip(points, 0.0, np.array(board.size_m))
            height = bent(held.reshape(-1, 2), board.size_m, bend).reshape(along.shape)
            along = (height - origin[2]) / directions[..., 2]
        points = origin[:2] + along[..., None] * directions[..., :2]
    points[~((along > 0) & (along < FAR))] = np.nan
    return points


@lru_cache(maxsize=4)
def _corner_rays(lens, shape, K, D):
    """Return the rays of the corners of all pixels, float64 (H + 1, W + 1, 3), z = 1."""
    row, column = np.indices((shape[0] + 1, shape[1] + 1)) - 0.5
    pixels = np.column_stack([column.ravel(), row.ravel()])
    rays = lens.undistort(pixels, np.frombuffer(K).reshape(3, 3), np.frombuffer(D))
    return np.column_stack([rays, np.ones(len(rays))]).reshape(*row.shape, 3)

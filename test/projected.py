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
"""Pairs of a wall and a plate before it, lit by a projector beside the cameras, with truth."""

from functools import lru_cache

from color_stereo_ros.core import make_pattern, PatternSettings
from color_stereo_ros.core.projector.model import COUNT, ProjectorModel
import cv2
import numpy as np
from surface_pairs import BASELINE, exposed, FOCAL, rig

WIDTH, HEIGHT = 320, 240
PATTERN = PatternSettings(width=512, height=384, feature_size=9.0)
WALL, PLATE = 0.5, 0.4         # m
EDGES = (-0.06, 0.05, -0.05, 0.06)  # left, right, upper and lower edge of the plate, m
PHOTO = -0.13, -0.07, -0.06, 0.06   # left, right, upper and lower edge of a photograph, m
MIRROR = 0.16                  # m, right of the left camera: a mirror along its axis
SAMPLES = 2                    # per pixel and direction
CALIBRATION = rig(WIDTH, HEIGHT)
LIMITS = FOCAL * BASELINE / 0.6, FOCAL * BASELINE / 0.34


def projector(distortion=0.0):
    """Return a projector to the right of and above the left camera, turned a little."""
    rotation = cv2.Rodrigues(np.array([-0.12, -0.08, 0.02]))[0]
    camera_matrix = np.array([[470.0, 0, 255.5], [0, 470.0, 191.5], [0, 0, 1]])
    return ProjectorModel(camera_matrix, distortion, rotation,
                          -rotation @ np.array([0.05, -0.06, 0.0]), (512, 384),
                          np.zeros((COUNT, COUNT)))


def surface(eye_x, x, y, plate=True):
    """Return where rays of a camera at (eye_x, 0, 0) end, m, float64 (..., 3)."""
    rays = np.stack([(x - (WIDTH - 1) / 2) / FOCAL, (y - (HEIGHT - 1) / 2) / FOCAL,
                     np.ones_like(x)], axis=-1)
    eye = np.array([eye_x, 0.0, 0.0])
    near = eye + PLATE * rays
    return np.where(on_plate(near)[..., None] & plate, near, eye + WALL * rays)


def on_plate(points):
    """Return which points of the plane of the plate lie on it."""
    left, right, upper, lower = EDGES
    return ((points[..., 0] > left) & (points[..., 0] < right) & (points[..., 1] > upper)
            & (points[..., 1] < lower))


def free(points, eye, plate=True):
    """Return which points of wall and plate see an eye, float64 (3,), that is at Z = 0."""
    share = PLATE / points[..., 2:3]
    crossing = eye + share * (points - eye)
    return (points[..., 2] < (PLATE + WALL) / 2) | ~on_plate(crossing) | (not plate)


def photographed(points, pattern):
    """Return the albedo of points of the wall on which a photograph of the pattern lies."""
    left, right, upper, lower = PHOTO
    height, width = pattern.shape[:2]
    x = ((points[..., 0] - left) / (right - left) * width).astype(int)
    y = ((points[..., 1] - upper) / (lower - upper) * height).astype(int)
    there = (points[..., 2] > (PLATE + WALL) / 2) & (x >= 0) & (y >= 0) & (x < width) & (
        y < height)
    return np.where(there[..., None],
                    pattern[np.where(there, y, 0), np.where(there, x, 0)] / 255, 1.0)


def light(eye_x, pattern, model, paint, plate=True, photo=False):
    """
    Return what a camera sees, float64 (H, W, 3), 0..1.

    paint: factors of the plate, RGB; photo: a photograph of the pattern lies on the wall.

    """
    offsets = (np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5
    x, y = np.meshgrid(np.add.outer(np.arange(WIDTH), offsets).ravel(),
                       np.add.outer(np.arange(HEIGHT), offsets).ravel())
    points = surface(eye_x, x, y, plate)
    u, v = model.project(points)
    seen = cv2.remap(pattern.astype(np.float32) / 255, u.astype(np.float32),
                     v.astype(np.float32), cv2.INTER_CUBIC).clip(0)
    seen = seen * free(points, model.center, plate)[..., None]
    seen = np.where((points[..., 2] < (PLATE + WALL) / 2)[..., None], seen * paint, seen)
    if photo:
        seen = seen * photographed(points, pattern)
    return seen.reshape(HEIGHT, SAMPLES, WIDTH, SAMPLES, 3).mean(axis=(1, 3))


def shown(seed, what):
    """Return what the projector shows, uint8 (384, 512, 3)."""
    pattern = make_pattern(PatternSettings(width=512, height=384, feature_size=9.0, seed=seed))
    if what == 'mirrored':
        return pattern[:, ::-1]
    if what == 'menu':
        pattern[...] = (30, 60, 160)
        for row, text in enumerate(('PICTURE', 'INPUT: HDMI 1', 'KEYSTONE  +12', 'LAMP  ECO')):
            cv2.putText(pattern, text, (90, 90 + 70 * row), cv2.FONT_HERSHEY_SIMPLEX, 1.4,
                        (250, 250, 250), 3)
    return pattern


def moved(x=0.0, y=0.0, z=0.0, turn=(0.0, 0.0, 0.0)):
    """Return the projector after it was moved by some m, and turned by some radians."""
    rotation = cv2.Rodrigues(np.array(turn))[0]
    model = projector()
    return model.but(rotation=rotation @ model.rotation,
                     translation=rotation @ model.translation + [x, y, z])


def others(what):
    """Return what lights the scene beside the projector: (share of the light, ProjectorModel)."""
    if what == 'two':
        rotation = cv2.Rodrigues(np.array([0.1, 0.12, 0.0]))[0]
        return [(0.7, projector().but(rotation=rotation,
                                      translation=-rotation @ np.array([-0.08, 0.05, 0.0])))]
    if what == 'mirror':  # what the mirror reflects comes from a projector behind it
        model, flip = projector(), np.diag([-1.0, 1.0, 1.0])
        return [(0.7, model.but(
            rotation=model.rotation @ flip,
            translation=model.translation + model.rotation @ [2 * MIRROR, 0, 0]))]
    return []


@lru_cache(maxsize=16)
def pair(seed=PATTERN.seed, paint=(1.0, 1.0, 1.0), noise=1, what='pattern', shift=(0.0, 0.0, 0.0),
         plate=True, turn=(0.0, 0.0, 0.0)):
    """
    Return left and right image, uint8 (H, W, 3), under the pattern of a seed.

    what: 'pattern', 'mirrored', 'menu', 'two' (projectors), 'mirror' (beside the scene) or
    'photo' (of the pattern, on the wall); shift, turn: by which the projector was moved, m, and
    turned, radians; plate: whether it is there.

    """
    pattern, paint = shown(seed, what), np.array(paint)
    rng = np.random.default_rng(noise)
    lamps = [(1.0, moved(*shift, turn)), *others(what)]
    return tuple(exposed(sum(share * light(eye, pattern, lamp, paint, plate, what == 'photo')
                             for share, lamp in lamps) / max(1.0, sum(
                                 share for share, _ in lamps)), rng)
                 for eye in (0.0, BASELINE))


def truth():
    """Return disparity, and which pixels are lit and which the right camera sees, too (H, W)."""
    x, y = np.meshgrid(np.arange(WIDTH, dtype=float), np.arange(HEIGHT, dtype=float))
    points = surface(0.0, x, y)
    disparity = FOCAL * BASELINE / points[..., 2]
    u, v = projector().project(points)
    lit = (free(points, projector().center) & (u > 3) & (v > 3) & (u < 508) & (v < 380))
    visible = lit & free(points, np.array([BASELINE, 0, 0])) & (x - disparity >= 0)
    return disparity, lit, visible

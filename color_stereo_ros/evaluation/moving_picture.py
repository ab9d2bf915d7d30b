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
The moving picture of README: a pair under the pattern, its depth, and its points as they turn.

`python -m color_stereo_ros.evaluation.moving_picture docs/result.webp` needs the extras
[sim,tools]. The scene is path-traced; what is measured is drawn as it is.

"""

import argparse
import io
from pathlib import Path

import cv2
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
import numpy as np
from PIL import Image

from .stress.disturbances import DISTURBANCES
from .stress.light import LightScenes, MAIN
from .stress.shot import Shots
from ..core import ColorStereo, Settings
from ..core.false_color import false_color, range_limits
from ..core.legends import with_scale_bar
from ..files.atomic import write_bytes

SCENE = 'casting'
HEIGHT = 360                 # px of a panel
TITLE, GAP = 36, 12          # px
INK, BACKGROUND = 0.95, 0.13   # gray, 0..1; unknown pixels are black
TITLES = 'Left and right image', 'Depth', 'Point cloud'
FRAMES, DURATION = 48, 100   # pictures of a round, ms of each
YAW, PITCH = 30, 18          # degrees to either side
FINE = 2                     # drawn pixels in each pixel along either axis
POINT = 3                    # drawn pixels, width of a point: no gaps between neighbors
LIGHT = -0.24, -0.32, -0.9165  # unit vector towards the light
AMBIENT = 0.35               # share of the light that does not depend on the normal
QUALITY = 75                 # of the WebP


def measured(scene, seed=1):
    """
    Take a pair of a scene and measure it.

    Parameters
    ----------
    scene : color_stereo_ros.evaluation.stress.light.LightScene
        Its light, before lens and electronics.
    seed : int
        Of the noise.

    Returns
    -------
    pair : tuple of numpy.ndarray, uint8, shape (H, W, 3)
        Left and right image, RGB.
    result : color_stereo_ros.core.RangeResult
    limits : (float, float)
        Of the colors of its depth, m.

    """
    rig = DISTURBANCES['none'].rig(0)
    pair = Shots(scene, seed).pair(rig)
    near, far = scene.depth_limits
    settings = Settings().updated({'range.min_depth': near, 'range.max_depth': far,
                                   **rig.settings})
    result = ColorStereo(scene.calibration, settings).process(*pair)
    return pair, result, range_limits(result.depth, settings.range, 'automatic')


def pictures(pair, result, limits, count=FRAMES):
    """
    Draw all pictures of one round.

    Parameters
    ----------
    pair : tuple of numpy.ndarray, uint8, shape (H, W, 3)
        Left and right image, RGB.
    result : color_stereo_ros.core.RangeResult
        What was measured from the pair.
    limits : (float, float)
        Of the colors of the depth, m.
    count : int
        Pictures of a round.

    Yields
    ------
    picture : numpy.ndarray, uint8, shape (H', W', 3)
        RGB. The first one follows the last one.

    """
    colors = false_color(result.depth, *limits)
    resting = [stacked(*(scaled(image, (HEIGHT - GAP) // 2) for image in pair)),
               with_scale_bar(scaled(colors, HEIGHT, cv2.INTER_NEAREST), *limits)]
    cloud = Cloud(result, colors)
    canvas, places = laid_out([*resting, cloud.seen(0, 0, HEIGHT)])
    for place, panel in zip(places, resting):
        canvas[place] = panel
    for angle in np.linspace(0, 2 * np.pi, count, endpoint=False):
        canvas[places[-1]] = cloud.seen(YAW * np.sin(angle), PITCH * np.cos(angle), HEIGHT)
        yield canvas.copy()


def stacked(above, below):
    """Return two images of one size with a gap between them."""
    gap = np.full((HEIGHT - 2 * len(above), *above.shape[1:]), round(255 * BACKGROUND), np.uint8)
    return np.vstack([above, gap, below])


def scaled(image, height, interpolation=cv2.INTER_AREA):
    """Return an image of another height, px, and of the same shape."""
    width = round(image.shape[1] * height / image.shape[0])
    return cv2.resize(image, (width, height), interpolation=interpolation)


class Cloud:
    """
    The points of a result, to be drawn from any side.

    Parameters
    ----------
    result : color_stereo_ros.core.RangeResult
        Its known points are drawn.
    colors : numpy.ndarray, uint8, shape (H, W, 3)
        RGB of every pixel.

    """

    def __init__(self, result, colors):
        points, normals = result.points(), result.normals()
        known = np.isfinite(points).all(axis=-1) & np.isfinite(normals).all(axis=-1)
        self._points, self._normals = points[known], normals[known]
        self._colors = colors[known].astype(np.float32)
        self._middle = np.median(self._points, axis=0)
        self._camera = result.geometry

    def seen(self, yaw, pitch, height):
        """
        Draw the points as the rectified left camera sees them.

        Parameters
        ----------
        yaw, pitch : float
            Degrees by which the cloud is turned about its middle.
        height : int
            px.

        Returns
        -------
        picture : numpy.ndarray, uint8, shape (height, W, 3)
            RGB.

        """
        camera, scale = self._camera, FINE * height / self._camera.height
        turn = turned(yaw, pitch)
        x, y, z = turn @ (self._points - self._middle).T + self._middle[:, None]
        lit = AMBIENT + (1 - AMBIENT) * np.clip(LIGHT @ turn @ self._normals.T, 0, 1)
        colors = self._colors * lit[:, None]
        column = np.rint(scale * (camera.focal_x * x / z + camera.center_x_left)).astype(int)
        row = np.rint(scale * (camera.focal_y * y / z + camera.center_y)).astype(int)
        return scaled(splat(row, column, z, colors, (FINE * height,
                                                     round(scale * camera.width))), height)


def splat(row, column, depth, colors, shape):
    """
    Draw points as squares, near ones over far ones.

    Parameters
    ----------
    row, column : numpy.ndarray, int, shape (N,)
        px; what lies outside is left out.
    depth : numpy.ndarray, float, shape (N,)
        The nearest point wins.
    colors : numpy.ndarray, shape (N, 3)
        0 .. 255.
    shape : (int, int)
        Rows and columns, px.

    Returns
    -------
    picture : numpy.ndarray, uint8, shape (H, W, 3)

    """
    picture = np.zeros((*shape, 3), np.uint8)
    far_first = np.argsort(-depth)
    row, column, colors = row[far_first], column[far_first], colors[far_first]
    half = POINT // 2
    inside = ((row >= half) & (row < shape[0] - half)
              & (column >= half) & (column < shape[1] - half))
    row, column, colors = row[inside], column[inside], colors[inside]
    nearest = np.full(shape, -1)
    for down in range(-half, half + 1):
        for right in range(-half, half + 1):
            found = np.full(shape, -1)
            found[row + down, column + right] = np.arange(len(row))  # the last one stays
            np.maximum(nearest, found, out=nearest)
    drawn = nearest >= 0
    picture[drawn] = colors[nearest[drawn]]
    return picture


def turned(yaw, pitch):
    """Return the rotation matrix by yaw about y, then by pitch about x; degrees."""
    return cv2.Rodrigues(np.radians((pitch, 0.0, 0.0)))[0] @ cv2.Rodrigues(
        np.radians((0.0, yaw, 0.0)))[0]


def laid_out(panels):
    """Return the canvas with its titles, uint8 (H, W, 3), RGB, and the slices of the panels."""
    edges = np.cumsum([GAP, *(panel.shape[1] + GAP for panel in panels)])
    width, height = int(edges[-1]), TITLE + HEIGHT + GAP
    figure = Figure(figsize=(width / 100, height / 100), dpi=100, facecolor=str(BACKGROUND))
    for edge, title in zip(edges, TITLES):
        figure.text(edge / width, 1 - 0.5 * TITLE / height, title, color=str(INK), fontsize=14,
                    verticalalignment='center')
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    picture = np.array(canvas.buffer_rgba())[..., :3]
    rows = slice(TITLE, TITLE + HEIGHT)
    return picture, [(rows, slice(edge, edge + panel.shape[1]))
                     for edge, panel in zip(edges, panels)]


def as_webp(frames):
    """Return pictures, uint8 (H, W, 3), RGB, as the bytes of an animated WebP without end."""
    first, *others = map(Image.fromarray, frames)
    stream = io.BytesIO()
    first.save(stream, 'WEBP', save_all=True, append_images=others, duration=DURATION, loop=0,
               quality=QUALITY, method=6)
    return stream.getvalue()


def main():
    """Make the picture."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('output', type=Path, help='file that gets the picture, .webp')
    parser.add_argument('--scene', default=SCENE, choices=MAIN, help='(default %(default)s)')
    parser.add_argument('--light', type=Path, default='evaluation_output/light', metavar='FOLDER',
                        help='folder that keeps rendered light (default %(default)s)')
    arguments = parser.parse_args()
    found = measured(LightScenes(arguments.light).scene(arguments.scene))
    write_bytes(arguments.output, as_webp(pictures(*found)))


if __name__ == '__main__':
    main()

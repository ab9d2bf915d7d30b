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
The files that `color_stereo export` writes of a pair: what each holds, and for whom it is.

A new product is one entry of `PRODUCTS`. The command offers it, and the documentation lists it,
in the order of the entries.

"""

from dataclasses import dataclass

import numpy as np

from ..core.false_color import false_color, range_limits, status_picture
from ..core.legends import with_scale_bar, with_status_legend
from ..core.registry import Registry
from ..core.results import NORMALS
from ..files.atomic import write_text, written_whole
from ..files.camera_info import camera_info_text
from ..files.cloud import save_cloud
from ..files.image import write_image
from ..messages.outputs import counted, rectified_camera

DEFAULT_PRODUCTS = 'ply', 'tiff', 'range_image'
MILLIMETERS = 1000.0
"""Numbers a meter of 16-bit depth images, as REP 118 and Open3D have it."""


@dataclass(frozen=True, eq=False)
class Shot:
    """A measured pair as its products show it."""

    result: object
    """RangeResult, trimmed as the outputs of the node are."""
    context: object
    """Context."""
    stamp: int
    """Of the left image, ns."""
    depth_scale: float = MILLIMETERS
    """Numbers a meter of the 16-bit depth image."""


@dataclass(frozen=True, eq=False)
class Product:
    """One kind of file."""

    ending: str
    """Of the name of the file, behind the stamp."""
    description: str
    """Content, unit, the value that means unknown."""
    readers: str
    """Programs that read it."""
    write: object
    """Called with (path, Shot). Of a film: called with a Shot, returns the picture, RGB."""
    film: bool = False
    """One file holds all pairs; its name has no stamp."""


PRODUCTS = Registry('product', Product)
"""The products by name."""


def product(name, ending, description, readers, film=False):
    """
    Return a decorator that registers a function of (path, shot) as a product.

    Parameters
    ----------
    name : str
        For `--products`.
    ending, description, readers, film
        See Product.

    """
    def register(function):
        PRODUCTS.register(name, Product(ending, description, readers, function, film))
        return function
    return register


def _save_cloud(path, shot, organized):
    """Write a cloud with normals, confidence and standard deviation of the depth."""
    result, rotation = shot.result, shot.context.points_rotation
    points, normals = result.points(), result.normals()
    if rotation is not None:
        points, normals = ((vectors @ rotation.T).astype(np.float32)
                           for vectors in (points, normals))
    fields = {**dict(zip(NORMALS, np.moveaxis(normals, 2, 0))),
              'confidence': result.confidence, 'depth_std': result.depth_std}
    save_cloud(path, points, result.image, fields, organized=organized, durable=False)


@product('ply', 'points.ply', 'the known points: x y z in m, normal, color, confidence, '
         'depth_std in m; binary', 'CloudCompare, MeshLab, Open3D, MATLAB (pcread)')
def _ply(path, shot):
    _save_cloud(path, shot, organized=False)


@product('organized_ply', 'organized.ply', 'the same for all pixels row by row, unknown ones are '
         'NaN; num_cols and num_rows are in its header', 'Open3D, scripts')
def _organized_ply(path, shot):
    _save_cloud(path, shot, organized=True)


@product('pcd', 'points.pcd', 'the known points, same content; binary',
         'PCL, CloudCompare, Open3D, MATLAB (pcread)')
def _pcd(path, shot):
    _save_cloud(path, shot, organized=False)


@product('organized_pcd', 'organized.pcd', 'all pixels with WIDTH x HEIGHT points, unknown ones '
         'are NaN', 'PCL (organized algorithms), MATLAB (pcread: M x N x 3)')
def _organized_pcd(path, shot):
    _save_cloud(path, shot, organized=True)


@product('tiff', 'depth.tiff', '32-bit float, depth in m, NaN = unknown',
         'MATLAB (imread), ImageJ, OpenCV, GDAL; not Open3D')
def _tiff(path, shot):
    write_image(path, shot.result.depth)


@product('std_tiff', 'depth_std.tiff', '32-bit float, standard deviation of the depth in m, NaN '
         '= unknown', 'as tiff')
def _std_tiff(path, shot):
    write_image(path, shot.result.depth_std)


@product('png', 'depth.png', '16 bit, depth in mm or by --depth-scale, 0 = unknown',
         'Open3D (RGBDImage with color and camera), MATLAB, every program')
def _png(path, shot):
    write_image(path, counted(shot.result.depth, shot.depth_scale))


@product('color', 'color.png', 'the rectified left image, the pixels of depth',
         'Open3D (RGBDImage), every program')
def _color(path, shot):
    write_image(path, shot.result.image)


@product('camera', 'camera.yaml', 'camera_info of the rectified left camera, to which depth and '
         'color belong', 'ROS, OpenCV, every program that reads YAML')
def _camera(path, shot):
    camera = rectified_camera(shot.result.geometry)
    write_text(path, camera_info_text(camera.name, {
        'width': camera.width, 'height': camera.height,
        'distortion_model': camera.distortion_model,
        **{name: np.ravel(getattr(camera, name)).tolist() for name in 'DKRP'}}))


@product('npz', 'result.npz', 'depth, depth_std, confidence, status, views, normals, color, K, '
         'stamp in ns, frame_id', 'NumPy')
def _npz(path, shot):
    result = shot.result
    with written_whole(path) as partial:
        np.savez_compressed(
            partial, depth=result.depth, depth_std=result.depth_std, confidence=result.confidence,
            status=result.status, views=result.views, normals=result.normals(),
            color=result.image, K=rectified_camera(result.geometry).K,
            stamp=np.int64(shot.stamp), frame_id=shot.context.header.frame_id)


@product('confidence', 'confidence.png', '8 bit, 255 = 1, 0 = unknown', 'every program')
def _confidence(path, shot):
    write_image(path, np.rint(255 * shot.result.confidence).astype(np.uint8))


@product('range_image', 'range_image.png', 'false colors of the depth with a scale bar, see '
         'output.range_colors and output.range_limits', 'people')
def _range_image(path, shot):
    settings = shot.context.settings
    write_image(path, _colored(shot, range_limits(shot.result.depth, settings.range,
                                                  settings.output.range_limits)))


@product('status', 'status.png', 'why a pixel has no range: one color for each reason, with a '
         'legend', 'people')
def _status(path, shot):
    write_image(path, with_status_legend(status_picture(shot.result.status)))


@product('mp4', 'range_image.mp4', 'one film of all chosen pairs in false colors, from '
         'range.min_depth to range.max_depth; MPEG-4 part 2', 'VLC, mpv, ffmpeg; no web browser',
         film=True)
def _mp4(shot):
    limits = shot.context.settings.range
    return _colored(shot, (limits.min_depth, limits.max_depth))


def _colored(shot, limits):
    """Return the depth in false colors with a scale bar, uint8 (H, W, 3), RGB."""
    colors = shot.context.settings.output.range_colors
    return with_scale_bar(false_color(shot.result.depth, *limits, colors), *limits, colors)

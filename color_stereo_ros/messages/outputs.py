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
The output topics of range_node: what each holds, and how it follows from a result.

A new output is one entry of `OUTPUTS`. The node publishes it, `color_stereo convert` writes it,
and the documentation lists it, in the order of the entries.

"""

from dataclasses import dataclass, field, replace
from functools import lru_cache

import cv2
import numpy as np

from .cloud import cloud
from .compressing import compressed_depth, jpeg
from .contents import (camera_info, CameraInfo, CompressedImage, DiagnosticArray, DisparityImage,
                       Header, Image, image, new_memory, PointCloud2)
from .disparity import disparity
from .frames import frames_of
from .health import health_message, suggestion, TOPIC as HEALTH
from ..core.cameras.calibration import CameraModel
from ..core.false_color import false_color, range_limits, status_picture
from ..core.legends import with_status_legend
from ..core.registry import Registry


@dataclass(frozen=True, eq=False)
class Context:
    """What an output needs beside the result."""

    header: Header
    """Stamp of the left image, frame of the rectified left camera."""
    settings: object
    """RangeNodeSettings."""
    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    """float64 (3, 3), from the rectified to the physical left camera."""
    memory: object = new_memory
    """Called with a size, returns that many bytes for `data`; they may hold an older message."""
    physical_frame: str | None = None
    """Name of the physical left camera; None: that of the header."""
    calibration: object = None
    """StereoCalibration as given; None: what asks for it says nothing."""

    @classmethod
    def of(cls, header, settings, calibration):
        """
        Return the context of a pair.

        Parameters
        ----------
        header : Header
            Of the left image.
        settings : RangeNodeSettings
            All parameters of range_node.
        calibration : StereoCalibration
            Of the two cameras.

        Returns
        -------
        context : Context

        """
        frames = frames_of(header.frame_id, calibration, settings.output)
        return cls(Header(header.stamp, frames.rectified), settings, frames.rotation,
                   physical_frame=frames.physical, calibration=calibration)

    @property
    def points_header(self):
        """Return stamp and frame of `points`, which `output.frame` chooses."""
        if self.physical_frame is None or self.settings.output.frame != 'camera':
            return self.header
        return Header(self.header.stamp, self.physical_frame)

    @property
    def points_rotation(self):
        """Return what turns points into the frame of `points`, float64 (3, 3); None: nothing."""
        return self.rotation if self.settings.output.frame == 'camera' else None

    def with_memory(self, memory):
        """Return the same context with another memory."""
        return replace(self, memory=memory)


@dataclass(frozen=True, eq=False)
class Output:
    """One output topic."""

    type: str  # noqa: A003
    """Of its messages, for example sensor_msgs/msg/Image."""
    description: str
    """Encoding, unit, the value that means unknown."""
    content: object
    """Called with (RangeResult, Context), returns one of `contents`."""


OUTPUTS = Registry('output topic', Output)
"""The outputs by relative topic, in the order in which they are published."""


def output(topic, content_type, description):
    """
    Return a decorator that registers a function of (result, context) as an output topic.

    Parameters
    ----------
    topic : str
        Relative name.
    content_type : type
        The class of `contents` that the function returns.
    description : str
        One sentence for the documentation.

    """
    def register(function):
        OUTPUTS.register(topic, Output(content_type.TYPE, description, function))
        return function
    return register


def counted(depth, scale):
    """
    Return depth as whole numbers.

    Parameters
    ----------
    depth : numpy.ndarray, float32, shape (H, W)
        m; NaN = unknown.
    scale : float
        Numbers a meter.

    Returns
    -------
    numbers : numpy.ndarray, uint16, shape (H, W)
        0 = unknown, or above 65535.

    """
    scaled = np.rint(np.nan_to_num(depth, nan=0.0) * np.float32(scale))
    scaled[scaled > 65535.0] = 0.0
    return scaled.astype(np.uint16)


def millimeters(depth):
    """Return depth (m, NaN = unknown) as uint16 mm, 0 = unknown or beyond 65.535 m (REP 118)."""
    return counted(depth, 1000.0)


@lru_cache(maxsize=2)
def rectified_camera(geometry):
    """Return the CameraModel of rectified left images: D = 0, R = I, K is the left part of P."""
    fx, fy = geometry.focal_x, geometry.focal_y
    cx, cy = geometry.center_x_left, geometry.center_y
    projection = np.array([[fx, 0.0, cx, 0.0], [0.0, fy, cy, 0.0], [0.0, 0.0, 1.0, 0.0]])
    return CameraModel('left', geometry.width, geometry.height, 'plumb_bob', np.zeros(5),
                       projection[:, :3], np.eye(3), projection)


@output('points', PointCloud2, 'organized H x W, fields x y z rgb, 16 bytes a point, NaN = '
        'unknown; with `output.compact_points` the known points only; more fields with '
        '`output.point_fields`')
def _points(result, context):
    settings = context.settings.output
    return cloud(result, context.points_header, compact=settings.compact_points,
                 memory=context.memory, rotation=context.points_rotation,
                 fields=settings.names_of_fields)


@output('depth/image', Image, '32FC1, m along Z of the rectified left camera, NaN = unknown; with '
        '`output.depth_encoding` 16UC1 in mm, 0 = unknown')
def _depth(result, context):
    return image(*_depth_pixels(result, context), context.header)


def _depth_pixels(result, context):
    """Return depth as it is published, and its encoding."""
    if context.settings.output.depth_encoding == '16UC1':
        return millimeters(result.depth), '16UC1'
    return result.depth, '32FC1'


@output('depth/camera_info', CameraInfo,
        'the rectified left camera; stamp and frame of depth/image')
def _depth_camera_info(result, context):
    return camera_info(rectified_camera(result.geometry), context.header)


@output('disparity', DisparityImage, 'Z = f t / d; unknown below `min_disparity`')
def _disparity(result, context):
    return disparity(result, context.header)


@output('confidence/image', Image, '32FC1, 0..1, the probability that the match is right')
def _confidence(result, context):
    return image(result.confidence, '32FC1', context.header)


@output('depth_std/image', Image, '32FC1, standard deviation of the depth, m, NaN = unknown')
def _depth_std(result, context):
    return image(result.depth_std, '32FC1', context.header)


@output('status/image', Image, 'mono8, why a pixel has no range; 0 = it has one')
def _status(result, context):
    return image(result.status, 'mono8', context.header)


@output('views/image', Image, 'mono8, who saw a pixel, bits: 1 right camera, 2 projector; 0 = it '
        'has no range')
def _views(result, context):
    return image(result.views, 'mono8', context.header)


@output('status_picture', Image, 'bgr8, the status in colors for people, with a legend to the '
        'right of it')
def _status_picture(result, context):
    return _bgr(with_status_legend(status_picture(result.status)), context.header)


@output(HEALTH, DiagnosticArray, 'one status: by how much rows and depth have drifted since the '
        'cameras were calibrated, with standard deviations; see `health.correct`')
def _calibration_health(result, context):
    suggested = None
    if context.calibration is not None:
        suggested = suggestion(result.health, context.calibration, context.settings)
    return health_message(result.health, 'calibration health', context.header,
                          context.calibration, suggested)


@output('range_image', Image, 'bgr8, false colors of the depth, unknown = black; the size of '
        'depth/image; see `output.range_colors` and `output.range_limits`')
def _range_image(result, context):
    return _bgr(_range_picture(result, context), context.header)


def _range_picture(result, context):
    """Return the false colors of the depth, uint8 (H, W, 3), RGB."""
    settings = context.settings
    near, far = range_limits(result.depth, settings.range, settings.output.range_limits)
    return false_color(result.depth, near, far, settings.output.range_colors)


@output('left/image_rect_color', Image, 'rgb8, the rectified left image, the pixels of '
        'depth/image; its camera_info is depth/camera_info')
def _rectified_image(result, context):
    return image(result.image, 'rgb8', context.header)


@output('depth/image/compressedDepth', CompressedImage, 'depth/image as PNG, in the format of '
        'compressed_depth_image_transport')
def _compressed_depth(result, context):
    limits = context.settings.range
    return compressed_depth(*_depth_pixels(result, context), context.header,
                            limits.min_depth, limits.max_depth)


@output('range_image/compressed', CompressedImage, 'range_image as JPEG, in the format of '
        'compressed_image_transport')
def _compressed_range_image(result, context):
    return jpeg(_range_picture(result, context), context.header)


def _bgr(picture, header):
    """Return the content of an RGB picture."""
    return image(cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), 'bgr8', header)

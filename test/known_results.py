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
"""A small result without a measurement, for the tests of what is made of it."""

from color_stereo_ros.core.cameras.geometry import RectifiedGeometry
from color_stereo_ros.core.results import RangeResult
from color_stereo_ros.core.status import Status
from color_stereo_ros.messages.contents import Header
from color_stereo_ros.messages.outputs import Context, OUTPUTS
from color_stereo_ros.parameters.groups import OutputSettings, RangeNodeSettings

import numpy as np

HEADER = Header.at(7_000_000_009, 'left_camera_optical')
GEOMETRY = RectifiedGeometry(width=32, height=24, focal_x=40.0, focal_y=41.0, center_x_left=15.25,
                             center_x_right=9.75, center_y=11.5, baseline=0.1)


def known_result(unknown=((3, 4), (5, 6))):
    """Return a result with a smooth depth, a verged rig and a few unknown pixels."""
    v, u = np.mgrid[:24, :32]
    depth = (0.4 + 0.002 * u + 0.001 * v).astype(np.float32)
    disparity = (GEOMETRY.focal_baseline / depth + GEOMETRY.principal_offset).astype(np.float32)
    status = np.zeros(depth.shape, np.uint8)
    for row, column in unknown:
        depth[row, column] = disparity[row, column] = np.nan
        status[row, column] = Status.NO_MATCH
    image = np.random.default_rng(2).integers(0, 256, (24, 32, 3), np.uint8)
    limits = (GEOMETRY.focal_baseline / 0.6 + GEOMETRY.principal_offset,
              GEOMETRY.focal_baseline / 0.35 + GEOMETRY.principal_offset)
    deviation = np.where(status == 0, np.float32(0.125), np.float32(np.nan))
    return RangeResult(disparity=disparity, depth=depth, confidence=np.ones_like(depth),
                       status=status, disparity_std=deviation.astype(np.float32),
                       views=np.where(status == 0, 1 + np.arange(status.size).reshape(
                           status.shape) % 3, 0).astype(np.uint8),
                       image_source=image, geometry=GEOMETRY, disparity_limits=limits)


def output(topic, result, **settings):
    """Return the content of an output topic."""
    node_settings = RangeNodeSettings(output=OutputSettings(**settings))
    return OUTPUTS[topic].content(result, Context(HEADER, node_settings))

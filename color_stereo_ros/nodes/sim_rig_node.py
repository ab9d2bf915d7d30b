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
"""The node sim_rig_node: two simulated cameras that see a scene under the pattern shown."""

from .run import run


def make_node():
    """Return the node; what it needs is imported here, where Ctrl-C is handled already."""
    from .sim_rig import SimRigNode
    return SimRigNode()


def usage():
    """Return the Usage of the node."""
    from ..parameters.groups import SimRigSettings
    from .usage import Usage
    cameras = (f'{side}/{{}}' for side in ('left', 'right'))
    return Usage('sim_rig_node', 'Simulates two cameras that see a scene under the pattern that '
                 'is shown.', SimRigSettings(), (
                     ('pattern/image', 'sensor_msgs/Image', 'what the projector shows'),),
                 tuple(row for camera in cameras for row in (
                     (camera.format('image_raw'), 'sensor_msgs/Image', 'with new noise each time'),
                     (camera.format('camera_info'), 'sensor_msgs/CameraInfo', 'of the rig'))))


def main(args=None):
    """Run the node; the entry point of `ros2 run color_stereo_ros sim_rig_node`."""
    return run(make_node, args, usage)

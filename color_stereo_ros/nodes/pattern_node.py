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
"""The node pattern_node: the image that the projector must show, and what it is."""

from .run import run


def make_node():
    """Return the node; what it needs is imported here, where Ctrl-C is handled already."""
    from .pattern_source import PatternNode
    return PatternNode()


def usage():
    """Return the Usage of the node."""
    from ..parameters.groups import PatternNodeSettings
    from .usage import Usage
    return Usage('pattern_node', 'Publishes the image that the projector must show.',
                 PatternNodeSettings(), published=(
                     ('pattern/image', 'sensor_msgs/Image', 'rgb8, linear light, latched; again '
                      'when a parameter changes'),
                     ('pattern/info', 'std_msgs/String', 'JSON: settings, frame and SHA-256 of '
                      'the pixels, latched')))


def main(args=None):
    """Run the node; the entry point of `ros2 run color_stereo_ros pattern_node`."""
    return run(make_node, args, usage)

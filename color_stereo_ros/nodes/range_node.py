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
"""The node range_node: raw pairs and calibrations in, range images and points out."""

from .run import run


def make_node():
    """Return the node; what it needs is imported here, where Ctrl-C is handled already."""
    from .sensor.node import RangeNode
    return RangeNode()


def usage(name='range_node', summary='Measures depth from pairs of raw color images and the '
          'calibration of the two cameras.'):
    """Return the Usage of the node, or of its lifecycle twin by another name."""
    from ..messages.outputs import OUTPUTS
    from ..parameters.groups import RangeNodeSettings
    from .usage import Usage
    return Usage(name, summary, RangeNodeSettings(), (
        ('left/image_raw, right/image_raw', 'sensor_msgs/Image', 'raw color images; rgb8, bgr8, '
         'rgba8, bgra8, bayer_*8 or bayer_*16'),
        ('left/image_raw/compressed, right/image_raw/compressed', 'sensor_msgs/CompressedImage',
         'JPEG or PNG instead of raw images, with input.transport compressed'),
        ('left/camera_info, right/camera_info', 'sensor_msgs/CameraInfo', 'D, K, R, P of a pair '
         'that was calibrated as stereo'),
        ('pattern/info', 'std_msgs/String', 'what pattern_node shows; compared with pattern.*'),
    ), (
        *((topic, output.type.replace('/msg/', '/'), output.description.replace('`', ''))
          for topic, output in OUTPUTS.items()),
        ('~/acquired', 'std_msgs/Header', 'a requested pair has arrived: the scene may move '
         'again'),
        ('/tf_static', 'tf2_msgs/TFMessage', 'the place of the rectified left camera in the '
         'physical one, where R turns it'),
        ('/diagnostics', 'diagnostic_msgs/DiagnosticArray', 'inputs, calibration, pattern and '
         'range images: what the node does, and why it does not'),
    ), (
        ('~/capture', 'std_srvs/Trigger', 'measures a pair that is exposed after the call, or '
         'several (capture.pairs)'),
        ('~/save', 'std_srvs/Trigger', 'writes the points as a file to output.save_directory'),
    ))


def main(args=None):
    """Run the node; the entry point of `ros2 run color_stereo_ros range_node`."""
    return run(make_node, args, usage)

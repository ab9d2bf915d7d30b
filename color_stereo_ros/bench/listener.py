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
A process that listens: `python -m color_stereo_ros.bench.listener TOPIC`.

Prints `stamp now` (both ns) for every message. It takes the bytes as they are: to decode 5 MB
would take time from the node that is measured.

"""

import struct
import sys
import time


def main():
    """Listen until SIGINT or SIGTERM."""
    import rclpy
    from rclpy.executors import ExternalShutdownException
    from rclpy.qos import QoSProfile

    from sensor_msgs.msg import Image, PointCloud2

    def take(data):
        # CDR: 4 bytes that tell the byte order, then header.stamp
        seconds, nanoseconds = struct.unpack_from('<iI', data, 4)
        print(seconds * 1_000_000_000 + nanoseconds, time.time_ns(), flush=True)

    topic = sys.argv[1]
    rclpy.init()
    node = rclpy.create_node('bench_listener', enable_rosout=False)
    kind = PointCloud2 if topic == 'points' else Image
    node.create_subscription(kind, topic, take, QoSProfile(depth=5), raw=True)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == '__main__':
    sys.exit(main())

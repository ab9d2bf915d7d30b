# SPDX-License-Identifier: Apache-2.0
"""
A process that listens to `points`: `python -m color_stereo_ros.bench.listener`.

Prints `stamp now` (both ns) for every cloud. It takes the bytes as they are: to decode 5 MB would
take time from the node that is measured.

"""

import struct
import sys
import time


def main():
    """Listen until SIGINT or SIGTERM."""
    import rclpy
    from rclpy.executors import ExternalShutdownException
    from rclpy.qos import QoSProfile

    from sensor_msgs.msg import PointCloud2

    def take(data):
        # CDR: 4 bytes that tell the byte order, then header.stamp
        seconds, nanoseconds = struct.unpack_from('<iI', data, 4)
        print(seconds * 1_000_000_000 + nanoseconds, time.time_ns(), flush=True)

    rclpy.init()
    node = rclpy.create_node('bench_listener', enable_rosout=False)
    node.create_subscription(PointCloud2, 'points', take, QoSProfile(depth=5), raw=True)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == '__main__':
    sys.exit(main())

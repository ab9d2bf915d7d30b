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
How many large messages arrive between two processes, and when: python test/measure_transport.py.

Prints the table of docs/nodes.md, with the default transports and with config/fastdds_shm.xml.

"""

from array import array
import os
from pathlib import Path
import subprocess
import sys
import time

COUNT = 40
PERIOD = 0.1
PROFILE = Path(__file__).resolve().parents[1] / 'config' / 'fastdds_shm.xml'
SIZES = {'image 640 x 480 rgb8, 0.9 MB': 921600, 'cloud 640 x 480, 4.9 MB': 4915200}


def profile(reliability):
    """Return a QoS profile of depth 4."""
    from rclpy.qos import QoSProfile, QoSReliabilityPolicy
    return QoSProfile(depth=4, reliability=QoSReliabilityPolicy[reliability.upper()])


def read(reliability):
    """Print how many messages arrived, and the median latency in ms."""
    import rclpy
    from sensor_msgs.msg import Image
    latencies = []

    def take(msg):
        sent = msg.header.stamp.sec * 1_000_000_000 + msg.header.stamp.nanosec
        latencies.append((time.time_ns() - sent) / 1e6)

    rclpy.init()
    node = rclpy.create_node('reader')
    node.create_subscription(Image, 'large', take, profile(reliability))
    deadline = time.monotonic() + COUNT * PERIOD + 6.0
    while time.monotonic() < deadline and len(latencies) < COUNT:
        rclpy.spin_once(node, timeout_sec=0.1)
    median = f'{sorted(latencies)[len(latencies) // 2]:.0f} ms' if latencies else 'none'
    print(f'{len(latencies)} of {COUNT}, {median}')


def write(size):
    """Publish messages at a steady pace as soon as somebody reads."""
    import rclpy
    from sensor_msgs.msg import Image
    rclpy.init()
    node = rclpy.create_node('writer')
    publisher = node.create_publisher(Image, 'large', profile('reliable'))
    while not publisher.get_subscription_count():
        time.sleep(0.02)
    time.sleep(0.5)
    message = Image(data=array('B', bytes(size)))
    for _ in range(COUNT):
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(
            time.time_ns(), 1_000_000_000)
        publisher.publish(message)
        time.sleep(PERIOD)
    time.sleep(1.0)


def measure(size, reliability, environment):
    """Return what a reader process says about a writer process."""
    command = [sys.executable, __file__]
    reader = subprocess.Popen([*command, 'read', reliability], stdout=subprocess.PIPE, text=True,
                              env=environment)
    writer = subprocess.Popen([*command, 'write', str(size)], env=environment)
    said = reader.communicate(timeout=60)[0].strip()
    writer.wait(60)
    return said


def main():
    """Measure all combinations."""
    environment = {**os.environ, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    environment.setdefault('ROS_DOMAIN_ID', '97')
    environment.pop('FASTRTPS_DEFAULT_PROFILES_FILE', None)
    shared = {**environment, 'FASTRTPS_DEFAULT_PROFILES_FILE': str(PROFILE)}
    print('| message | reader | without: arrived, latency p50 | with the profile |')
    print('|---|---|---|---|')
    for name, size in SIZES.items():
        for reliability in ('reliable', 'best_effort'):
            results = [measure(size, reliability, each) for each in (environment, shared)]
            print(f'| {name} | {reliability} | {" | ".join(results)} |', flush=True)


if __name__ == '__main__':
    if sys.argv[1:2] == ['read']:
        read(sys.argv[2])
    elif sys.argv[1:2] == ['write']:
        write(int(sys.argv[2]))
    else:
        main()

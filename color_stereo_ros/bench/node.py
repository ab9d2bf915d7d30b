# SPDX-License-Identifier: Apache-2.0
"""
range_node in a process of its own, fed through real DDS: `python -m color_stereo_ros.bench.node`.

The sender, the node and the subscriber of `points` are three processes. Kernel cache and DDS
profile depend on the environment, so each measurement starts a new sender, too. The argument is
JSON; prints one line of JSON.

"""

import json
import os
from pathlib import Path
from random import SystemRandom
import re
import subprocess
import sys
import tempfile
import time

from ..nodes.live import LiveError, Processes, ros_node

SETTLE = 2.0     # s of pairs that do not count, and of waiting for the last answers
PATIENCE = 240.0  # s until the first cloud: kernels may have to be compiled
FIRST_RATE = 20  # Hz at which pairs are sent until the first cloud comes


def measured(folder, rates, seconds, environment=None):
    """
    Return what `main` measures in a new process with a ROS domain of its own.

    Parameters
    ----------
    folder : str or Path
        With pair.npy, left.yaml and right.yaml.
    rates : list of float
        Pairs per second, one after the other.
    seconds : float
        How long each lasts.
    environment : dict, optional

    Returns
    -------
    found : dict
        `ready` and `first` (s from process start until the node says so, and to the first
        cloud), `peak_mb`, and `rates`: a list of dicts with `rate`, `sent`, `answered`,
        `out_of_order`, `oldest_ms`, `cpu_ms` (processor time of the node per answer) and the
        node's own `p50_ms`, `p99_ms`, `dropped`.

    """
    order = {'folder': str(folder), 'rates': list(rates), 'seconds': seconds}
    ran = subprocess.run(
        [sys.executable, '-m', 'color_stereo_ros.bench.node', json.dumps(order)],
        stdout=subprocess.PIPE, text=True,
        env={**os.environ, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
             'ROS_DOMAIN_ID': str(SystemRandom().randint(1, 100)), **(environment or {})})
    if ran.returncode:
        raise LiveError(f'the process that measures range_node ended with status {ran.returncode}')
    return json.loads(ran.stdout.splitlines()[-1])


def main():
    """Measure range_node."""
    order = json.loads(sys.argv[1])
    with tempfile.TemporaryDirectory() as logs, ros_node('bench_sender') as node:
        with Processes(logs) as processes:
            print(json.dumps(Bench(node, processes, order).run()), flush=True)


class Bench:
    """
    One start of range_node.

    Parameters
    ----------
    node : rclpy.node.Node
    processes : Processes
    order : dict
        `folder`, `rates`, `seconds`; see `measured`.

    """

    def __init__(self, node, processes, order):
        from diagnostic_msgs.msg import DiagnosticArray
        self._node, self._processes, self._order = node, processes, order
        self._cameras = Cameras(node, Path(order['folder']))
        self._diagnostics = {}
        node.create_subscription(DiagnosticArray, '/diagnostics', self._take, 10)
        self._start = None
        self._pid = None

    def _take(self, message):
        self._diagnostics = {value.key: value.value for status in message.status
                             for value in status.values}

    def run(self):
        """Return what `measured` returns."""
        import rclpy
        listener = 'color_stereo_ros.bench.listener'
        self._processes.start('listener', listener)
        while not self._node.count_subscribers('/points'):
            self._processes.check()
            rclpy.spin_once(self._node, timeout_sec=0.05)
        self._start = time.time_ns()
        self._pid = self._processes.start(
            'range_node', 'color_stereo_ros.nodes.range_node', '--ros-args', *self._parameters(),
            '-p', 'output.diagnostics_period:=0.5')
        first = self._first()
        rates = [self._at(rate) for rate in self._order['rates']]
        return {'ready': self._ready(), 'first': first, 'rates': rates,
                'peak_mb': peak_memory(self._pid)}

    def _ready(self):
        """Return s from the start of the process until the node said that it is ready."""
        said = re.search(r'\[(\d+\.\d+)\] \[range_node\]: ready after',
                         self._processes.log('range_node'))
        return float(said[1]) - self._start * 1e-9

    def _parameters(self):
        """Return the arguments that set the depth limits of the bench, for two views."""
        from .scene import bench_settings
        limits = bench_settings(self._cameras.calibration, 128).range
        return ('-p', 'matching.third_view:=off', '-p', f'range.min_depth:={limits.min_depth}',
                '-p', f'range.max_depth:={limits.max_depth}')

    def _first(self):
        """Return s from the start of the process to the first cloud."""
        deadline = time.monotonic() + PATIENCE
        while not self._answers():
            if time.monotonic() > deadline:
                raise LiveError(f'no points within {PATIENCE:.0f} s; range_node said:\n'
                                f'{self._processes.log_tail("range_node")}')
            self._processes.check()
            self._cameras.send()
            self._spin(1 / FIRST_RATE)
        return (self._answers()[0][1] - self._start) * 1e-9

    def _spin(self, seconds):
        """Let diagnostics come in."""
        import rclpy
        end = time.monotonic() + seconds
        while (rest := end - time.monotonic()) > 0:
            rclpy.spin_once(self._node, timeout_sec=rest)

    def _answers(self):
        """Return the (stamp, arrival) of all clouds so far, ns."""
        lines = self._processes.log('listener').split('\n')
        return [tuple(map(int, line.split())) for line in lines[:-1]]

    def _at(self, rate):
        """Send pairs at a rate; return its figures."""
        self._cameras.stream(rate, SETTLE)
        self._spin(SETTLE)
        before, busy = dict(self._diagnostics), processor_time(self._pid)
        sent = set(self._cameras.stream(rate, self._order['seconds']))
        self._spin(SETTLE)
        after, busy = self._diagnostics, processor_time(self._pid) - busy
        answers = [answer for answer in self._answers() if answer[0] in sent]
        stamps = [stamp for stamp, _ in answers]
        return {
            'rate': rate, 'sent': len(sent), 'answered': len(set(stamps)),
            'cpu_ms': 1e3 * busy / max(len(set(stamps)), 1),
            'dropped': (int(after['pairs dropped for newer ones'])
                        - int(before['pairs dropped for newer ones'])),
            'out_of_order': sum(b <= a for a, b in zip(stamps, stamps[1:])),
            'oldest_ms': max((b - a for a, b in answers), default=float('nan')) / 1e6,
            'p50_ms': float(after['latency p50 (ms)']), 'p99_ms': float(after['latency p99 (ms)'])}


class Cameras:
    """Two cameras that show the pair of the bench again and again."""

    def __init__(self, node, folder):
        import numpy as np
        from rclpy.qos import QoSProfile

        from ..core import StereoCalibration
        from ..messages.contents import camera_info, Header, image
        from ..nodes.filling import message_of
        self.calibration = StereoCalibration.from_yaml(folder / 'left.yaml', folder / 'right.yaml')
        self._outputs = []
        for side, pixels in zip(('left', 'right'), np.load(folder / 'pair.npy')):
            header = Header(frame_id=f'{side}_camera_optical_frame')
            for topic, content in (
                    ('camera_info', camera_info(getattr(self.calibration, side), header)),
                    ('image_raw', image(pixels, 'rgb8', header))):
                message = message_of(content)
                publisher = node.create_publisher(type(message), f'{side}/{topic}',
                                                  QoSProfile(depth=5))
                self._outputs.append((publisher, message))

    def send(self):
        """Publish a pair with its calibrations; return the stamp, ns."""
        now = time.time_ns()
        for publisher, message in self._outputs:
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(now, 1_000_000_000)
            publisher.publish(message)
        return now

    def stream(self, rate, seconds):
        """Publish pairs at a rate, 1/s; return their stamps, ns."""
        stamps = []
        start = time.monotonic()
        for turn in range(round(rate * seconds)):
            time.sleep(max(0.0, start + turn / rate - time.monotonic()))
            stamps.append(self.send())
        return stamps


def processor_time(pid):
    """Return how long a process has used a core so far, s."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def peak_memory(pid):
    """Return the largest resident memory that a process had, MB."""
    for line in Path(f'/proc/{pid}/status').read_text().splitlines():
        if line.startswith('VmHWM'):
            return int(line.split()[1]) / 1000
    raise LiveError(f'process {pid} tells nothing of its memory')


if __name__ == '__main__':
    sys.exit(main())

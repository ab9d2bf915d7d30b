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
range_node in a process of its own, fed through real DDS: `python -m color_stereo_ros.bench.node`.

The sender, the node and the subscriber of an output are three processes. Kernel cache and DDS
profile depend on the environment, so each measurement starts a new sender, too. The argument is
JSON; prints one line of JSON.

"""

import json
import os
from pathlib import Path
import re
import subprocess
import sys
import tempfile
import time

from ..nodes.domains import own_domain
from ..nodes.live import LiveError, Processes, ros_node

SETTLE = 2.0     # s of pairs that do not count, and of waiting for the last answers
PATIENCE = 240.0  # s until the first cloud: kernels may have to be compiled
FIRST_RATE = 20  # Hz at which pairs are sent until the first cloud comes


PARTS = {'executor': r'python.*', 'measuring and publishing': 'color_stereo',
         'receiving': r'dds\.(udp|shm|tcp).*', 'sending': r'dds\.asyn.*', 'events': r'dds\.ev.*'}
"""What threads of the node do, and the pattern of their names."""


def measured(folder, rates, seconds, environment=None, topic='points', third_view='off'):
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
        Variables of the process besides its own.
    topic : str
        Of the output that is listened to, `points` or `depth/image`.
    third_view : str
        The parameter matching.third_view.

    Returns
    -------
    found : dict
        `topic`, `ready` and `first` (s from process start until the node says so, and to the first
        answer), `peak_mb`, and `rates`: a list of dicts with `rate`, `sent`, `answered`,
        `out_of_order`, `oldest_ms`, `cpu_ms` (processor time of the node per answer), `parts`
        (that of its threads, of the sender and of the listener, ms per answer), `reference_ms`
        (see `reference_time`) and the node's own `p50_ms`, `p99_ms`, `dropped`.

    """
    order = {'folder': str(folder), 'rates': list(rates), 'seconds': seconds, 'topic': topic,
             'third_view': third_view}
    ran = subprocess.run(
        [sys.executable, '-m', 'color_stereo_ros.bench.node', json.dumps(order)],
        stdout=subprocess.PIPE, text=True,
        env={**os.environ, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
             'ROS_DOMAIN_ID': str(own_domain()), **(environment or {})})
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
        `folder`, `rates`, `seconds`, `topic`, `third_view`; see `measured`.

    """

    def __init__(self, node, processes, order):
        from diagnostic_msgs.msg import DiagnosticArray
        self._node, self._processes, self._order = node, processes, order
        self._cameras = Cameras(node, Path(order['folder']))
        self._diagnostics = {}
        node.create_subscription(DiagnosticArray, '/diagnostics', self._take, 10)
        self._start = None
        self._pid = self._listener = None

    def _take(self, message):
        self._diagnostics = {value.key: value.value for status in message.status
                             for value in status.values}

    def run(self):
        """Return what `measured` returns."""
        import rclpy
        listener = 'color_stereo_ros.bench.listener'
        topic = self._order['topic']
        self._listener = self._processes.start('listener', listener, topic)
        while not self._node.count_subscribers(f'/{topic}'):
            self._processes.check()
            rclpy.spin_once(self._node, timeout_sec=0.05)
        self._start = time.time_ns()
        self._pid = self._processes.start(
            'range_node', 'color_stereo_ros.nodes.range_node', '--ros-args', *self._parameters(),
            '-p', 'output.diagnostics_period:=0.5')
        first = self._first()
        rates = [self._at(rate) for rate in self._order['rates']]
        return {'topic': topic, 'ready': self._ready(), 'first': first, 'rates': rates,
                'peak_mb': peak_memory(self._pid)}

    def _ready(self):
        """Return s from the start of the process until the node said that it is ready."""
        said = re.search(r'\[(\d+\.\d+)\] \[range_node\]: ready after',
                         self._processes.log('range_node'))
        return float(said[1]) - self._start * 1e-9

    def _parameters(self):
        """Return the arguments that set the depth limits of the bench, and its views."""
        from .scene import bench_settings, VGA
        calibration = self._cameras.calibration
        disparities = 128 * calibration.geometry.width // VGA[0]
        limits = bench_settings(calibration, disparities).range
        return ('-p', f'matching.third_view:={self._order["third_view"]}',
                '-p', f'range.min_depth:={limits.min_depth}',
                '-p', f'range.max_depth:={limits.max_depth}')

    def _first(self):
        """Return s from the start of the process to the first answer."""
        deadline = time.monotonic() + PATIENCE
        while not self._answers():
            if time.monotonic() > deadline:
                raise LiveError(f'no {self._order["topic"]} within {PATIENCE:.0f} s; '
                                f'range_node said:\n{self._processes.log_tail("range_node")}')
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
        """Return the (stamp, arrival) of all answers so far, ns."""
        lines = self._processes.log('listener').split('\n')
        return [tuple(map(int, line.split())) for line in lines[:-1]]

    def _at(self, rate):
        """Send pairs at a rate; return its figures."""
        self._cameras.stream(rate, SETTLE)
        self._spin(SETTLE)
        reference = reference_time(self._order['folder'])
        before, busy = dict(self._diagnostics), self._busy()
        sent = set(self._cameras.stream(rate, self._order['seconds']))
        self._spin(SETTLE)
        after, until = self._diagnostics, self._busy()
        reference = min(reference, reference_time(self._order['folder']))
        busy = {part: until[part] - busy[part] for part in until}
        answers = [answer for answer in self._answers() if answer[0] in sent]
        stamps = [stamp for stamp, _ in answers]
        each = 1e3 / max(len(set(stamps)), 1)
        return {
            'rate': rate, 'sent': len(sent), 'answered': len(set(stamps)),
            'cpu_ms': each * busy['node'],
            'parts': {part: each * seconds for part, seconds in busy.items()},
            'reference_ms': reference,
            'dropped': (int(after['pairs dropped for newer ones'])
                        - int(before['pairs dropped for newer ones'])),
            'out_of_order': sum(b <= a for a, b in zip(stamps, stamps[1:])),
            'oldest_ms': max((b - a for a, b in answers), default=float('nan')) / 1e6,
            'p50_ms': float(after['latency p50 (ms)']), 'p99_ms': float(after['latency p99 (ms)'])}

    def _busy(self):
        """Return the processor time of all parts so far, s."""
        return {'node': processor_time(self._pid), **thread_times(self._pid),
                'sender': processor_time(os.getpid()),
                'listener': processor_time(self._listener)}


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


def thread_times(pid):
    """Return how long the threads of a node have used a core so far, by PARTS and 'other', s."""
    found = dict.fromkeys((*PARTS, 'other'), 0.0)
    for task in Path(f'/proc/{pid}/task').iterdir():
        try:
            name, seconds = (task / 'comm').read_text().strip(), processor_time(
                f'{pid}/task/{task.name}')
        except OSError:  # it has ended
            continue
        part = next((part for part, pattern in PARTS.items() if re.fullmatch(pattern, name)),
                    'other')
        found[part] += seconds
    return found


def reference_time(folder, calls=5):
    """
    Return the processor time of StereoBM(128, 15) on the pair of the bench with one thread, ms.

    Processors differ, and one that is shared is not equally fast at all times: other times are
    to be compared with this one. The least of some calls.

    """
    import cv2
    import numpy as np
    gray = [cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) for image in np.load(
        Path(folder) / 'pair.npy')]
    matcher, threads = cv2.StereoBM_create(128, 15), cv2.getNumThreads()
    cv2.setNumThreads(1)
    times = []
    for _ in range(calls):
        start = time.process_time()
        matcher.compute(*gray)
        times.append(1e3 * (time.process_time() - start))
    cv2.setNumThreads(threads)
    return min(times)


def peak_memory(pid):
    """Return the largest resident memory that a process had, MB."""
    for line in Path(f'/proc/{pid}/status').read_text().splitlines():
        if line.startswith('VmHWM'):
            return int(line.split()[1]) / 1000
    raise LiveError(f'process {pid} tells nothing of its memory')


if __name__ == '__main__':
    sys.exit(main())

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
"""A rig for the tests of the nodes: node processes, two tiny cameras, and what comes out."""

from array import array
from contextlib import contextmanager
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from color_stereo_ros.nodes.domains import own_domain

# Chosen before ROS is imported: these tests hear nobody else, and nobody hears them.
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
if 'COLOR_STEREO_TEST_DOMAIN' not in os.environ:  # else a test has started this process
    os.environ['COLOR_STEREO_TEST_DOMAIN'] = str(own_domain())
os.environ['ROS_DOMAIN_ID'] = os.environ['COLOR_STEREO_TEST_DOMAIN']
os.environ['PYTHONUNBUFFERED'] = '1'

from color_stereo_ros.core import StereoCalibration  # noqa: E402, I100
from color_stereo_ros.messages.contents import camera_info, Header  # noqa: E402
from color_stereo_ros.nodes.filling import message_of  # noqa: E402

import cv2  # noqa: E402

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402

import numpy as np  # noqa: E402

from rcl_interfaces.srv import (GetParameters, ListParameters,  # noqa: E402
                                SetParameters, SetParametersAtomically)

import rclpy  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.parameter import Parameter, parameter_value_to_python  # noqa: E402
from rclpy.qos import QoSProfile  # noqa: E402

from sensor_msgs.msg import CameraInfo, Image  # noqa: E402

ROOT = Path(__file__).resolve().parents[1]
SIZE = WIDTH, HEIGHT = 64, 48
DISPARITY = 10
DEPTH = 60.0 * 0.06 / DISPARITY
PATIENCE = 60.0
"""s until a test gives up; nothing depends on how fast things are."""
COMPILING = 300.0
"""s until a test gives up where kernels may have to be compiled, beside other tests."""
ASK_AGAIN = 10.0
"""s until a request to a service is repeated."""
PAPER = {'matching.method': 'paper', 'range.min_depth': 0.25, 'range.max_depth': 0.8,
         'color.smoothing': 0.0}
"""Parameters under which the tiny cameras work."""


def calibration(size=SIZE, baseline=0.06, verged=0.0):
    """Return the calibration of the tiny rig; `verged` in rad."""
    width, height = size
    camera = np.array([[60.0, 0, (width - 1) / 2], [0, 60.0, (height - 1) / 2], [0, 0, 1.0]])
    rotation = cv2.Rodrigues(np.array([0.0, verged, 0.0]))[0]
    center = np.array([baseline, 0.0, 0.0])
    return StereoCalibration.from_arrays(size, camera, None, camera, None, rotation,
                                         -rotation @ center)


def scene(size=SIZE, disparity=DISPARITY, seed=3):
    """Return a colorful card as both cameras see it, RGB."""
    width, height = size
    rng = np.random.default_rng(seed)
    wide = rng.integers(0, 256, (height, width + 64, 3)).astype(np.float32)
    wide = cv2.GaussianBlur(wide, (0, 0), 1.2)
    wide = cv2.normalize(wide, None, 20, 240, cv2.NORM_MINMAX).astype(np.uint8)
    return (np.ascontiguousarray(wide[:, 32:32 + width]),
            np.ascontiguousarray(wide[:, 32 + disparity:32 + disparity + width]))


def image_message(rgb, encoding='rgb8', **changes):
    """Return an image message; changes replace fields afterwards."""
    pixels = rgb[..., ::-1] if encoding.startswith('bgr') else rgb
    if encoding.endswith('a8'):
        pixels = np.concatenate((pixels, np.full((*rgb.shape[:2], 1), 9, np.uint8)), axis=2)
    msg = Image(height=rgb.shape[0], width=rgb.shape[1], encoding=encoding,
                step=rgb.shape[1] * pixels.shape[2], data=array('B', pixels.tobytes()))
    for name, value in changes.items():
        setattr(msg, name, value)
    return msg


def info_message(camera, **changes):
    """Return the CameraInfo of a CameraModel; changes replace fields afterwards."""
    header = Header(frame_id=f'{camera.name}_camera_optical_frame')
    msg = message_of(camera_info(camera, header))
    for name, value in changes.items():
        setattr(msg, name, value)
    return msg


class NodeProcess:
    """A node of this package in a process of its own."""

    started = []
    """All processes of this test session."""

    def __init__(self, log, module='range_node', parameters=None, arguments=(), environment=None):
        self.log = Path(log)
        code = f'from color_stereo_ros.nodes.{module} import main; raise SystemExit(main())'
        command = [sys.executable, '-c', code, '--ros-args']
        for name, value in (parameters or {}).items():
            text = str(value).lower() if isinstance(value, bool) else str(value)
            command += ['-p', f'{name}:={text}']
        with open(self.log, 'ab') as file:
            self.process = subprocess.Popen(
                [*command, *arguments], cwd=ROOT, stdout=file, stderr=subprocess.STDOUT,
                env={**os.environ, **(environment or {})})
        NodeProcess.started.append(self)

    def text(self):
        """Return all that the node has said."""
        return self.log.read_text(errors='replace')

    def wait_until_said(self, *words, since=0, patience=PATIENCE):
        """Wait until the log, from a position on, holds all words."""
        deadline = time.monotonic() + patience
        while time.monotonic() < deadline:
            if all(word in self.text()[since:] for word in words):
                return
            assert self.process.poll() is None, f'the node ended:\n{self.text()}'
            time.sleep(0.02)
        raise AssertionError(f'not said: {words}\n{self.text()[since:]}')

    def wait_until_ready(self):
        """Wait until the kernels are loaded, or compiled."""
        self.wait_until_said('ready after', patience=COMPILING)

    def memory(self):
        """Return the resident memory, kB."""
        for line in Path(f'/proc/{self.process.pid}/status').read_text().splitlines():
            if line.startswith('VmRSS'):
                return int(line.split()[1])
        raise AssertionError('no VmRSS')

    def __enter__(self):
        """Return this process."""
        return self

    def __exit__(self, *_):
        """Leave no process behind, whatever has failed."""
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()

    def stop(self, number=signal.SIGINT):
        """Send a signal and return the exit status."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        try:
            return self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise


class Rig:
    """Two cameras and listeners in the test's process."""

    def __init__(self, namespace='', node_name='range_node', qos=None, clock_start=None):
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node('test_rig', namespace=namespace, context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.target = f'{namespace}/{node_name}'
        qos = qos or QoSProfile(depth=10)
        self.publishers = {
            (side, kind): self.node.create_publisher(kind, f'{side}/{topic}', qos)
            for side in ('left', 'right')
            for kind, topic in ((Image, 'image_raw'), (CameraInfo, 'camera_info'))}
        self.received = {}
        self.calibration = calibration()
        self.images = dict(zip(('left', 'right'), scene()))
        self.stamp = clock_start or time.time_ns()
        self.period = 100_000_000
        self._clients = {}
        self._diagnostics = None

    def listen(self, kind, topic, qos=None):
        """Keep what arrives on a topic in `received[topic]`."""
        self.received[topic] = []
        return self.node.create_subscription(kind, topic, self.received[topic].append,
                                             qos or QoSProfile(depth=50))

    def spin(self, seconds):
        """Let messages come and go."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            self.executor.spin_once(timeout_sec=min(0.01, seconds))

    def spin_until(self, condition, what, patience=PATIENCE):
        """Spin until a condition holds and return its value."""
        deadline = time.monotonic() + patience
        while not (value := condition()):
            assert time.monotonic() < deadline, f'waited in vain for {what}'
            self.executor.spin_once(timeout_sec=0.02)
        return value

    def wait_for_node(self):
        """Wait until the node listens to both cameras."""
        self.spin_until(lambda: all(publisher.get_subscription_count()
                                    for publisher in self.publishers.values()), 'subscriptions')

    def wait_for_publishers(self):
        """Wait until somebody publishes all that is listened to."""
        self.spin_until(lambda: all(self.node.count_publishers(self.node.resolve_topic_name(topic))
                                    for topic in self.received), 'publishers')

    def tick(self):
        """Advance the stamp by a frame and return it, ns."""
        self.stamp += self.period
        return self.stamp

    def stamped(self, msg, stamp):
        """Put a stamp (ns) into the header of a message."""
        msg.header.stamp.sec, msg.header.stamp.nanosec = divmod(stamp, 1_000_000_000)
        if not msg.header.frame_id:
            msg.header.frame_id = 'left_camera_optical_frame'
        return msg

    def send_info(self, side, msg=None, **changes):
        """Publish the CameraInfo of a camera."""
        msg = msg or info_message(getattr(self.calibration, side), **changes)
        self.publishers[side, CameraInfo].publish(self.stamped(msg, self.stamp))

    def send_infos(self):
        """Publish both calibrations."""
        for side in ('left', 'right'):
            self.send_info(side)

    def send_image(self, side, stamp, msg=None):
        """Publish an image of a camera."""
        msg = msg or image_message(self.images[side])
        self.publishers[side, Image].publish(self.stamped(msg, stamp))

    def send_pair(self, stamp=None, infos=True, **messages):
        """Publish a pair with one stamp and return the stamp, ns."""
        stamp = self.tick() if stamp is None else stamp
        if infos:
            self.send_infos()
        for side in ('left', 'right'):
            self.send_image(side, stamp, messages.get(side))
        return stamp

    def stamps(self, topic):
        """Return the stamps of what arrived on a topic, ns."""
        return [message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
                for message in self.received[topic]]

    def await_output(self, topic, stamp):
        """Wait for the message with a stamp and return it."""
        self.spin_until(lambda: stamp in self.stamps(topic), f'{topic} of {stamp}')
        return self.received[topic][self.stamps(topic).index(stamp)]

    def first_output(self, topic):
        """Send pairs until the first output arrives (kernels may have to be compiled)."""
        deadline = time.monotonic() + COMPILING
        while not self.received[topic]:
            assert time.monotonic() < deadline, f'no {topic}'
            self.send_pair()
            self.spin(0.2)
        return self.received[topic][-1]

    def good_pair(self, topic='depth/image'):
        """Send a pair and return its output."""
        return self.await_output(topic, self.send_pair())

    def call(self, kind, name, request):
        """Call a service and return the response; the request may arrive more than once."""
        client = self._clients.get(name)
        if client is None:
            client = self._clients[name] = self.node.create_client(kind, name)
        futures = []

        def answer():
            # a server that has just gone may still count as ready, and never answers
            if len(futures) <= (time.monotonic() - start) / ASK_AGAIN:
                futures.append(client.call_async(request))
            return next((future.result() for future in futures if future.done()), None)

        self.spin_until(client.service_is_ready, name)
        start = time.monotonic()
        return self.spin_until(answer, f'answer of {name}')

    def set_parameters(self, atomically=True, **values):
        """Set parameters (`__` stands for a dot) and return the results."""
        parameters = [Parameter(name.replace('__', '.'), value=value).to_parameter_msg()
                      for name, value in values.items()]
        if atomically:
            request = SetParametersAtomically.Request(parameters=parameters)
            return self.call(SetParametersAtomically,
                             f'{self.target}/set_parameters_atomically', request).result
        request = SetParameters.Request(parameters=parameters)
        return self.call(SetParameters, f'{self.target}/set_parameters', request).results

    def get_parameter(self, name):
        """Return the value of a parameter."""
        request = GetParameters.Request(names=[name])
        answer = self.call(GetParameters, f'{self.target}/get_parameters', request)
        return parameter_value_to_python(answer.values[0])

    def parameter_names(self):
        """Return the names of all parameters."""
        answer = self.call(ListParameters, f'{self.target}/list_parameters',
                           ListParameters.Request())
        return answer.result.names

    def diagnose(self, condition, what):
        """Wait until the diagnostics fulfil a condition and return them as {part: status}."""
        if self._diagnostics is None:
            self._diagnostics = []
            self.node.create_subscription(DiagnosticArray, '/diagnostics',
                                          self._diagnostics.append, 10)
        self._diagnostics.clear()
        owner = self.target.lstrip('/')

        def latest():
            for message in reversed(self._diagnostics):
                parts = {status.name.partition(': ')[2]: status for status in message.status
                         if status.name.startswith(f'{owner}:')}
                if parts and condition(parts):
                    return parts
            return None

        return self.spin_until(latest, f'diagnostics: {what}')

    def feed(self, condition, what):
        """Send pairs until the diagnostics fulfil a condition; return what `diagnose` does."""
        timer = self.node.create_timer(0.1, self.send_pair)
        try:
            return self.diagnose(condition, what)
        finally:
            self.node.destroy_timer(timer)

    def close(self):
        """Leave ROS."""
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


def values_of(status):
    """Return the values of a DiagnosticStatus as a dict."""
    return {value.key: value.value for value in status.values}


def floats(msg):
    """Return the pixels of a 32FC1 image message."""
    return np.frombuffer(msg.data, np.float32).reshape(msg.height, msg.width)


@contextmanager
def silent_rig(folder, **parameters):
    """Yield a rig without any listener, whose node is ready; the node must end well."""
    with NodeProcess(folder / 'log.txt', parameters={
            **PAPER, 'output.diagnostics_period': 0.1, 'sync.warn_after': 1.0,
            **parameters}) as node:
        rig = Rig()
        rig.folder, rig.process = folder, node
        rig.wait_for_node()
        node.wait_until_ready()
        yield rig
        assert node.stop() == 0
        rig.close()
        assert 'Traceback' not in node.text()


@contextmanager
def answering(log, parameters, kinds, first):
    """
    Yield a rig whose range_node has answered once; afterwards the node must end in good order.

    kinds: topics that are listened to and their message classes; first: topic of the answer, or
    None if it is enough that the node is ready.

    """
    with NodeProcess(log, parameters=parameters) as node:
        rig = Rig()
        rig.process = node
        for topic, kind in kinds.items():
            rig.listen(kind, topic)
        rig.wait_for_node()
        rig.wait_for_publishers()
        if first:
            rig.first_output(first)
        else:
            node.wait_until_ready()
        yield rig
        status = node.stop()
        rig.close()
        assert status == 0, node.text()
        assert 'Traceback' not in node.text()

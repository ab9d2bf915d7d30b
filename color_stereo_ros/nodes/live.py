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
"""Start nodes as processes of their own, listen to what they publish, and end them for certain."""

from contextlib import contextmanager
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from ..errors import ColorStereoError

GRACE = 5.0  # s between SIGINT and SIGKILL
TAIL = 12    # lines of a log that an error message shows


class LiveError(ColorStereoError):
    """A process ended too early, or no output came."""


class Processes:
    """
    Modules that run as processes, each with a log file; all are ended on exit.

    Parameters
    ----------
    log_folder : Path
        Holds NAME.txt for each process.

    """

    def __init__(self, log_folder):
        self._folder = Path(log_folder)
        self._running = {}

    def __enter__(self):
        self._folder.mkdir(parents=True, exist_ok=True)
        return self

    def __exit__(self, *_):
        self.stop_all()

    def start(self, name, module, *arguments):
        """
        Start the function `main` of a module, as its executable does; log to NAME.txt.

        Returns
        -------
        pid : int

        """
        code = f'from {module} import main; raise SystemExit(main())'
        command = [sys.executable, '-u', '-c', code, *map(str, arguments)]
        with open(self._log(name), 'wb') as log, _interrupts_postponed():
            # A session of its own: Ctrl-C reaches this process alone, which then ends the others
            # in order; and whatever the child starts can be ended with it.
            self._running[name] = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
                start_new_session=True)
        return self._running[name].pid

    def check(self):
        """Raise LiveError with the last lines of its log if a process has ended."""
        for name, process in self._running.items():
            if process.poll() is not None:
                raise LiveError(f'{name} ended with status {process.returncode}; it said:\n'
                                f'{self.log_tail(name)}')

    def log(self, name):
        """Return all that a process wrote."""
        return self._log(name).read_text(errors='replace')

    def log_tail(self, name):
        """Return the last lines that a process wrote."""
        lines = self.log(name).splitlines()
        return '\n'.join(f'    {line}' for line in lines[-TAIL:]) or '    (nothing)'

    def stop_all(self):
        """End every process: SIGINT first, SIGKILL for those that do not obey in time."""
        for process in self._running.values():
            _signal(process, signal.SIGINT)
        end = time.monotonic() + GRACE
        for process in self._running.values():
            try:
                process.wait(max(end - time.monotonic(), 0.0))
            except subprocess.TimeoutExpired:
                _signal(process, signal.SIGKILL)
                process.wait()
        self._running.clear()

    def _log(self, name):
        return self._folder / f'{name}.txt'


@contextmanager
def _interrupts_postponed():
    """Hold SIGINT and SIGTERM back: a process must not start without being known."""
    came = []
    previous = {number: signal.signal(number, lambda number, _: came.append(number))
                for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
    if came:
        raise KeyboardInterrupt


def _signal(process, number):
    try:
        os.killpg(process.pid, number)
    except ProcessLookupError:
        pass  # it has ended by itself


@contextmanager
def ros_node(name):
    """
    Yield a node whose context ends with the block; SIGTERM then raises KeyboardInterrupt too.

    Raises
    ------
    ModuleNotFoundError
        If rclpy is not installed.

    """
    import rclpy
    from rclpy.signals import SignalHandlerOptions
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    previous = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield rclpy.create_node(name, enable_rosout=False)
    finally:
        signal.signal(signal.SIGTERM, previous)
        rclpy.try_shutdown()


class Collector:
    """
    Keeps messages by stamp until all topics have one of the same stamp.

    Parameters
    ----------
    node : rclpy.node.Node
    namespace : str
    topics : dict
        Relative topic name to message class; each message has a header.

    """

    KEPT = 10  # stamps

    def __init__(self, node, namespace, topics):
        prefix = f'/{namespace}/' if namespace else '/'
        self._node = node
        self._topics = set(topics)
        self._by_stamp = {}
        self.received = dict.fromkeys(topics, 0)
        """Number of messages of each topic."""
        self._subscriptions = [
            node.create_subscription(kind, f'{prefix}{topic}', self._keeper(topic), 5)
            for topic, kind in topics.items()]

    def _keeper(self, topic):
        def keep(message):
            self.received[topic] += 1
            stamp = message.header.stamp
            self._by_stamp.setdefault((stamp.sec, stamp.nanosec), {})[topic] = message
            while len(self._by_stamp) > self.KEPT:
                del self._by_stamp[next(iter(self._by_stamp))]
        return keep

    def complete_set(self):
        """Return topic name to message of one stamp that has all topics, or None."""
        for messages in self._by_stamp.values():
            if messages.keys() == self._topics:
                return messages
        return None

    def latest(self, topic):
        """Return the latest message of a topic, or None."""
        found = [messages[topic] for messages in self._by_stamp.values() if topic in messages]
        return found[-1] if found else None

    def forget(self):
        """Start anew."""
        self._by_stamp.clear()

    def close(self):
        """Unsubscribe."""
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)


def latched(node, kind, topic):
    """
    Subscribe to a transient local topic.

    Returns
    -------
    messages : list
        Fills with messages while the node spins.

    """
    from rclpy.qos import DurabilityPolicy, QoSProfile
    messages = []
    profile = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(kind, topic, messages.append, profile)
    return messages


def spin_until(node, condition, timeout, check):
    """
    Spin a node until a condition holds.

    Parameters
    ----------
    node : rclpy.node.Node
        The node that spins.
    condition : callable
        Returns True when it is met.
    timeout : float
        s
    check : callable
        Called again and again; raises when waiting has no purpose any more.

    Returns
    -------
    held : bool
        False if the time ran out.

    """
    import rclpy
    end = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > end:
            return False
        check()
        rclpy.spin_once(node, timeout_sec=0.1)
    return True

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
"""The thread that takes calls of services and sends their answers, which may be long in coming."""

from collections import deque
from functools import partial
import threading
import time
import traceback

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile

from std_srvs.srv import Trigger

from ..received import received_at
from ...messages.capture_calls import LIMIT

POLL = 0.05
"""s until the thread notices the end, or that time is over."""
_BURST = 8
"""Answers to one client at once: it may keep no more than 10 that it has not read yet."""
_PAUSE = 0.0015
"""s between further ones."""
_UNDER_WAY = 250_000_000
"""ns that a call is under way at most; else the clocks of caller and node differ."""


class Reply:
    """
    The answer to a call, which anybody may give once, in any thread.

    Parameters
    ----------
    thread : ServiceThread
    send : callable
        Called with a response in the thread.
    number : int
        Of the call; two calls of one client have different ones.
    received, sent : float
        When the middleware received and sent the call, s of `time.monotonic`.

    """

    def __init__(self, thread, send, number, received, sent):
        self._thread, self._send, self._number = thread, send, number
        self.received, self.sent = received, sent

    def __call__(self, success, message):
        """Answer."""
        response = Trigger.Response(success=success, message=message)
        self._thread.post_answer(self._number, partial(self._send, response))


class ServiceThread:
    """
    Takes calls in a thread of its own; none waits for another.

    The executor of the node takes images; it must not wait for a middleware that sends answers.
    The thread has an executor and a (hidden) node for it. The services belong to the visible node,
    so that `ros2 node info` shows them.

    Parameters
    ----------
    node : rclpy.node.Node
        The node that the services belong to.

    """

    def __init__(self, node):
        self._node = node
        self._stopped = threading.Event()
        self._helper = Node(f'_{node.get_name()}_services', namespace=node.get_namespace(),
                            use_global_arguments=False, enable_rosout=False,
                            start_parameter_services=False, context=node.context)
        self._executor = SingleThreadedExecutor(context=node.context)
        self._woken = self._helper.create_guard_condition(lambda: None)
        self._work, self._answers = deque(), deque()  # callables; (number, callable)
        self._sent = 0.0
        self._ticks, self._ends = [], []
        self._thread = threading.Thread(target=self._spin, name='services', daemon=True)

    def create(self, name, callback):
        """
        Create a service; call it before `start`.

        Parameters
        ----------
        name : str
            Such as ~/capture.
        callback : callable
            Called with a Reply for each call of the std_srvs/Trigger; must not wait.

        """
        service = self._node.create_service(
            Trigger, name, lambda _, response: response, qos_profile=QoSProfile(depth=LIMIT),
            callback_group=self._helper.default_callback_group)
        # rclpy gives a service to the executor of its node, and has no call to change that
        self._node._services.remove(service)
        self._helper._services.append(service)
        send = service.send_response
        # rclpy hands the header of a request to `send_response` only
        service.send_response = lambda _, header: self._take_all(service, send, callback, header)

    def _take_all(self, service, send, callback, header):
        """Take a call and those that wait behind it: the executor looks for one at a time."""
        while header is not None:
            self._take(send, callback, header)
            with service.handle:
                _, header = service.handle.service_take_request(service.srv_type.Request)

    def _take(self, send, callback, header):
        """Take a call: begin what answers it."""
        received = received_at(header.received_timestamp)
        under_way = header.received_timestamp - header.source_timestamp
        reply = Reply(self, lambda response: send(response, header),
                      header.request_id.sequence_number, received,
                      received - (under_way * 1e-9 if 0 <= under_way <= _UNDER_WAY else 0.0))
        try:
            callback(reply)
        except Exception as error:  # the client is answered all the same
            reply(False, f'{type(error).__name__}: {error}')
            self._node.get_logger().error(traceback.format_exc())

    def on_tick(self, callback):
        """Call something many times a second in the thread."""
        self._ticks.append(callback)

    def on_end(self, callback):
        """Call something at the end that answers all calls that wait."""
        self._ends.append(callback)

    def post(self, work):
        """Let the thread call something soon; any thread may ask for it."""
        self._work.append(work)
        self._wake()

    def post_answer(self, number, send):
        """Let the thread send the answer to a call; any thread may ask for it."""
        self._answers.append((number, send))
        self._wake()

    def _wake(self):
        if self._node.context.ok() and not self._stopped.is_set():
            self._woken.trigger()

    def start(self):
        """Begin to serve."""
        self._executor.add_node(self._helper)
        self._thread.start()

    def _spin(self):
        while self._node.context.ok() and not self._stopped.is_set():
            try:
                self._executor.spin_once(timeout_sec=_PAUSE if self._answers else POLL)
                self._do_work()
                self._send()
            except Exception:  # the next call is served all the same
                if self._node.context.ok():
                    self._node.get_logger().error(traceback.format_exc())

    def _do_work(self):
        for tick in self._ticks:
            tick()
        while self._work:
            self._work.popleft()()

    def _send(self):
        """
        Send the answers, to each client no more than it can keep.

        Who called is not known. But answers of one number go to different clients.

        """
        while self._answers:
            if len({number for number, _ in list(self._answers)}) > _BURST:
                if time.monotonic() - self._sent < _PAUSE:
                    return
                self._sent = time.monotonic()
            first = self._answers[0][0]
            while self._answers and self._answers[0][0] == first:
                self._answers.popleft()[1]()

    def destroy(self):
        """Stop serving; calls that wait are answered first."""
        self._stopped.set()
        self._thread.join()
        for end in self._ends:
            end()
        while self._answers and self._node.context.ok():
            self._send()
            time.sleep(_PAUSE)
        self._executor.shutdown()
        self._helper.destroy_node()

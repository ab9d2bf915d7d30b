# SPDX-License-Identifier: Apache-2.0
"""The service ~/capture: measure one pair that is taken after the call."""

from dataclasses import dataclass, field
import threading
import time

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.qos import QoSProfile

from std_msgs.msg import Header

from ..filling import message_of
from .services import POLL

_COMPARABLE = 60_000_000_000  # ns; stamps farther from now are of another clock


@dataclass(eq=False)
class Request:
    """One request to measure a pair that was taken after the call."""

    moment: float
    """s of `time.monotonic`."""
    stamp: int
    """ns of the node's clock."""
    acquired: object = None
    """The pair that answers it: both images are there, what was looked at may move again."""
    done: threading.Event = field(default_factory=threading.Event)
    failure: str = ''
    result: object = None
    header: object = None
    rotation: object = None
    age: object = None
    """Of the latest pair that arrived after the call but was taken before, on arrival, ns."""
    _passed: int = 0

    def accepts(self, pair):
        """Tell whether a pair was taken after the call; ask once a pair."""
        if pair.arrival < self.moment:
            return False
        if abs(pair.stamp - self.stamp) < _COMPARABLE:
            if pair.stamp < self.stamp:
                self.age = self.stamp + (pair.arrival - self.moment) * 1e9 - pair.stamp
            return pair.stamp >= self.stamp
        # stamps of another clock: the first pair may have been under way already
        self._passed += 1
        return self._passed > 1

    def finish(self, failure='', result=None, header=None, rotation=None):
        """Hand over the outcome."""
        self.failure, self.result, self.header = failure, result, header
        self.rotation = rotation
        self.done.set()


class Capture:
    """
    Finds a pair for each call, and says on ~/acquired when both images are there.

    Parameters
    ----------
    node : rclpy.node.Node
    services : ServiceThread
    sensor : RangeSensor

    """

    def __init__(self, node, services, sensor):
        self._node, self._services, self._sensor = node, services, sensor
        self._requests = []
        self.latest = None
        """The last Request that got a result, or None."""
        self._acquired = node.create_publisher(
            Header, '~/acquired', QoSProfile(depth=1),
            event_callbacks=PublisherEventCallbacks(use_default_callbacks=False))  # see `qos`
        services.create('~/capture', self._serve)

    def takes(self, pair):
        """Tell whether a pair answers an open request; runs in the executor's thread."""
        requested = [request for request in self._requests
                     if not request.acquired and request.accepts(pair)]
        for request in requested:
            request.acquired = pair
        if requested:
            self._acquired.publish(message_of(pair.left.header))
        return bool(requested)

    def succeed(self, pair, result, context):
        """Answer the requests for a pair; runs in the worker's thread, as `fail` does."""
        for request in self._requests_for(pair):
            request.finish(result=result, header=context.header, rotation=context.rotation)

    def fail(self, pair, text):
        """Answer the requests for a pair that gives no result with the reason."""
        for request in self._requests_for(pair):
            request.finish(text)

    def _requests_for(self, pair):
        """Return the requests that a pair answers: theirs, or one that replaced it."""
        return [request for request in list(self._requests)
                if request.acquired and request.acquired.arrival <= pair.arrival]

    def measure(self):
        """Return a finished Request; waits, so call it in the thread of the services."""
        request = Request(time.monotonic(), self._node.get_clock().now().nanoseconds)
        patience = self._sensor.settings.sync.warn_after
        self._requests.append(request)
        while not request.done.wait(POLL) and not self._services.stopped.is_set():
            if time.monotonic() - request.moment > patience:
                request.finish(self._sensor.why_no_result(request, patience))
        if request in self._requests:
            self._requests.remove(request)
        if not request.failure and request.result is not None:
            self.latest = request
        return request

    def _serve(self, _, response):
        request = self.measure()
        response.success = not request.failure and request.result is not None
        if response.success:
            stamp = request.header.stamp
            response.message = (f'stamp {stamp.sec}.{stamp.nanosec:09d}: '
                                f'{request.result.density:.1%} of the pixels have a range')
        else:
            response.message = request.failure or 'the node is shutting down'
        return response

    def destroy(self):
        """Leave ~/acquired; the service ends with its thread."""
        self._node.destroy_publisher(self._acquired)

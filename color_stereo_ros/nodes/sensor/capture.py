# SPDX-License-Identifier: Apache-2.0
"""Stop and look: measure one pair on request, and save what was measured."""

from dataclasses import dataclass, field
from pathlib import Path
import threading
import time
import traceback

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from std_srvs.srv import Trigger

from ...errors import RecordingError
from ...files.cloud import save_cloud
from ...messages.reading import stamp_ns

_COMPARABLE = 60_000_000_000  # ns; stamps farther from now are of another clock
_POLL = 0.05


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
    _passed: int = 0

    def accepts(self, pair):
        """Tell whether a pair was taken after the call; ask once a pair."""
        if pair.arrival < self.moment:
            return False
        if abs(pair.stamp - self.stamp) < _COMPARABLE:
            return pair.stamp >= self.stamp
        # stamps of another clock: the first pair may have been under way already
        self._passed += 1
        return self._passed > 1

    def finish(self, failure='', result=None, header=None, rotation=None):
        """Hand over the outcome."""
        self.failure, self.result, self.header = failure, result, header
        self.rotation = rotation
        self.done.set()


class CaptureServices:
    """
    The services ~/capture and ~/save.

    They wait for a pair, so they live in a thread and a (hidden) node of their own: an executor
    that waits inside of a service takes no images.

    Parameters
    ----------
    node : rclpy.node.Node
        The node by whose name the services go.
    sensor : RangeSensor

    """

    def __init__(self, node, sensor):
        self._node, self._sensor = node, sensor
        self._stopped = threading.Event()
        self._latest = None
        self._helper = Node(f'_{node.get_name()}_services', namespace=node.get_namespace(),
                            use_global_arguments=False, enable_rosout=False,
                            start_parameter_services=False, context=node.context)
        for name, callback in (('~/capture', self._capture), ('~/save', self._save)):
            self._helper.create_service(Trigger, node.resolve_service_name(name), callback)
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(self._helper)
        self._thread = threading.Thread(target=self._spin, name='services', daemon=True)
        self._thread.start()

    def _spin(self):
        while self._node.context.ok() and not self._stopped.is_set():
            try:
                self._executor.spin_once(timeout_sec=_POLL)
            except Exception:  # the next call is served all the same
                if self._node.context.ok():
                    self._node.get_logger().error(traceback.format_exc())

    def _measure(self):
        """Return a finished request."""
        request = Request(time.monotonic(), self._node.get_clock().now().nanoseconds)
        patience = self._sensor.settings.sync.warn_after
        self._sensor.requests.append(request)
        while not request.done.wait(_POLL) and not self._stopped.is_set():
            if time.monotonic() - request.moment > patience:
                request.finish(self._sensor.why_no_result(patience))
        if request in self._sensor.requests:
            self._sensor.requests.remove(request)
        if not request.failure and request.result is not None:
            self._latest = request
        return request

    def _capture(self, _, response):
        request = self._measure()
        response.success = not request.failure and request.result is not None
        if response.success:
            stamp = request.header.stamp
            response.message = (f'stamp {stamp.sec}.{stamp.nanosec:09d}: '
                                f'{request.result.density:.1%} of the pixels have a range')
        else:
            response.message = request.failure or 'the node is shutting down'
        return response

    def _save(self, _, response):
        try:
            response.message = self._save_latest()
            response.success = True
        except RecordingError as error:
            response.success = False
            response.message = str(error)
            self._node.get_logger().error(f'save: {error}')
        return response

    def _save_latest(self):
        """Write the points of the last capture, or of a new pair when streaming."""
        settings = self._sensor.settings
        streaming = settings.input.mode == 'stream'
        request = self._measure() if streaming else self._latest
        if request is None:
            raise RecordingError('nothing has been captured yet: call ~/capture first')
        if request.result is None:
            raise RecordingError(request.failure or 'the node is shutting down')
        folder = Path(settings.output.save_directory or '.')
        if not folder.is_dir():
            raise RecordingError(f'output.save_directory = {str(folder)!r} is no directory')
        name = f'{self._node.get_name()}_{stamp_ns(request.header)}.{settings.output.save_format}'
        points = request.result.points()
        if settings.output.frame == 'camera':
            points = points @ request.rotation.T.astype(points.dtype)
        count = save_cloud(folder / name, points, request.result.image)
        return f'{folder / name}: {count} points'

    def destroy(self):
        """Stop serving; a call that waits is answered first."""
        self._stopped.set()
        self._thread.join()
        self._executor.shutdown()
        self._helper.destroy_node()

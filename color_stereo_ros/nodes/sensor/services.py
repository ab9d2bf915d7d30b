# SPDX-License-Identifier: Apache-2.0
"""The thread in which services may wait for a pair."""

import threading
import traceback

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from std_srvs.srv import Trigger

POLL = 0.05
"""s until a service that waits, or the thread, notices the end."""


class ServiceThread:
    """
    Serves calls in a thread and a (hidden) node of its own.

    An executor that waits inside of a service takes no images, so that of the node cannot.

    Parameters
    ----------
    node : rclpy.node.Node
        The node by whose name the services go.

    """

    def __init__(self, node):
        self._node = node
        self.stopped = threading.Event()
        """Set when no call may wait any longer."""
        self._helper = Node(f'_{node.get_name()}_services', namespace=node.get_namespace(),
                            use_global_arguments=False, enable_rosout=False,
                            start_parameter_services=False, context=node.context)
        self._executor = SingleThreadedExecutor(context=node.context)
        self._thread = threading.Thread(target=self._spin, name='services', daemon=True)

    def create(self, name, callback):
        """
        Create a service; call it before `start`.

        Parameters
        ----------
        name : str
            Such as ~/capture.
        callback : callable
            Called with request and response of a std_srvs/Trigger, returns the response.

        Returns
        -------
        service : rclpy.service.Service

        """
        return self._helper.create_service(Trigger, self._node.resolve_service_name(name),
                                           callback)

    def start(self):
        """Begin to serve."""
        self._executor.add_node(self._helper)
        self._thread.start()

    def _spin(self):
        while self._node.context.ok() and not self.stopped.is_set():
            try:
                self._executor.spin_once(timeout_sec=POLL)
            except Exception:  # the next call is served all the same
                if self._node.context.ok():
                    self._node.get_logger().error(traceback.format_exc())

    def destroy(self):
        """Stop serving; a call that waits is answered first."""
        self.stopped.set()
        self._thread.join()
        self._executor.shutdown()
        self._helper.destroy_node()

# SPDX-License-Identifier: Apache-2.0
"""Start a node, let it run, and leave with status 0 when asked to."""

import os
import signal
import sys
import threading


def run(make_node, args=None):
    """
    Run a node until SIGINT, SIGTERM or the shutdown of ROS.

    Parameters
    ----------
    make_node : callable
        Returns the node. It is called after rclpy is ready, and may import what takes time.
    args : list of str, optional
        Command line; default sys.argv.

    Returns
    -------
    status : int
        0 after a clean end, 1 if the settings are refused.

    """
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(0))
    try:
        status = _run(make_node, args)
    except KeyboardInterrupt:
        status = 0
    if any(thread.is_alive() for thread in threading.enumerate()
           if thread is not threading.main_thread()):
        # a thread that compiles cannot be interrupted, and must not see the interpreter go
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    return status


def _run(make_node, args):
    import rclpy
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

    from ..core.types import ColorStereoError

    rclpy.init(args=args)
    node = None
    try:
        node = make_node()
        # the experimental EventsExecutor of Jazzy hangs in some builds: no timer ever fires
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except ColorStereoError as error:
        rclpy.logging.get_logger('color_stereo_ros').fatal(str(error))
        return 1
    finally:
        # a second Ctrl-C must not interrupt the first one's work
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0

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
"""Start a node, let it run, and leave with status 0 when asked to."""

import os
import signal
import sys
import threading
import traceback

from . import usage as help_text
from .environment import prepare
from ..errors import InstallationError, pip_install

_POLL = 0.1
"""s until a signal is noticed by an idle node."""
_TRACE = 4000
"""Characters of a traceback that are logged."""


def run(make_node, args=None, usage=None):
    """
    Run a node until SIGINT, SIGTERM or the shutdown of ROS.

    An exception in a callback is logged, and the node goes on.

    Parameters
    ----------
    make_node : callable
        Returns the node. It is called after rclpy is ready, and may import what takes time.
    args : list of str, optional
        Command line; default sys.argv.
    usage : callable, optional
        Returns the `Usage` that is printed, instead of starting the node, if the command line
        asks for help.

    Returns
    -------
    status : int
        0 after a clean end or the help, 1 if the settings are refused or a package is missing.

    """
    try:
        if usage is not None and help_text.is_wanted(sys.argv[1:] if args is None else args):
            help_text.show(usage())
            return 0
        return _run_until_signal(make_node, args)
    except ImportError as error:
        print(_what_to_install(error), file=sys.stderr)
        return 1


def _what_to_install(error):
    """Return one sentence about a missing package; raise the error again if it is unknown."""
    if isinstance(error, InstallationError):
        return str(error)
    if (error.name or '').partition('.')[0] != 'rclpy':
        raise error
    return ('rclpy is not installed, but the nodes need ROS 2: source the setup.bash of ROS 2, or '
            + pip_install('ros'))


def _run_until_signal(make_node, args):
    """Run a node; return the status."""
    # rclpy's own handlers end the context while callbacks and threads still use it
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    prepare()
    status = _run(make_node, args, stop)
    if threading.active_count() > 1:
        # a thread that compiles cannot be interrupted, and must not see the interpreter go
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    return status


def _run(make_node, args, stop):
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    from ..errors import bounded, ColorStereoError

    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # a parameter file that is not there, or no YAML
        print(f'the arguments of the node are refused: {error}'.splitlines()[0], file=sys.stderr)
        return 1
    node = None
    try:
        node = make_node()
        _spin(node, stop)
    except ColorStereoError as error:
        rclpy.logging.get_logger('color_stereo_ros').fatal(bounded(str(error)))
        return 1
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0


def _spin(node, stop):
    """Serve the callbacks of a node until the event is set."""
    # the experimental EventsExecutor of Jazzy hangs in some builds: no timer ever fires
    from rclpy.executors import SingleThreadedExecutor

    from ..errors import bounded
    from .complaints import Complaints

    complain = Complaints(lambda text: node.get_logger().error(bounded(text, _TRACE)))
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while node.context.ok() and not stop.is_set():
        try:
            executor.spin_once(timeout_sec=_POLL)
        except Exception:  # whatever happens in a callback, the node lives on
            if node.context.ok():
                complain(traceback.format_exc())

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
"""Cameras that say when they exposed, and captures that are judged by it, over real DDS."""

from contextlib import contextmanager
import time

from rclpy.qos import QoSProfile

from ros_rig import image_message, silent_rig

from std_msgs.msg import Header

from std_srvs.srv import Trigger

TIMEOUT = 30.0
"""capture.timeout, s: the machine may be busy."""


class Cameras:
    """
    Two cameras that say in the frame_id when they exposed, ns of `time.time`.

    Parameters
    ----------
    rig : Rig
    stamp : callable
        Called with the wall clock, ns, returns the stamp.
    period, delay : float
        s between exposures and from exposure to sending. A period of 0 waits for `expose`.

    """

    def __init__(self, rig, stamp, period=0.04, delay=0.03):
        self._rig, self._stamp = rig, stamp
        self._period, self._delay = period, delay
        self._next, self._on_the_way = time.monotonic(), []
        self._timer = rig.node.create_timer(0.005, self._look)
        rig.send_infos()

    def _look(self):
        now = time.monotonic()
        if self._period and now >= self._next:
            self._next = max(self._next + self._period, now)
            self.expose()
        while self._on_the_way and self._on_the_way[0][0] <= now:
            _, exposed, stamp = self._on_the_way.pop(0)
            for side in ('left', 'right'):
                msg = self._rig.image_messages[side]
                msg.header.frame_id = f'optical {exposed}'
                self._rig.send_image(side, stamp, msg)

    def expose(self):
        """Take a pair now."""
        wall = time.time_ns()
        self._on_the_way.append((time.monotonic() + self._delay, wall, self._stamp(wall)))

    def pause(self, seconds):
        """Expose nothing for a while; `go_on` ends it."""
        self._kept, self._period = self._period, 0
        self._rig.spin(seconds)

    def go_on(self):
        """Expose at once, and with the period from now on."""
        self.expose()
        self._period, self._next = self._kept, time.monotonic() + self._kept

    def close(self):
        """Stop."""
        self._rig.node.destroy_timer(self._timer)


@contextmanager
def cameras(rig, stamp, **options):
    """Yield Cameras that have been seen for a while."""
    rig.image_messages = {side: image_message(rig.images[side]) for side in ('left', 'right')}
    found = Cameras(rig, stamp, **options)
    try:
        rig.spin(1.5)
        yield found
    finally:
        found.close()


@contextmanager
def prepared(folder, **parameters):
    """Yield a rig that hears what is acquired."""
    with silent_rig(folder, **{'input.mode': 'capture', 'capture.timeout': TIMEOUT,
                               **parameters}) as found:
        found.acquired = []
        found.node.create_subscription(Header, f'{found.target}/acquired', found.acquired.append,
                                       QoSProfile(depth=50))
        found.client = found.node.create_client(Trigger, f'{found.target}/capture',
                                                qos_profile=QoSProfile(depth=1000))
        found.spin_until(found.client.service_is_ready, 'the service')
        found.spin_until(lambda: found.node.count_publishers(f'{found.target}/acquired'), 'topic')
        yield found


def captured(rig, meanwhile=lambda: None):
    """Capture; return when the call was made, the exposure that answers, and the answer."""
    rig.acquired.clear()
    called = time.time_ns()
    future = rig.client.call_async(Trigger.Request())
    meanwhile()
    rig.spin_until(lambda: future.done() and (rig.acquired or not future.result().success),
                   'the answer')
    exposed = int(rig.acquired[-1].frame_id.split()[1]) if rig.acquired else None
    return called, exposed, future.result()


def judge(figures, name, outcomes):
    """Ask that all captures succeeded, each with a pair from after its call."""
    early = [f'{(called - exposed) / 1e6:.1f} ms: {answer.message}'
             for called, exposed, answer in outcomes if answer.success and exposed < called]
    print(*early, sep='\n')  # shown where the figure misses its goal
    failed = [answer.message for _, _, answer in outcomes if not answer.success]
    figures(f'capture over DDS, {name}: pairs from before the call', len(early), 'pairs',
            over=len(outcomes), at_most=0)
    figures(f'capture over DDS, {name}: failures', len(failed), 'calls', over=len(outcomes))
    assert not failed

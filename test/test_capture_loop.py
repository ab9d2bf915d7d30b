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
"""~/capture over real DDS under a /clock that starts again, as a recording in a loop has it."""

from random import Random
import time

from capture_rig import cameras, captured, judge, prepared

from capture_world import Loop, NS

from rosgraph_msgs.msg import Clock


def test_a_looped_clock_and_recording_are_captured_after_the_call(tmp_path, effort, figures):
    loop, random, outcomes = Loop(length=3.0), Random(1), []
    with prepared(tmp_path, use_sim_time=True) as rig:
        start, publisher = time.time_ns(), rig.node.create_publisher(Clock, '/clock', 10)

        def tick():
            msg = Clock()
            msg.clock.sec, msg.clock.nanosec = divmod(loop.time(time.time_ns() - start), NS)
            publisher.publish(msg)

        rig.node.create_timer(0.02, tick)
        with cameras(rig, lambda wall: loop.time(wall - start)):
            for _ in range(effort.count(15, 1000)):
                rig.spin(random.random() * 0.2)
                outcomes.append(captured(rig))
    judge(figures, 'looped /clock', outcomes)

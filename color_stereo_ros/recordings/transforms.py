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
"""The poses of a frame in another one at some times, from /tf and /tf_static of a recording."""

from bisect import bisect_left

import numpy as np

from ..errors import RecordingError
from ..messages.reading import stamp_ns

TOPICS = '/tf', '/tf_static'
LONGEST_GAP = 200_000_000  # ns; chosen: five messages a second, less is no robot in motion


class Transforms:
    """
    The transforms of a recording.

    Parameters
    ----------
    recording : Recording

    Raises
    ------
    RecordingError
        If there are none.

    """

    def __init__(self, recording):
        wanted = [topic for topic in TOPICS if topic in recording.topics]
        if not wanted:
            raise RecordingError(f'{recording.path}: holds no {" and no ".join(TOPICS)}; record '
                                 'them, or name a file of flange poses')
        self._parents = {}
        self._moving = {}
        self._static = {}
        for message in recording.messages(wanted):
            for entry in recording.decoded(message).transforms:
                self._take(entry, message.topic == TOPICS[1])
        self._times = {child: [time for time, _ in entries]
                       for child, entries in self._moving.items()}

    def _take(self, entry, is_static):
        child = entry.child_frame_id.lstrip('/')
        self._parents[child] = entry.header.frame_id.lstrip('/')
        move, turn = entry.transform.translation, entry.transform.rotation
        pose = (np.array([turn.x, turn.y, turn.z, turn.w]), np.array([move.x, move.y, move.z]))
        if is_static:
            self._static[child] = pose
        else:
            self._moving.setdefault(child, []).append((stamp_ns(entry.header), pose))

    def check(self, base, frame):
        """Raise RecordingError unless two frames are connected."""
        self._ways(base, frame)

    def pose(self, base, frame, time_ns):
        """
        Return the pose of a frame in another one at a time.

        Returns
        -------
        pose : (numpy.ndarray, numpy.ndarray)
            R (3, 3) and t (3,), m: X_base = R X_frame + t.

        Raises
        ------
        RecordingError
            If a frame is not there, is not connected with the base, or not known at this time.

        """
        up_frame, up_base = self._ways(base, frame)
        R, t = self._climbed(up_frame, time_ns)
        base_R, base_t = self._climbed(up_base, time_ns)
        return base_R.T @ R, base_R.T @ (t - base_t)

    def _ways(self, base, frame):
        """Return the frames from each of two up to the first one above both, without that."""
        up_frame, up_base = self._way(frame), self._way(base)
        common = next((each for each in up_frame if each in up_base), None)
        if common is None:
            raise RecordingError(f'the frames {base!r} and {frame!r} are not connected; there are '
                                 f'{", ".join(sorted({*self._parents, *self._parents.values()}))}')
        return up_frame[:up_frame.index(common)], up_base[:up_base.index(common)]

    def _way(self, frame):
        way = [frame.lstrip('/')]
        while way[-1] in self._parents and self._parents[way[-1]] not in way:
            way.append(self._parents[way[-1]])
        return way

    def _climbed(self, frames, time_ns):
        R, t = np.eye(3), np.zeros(3)
        for frame in frames:
            turn, move = (self._static[frame] if frame in self._static
                          else self._between(frame, time_ns))
            turn = _matrix(turn / np.linalg.norm(turn))
            R, t = turn @ R, turn @ t + move
        return R, t

    def _between(self, frame, time_ns):
        """Return quaternion and position of a moving frame, interpolated between two messages."""
        entries, times = self._moving[frame], self._times[frame]
        at = bisect_left(times, time_ns)
        if at < len(times) and times[at] == time_ns:
            return entries[at][1]
        if not 0 < at < len(times) or times[at] - times[at - 1] > LONGEST_GAP:
            raise RecordingError(f'the transform of {frame!r} is not known at '
                                 f'{time_ns * 1e-9:.3f} s')
        (before, (turn_a, move_a)), (after, (turn_b, move_b)) = entries[at - 1:at + 1]
        share = (time_ns - before) / (after - before)
        turn_b = turn_b if turn_a @ turn_b >= 0 else -turn_b
        # between two messages a robot turns by so little that the chord is as good as the arc
        return (1 - share) * turn_a + share * turn_b, (1 - share) * move_a + share * move_b


def _matrix(quaternion):
    x, y, z, w = quaternion
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])

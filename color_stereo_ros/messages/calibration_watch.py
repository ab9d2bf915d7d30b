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
"""What the CameraInfo of both cameras is worth, now."""

import time

from .synchronizer import SIDES
from ..core.cameras.calibration import StereoCalibration
from ..core.cameras.checks import check_rotation
from ..errors import brief, CalibrationError

_SETTLING = 0.5
"""After a change on one side the other one is waited for this long, s: both may change."""


class CalibrationWatch:
    """
    Keeps the latest CameraInfo of both cameras and judges them when one of them changes.

    Messages are read by their fields only, so that plain objects do as well.

    Parameters
    ----------
    on_change : callable
        Called without arguments when calibration or verdict have changed.
    clock : callable
        Returns s; only its differences matter.
    check : callable
        Called with a StereoCalibration that could be used; refuses it by a CalibrationError.

    """

    def __init__(self, on_change, clock=time.monotonic, check=StereoCalibration.check_raw):
        self._on_change = on_change
        self._check = check
        self._clock = clock
        self._infos = dict.fromkeys(SIDES)
        self._contents = dict.fromkeys(SIDES)
        self._settling = None  # (side that is waited for, until when)
        self.received = dict.fromkeys(SIDES, 0)
        self.calibration = None
        """StereoCalibration, or None while there is none that is usable."""
        self.error = None
        """Why the messages are refused, or None."""
        self.warnings = []
        """What is odd about messages that are used all the same."""
        self.changes = 0
        """How often a calibration was taken."""

    def add(self, side, info):
        """Take a CameraInfo of the left or the right camera."""
        self.received[side] += 1
        content = _content(info)
        if content != self._contents[side]:
            self._infos[side], self._contents[side] = info, content
            self._start_over(side)
        elif self._settling and self._settling[0] == side:
            self._settle()

    def tick(self):
        """Go on without the message that was waited for when its time is over."""
        if self._settling and self._clock() >= self._settling[1]:
            self._settle()

    @property
    def missing(self):
        """Return the sides without any CameraInfo."""
        return [side for side in SIDES if self._infos[side] is None]

    @property
    def frame_id(self):
        """Return the frame of the left CameraInfo, or None."""
        info = self._infos['left']
        return None if info is None else info.header.frame_id

    def _start_over(self, side):
        other = SIDES[side == 'left']
        if self.missing:
            return
        awaited = self._settling[0] if self._settling else None
        first = self.calibration is None and self.error is None and awaited is None
        if first or awaited == side:
            self._settle()
            return
        # recalibration: never mix the new one of this side with the old one of the other
        self.calibration = None
        self.error = None
        self._settling = (other, self._clock() + _SETTLING)
        self._on_change()

    def review(self):
        """Judge messages that were refused once more: what they are used for has changed."""
        if self.error is not None:
            self._settle()

    def _settle(self):
        self._settling = None
        left, right = (self._infos[side] for side in SIDES)
        try:
            calibration = StereoCalibration.from_camera_info(left, right)
            self._check(calibration)
            self.calibration = calibration
            self.error = None
            self.changes += 1
        except CalibrationError as error:
            self.calibration = None
            self.error = str(error)
        self.warnings = _oddities(left)
        self._on_change()


def check_use(calibration, settings):
    """
    Refuse a calibration that lacks what a node needs of it.

    Parameters
    ----------
    calibration : StereoCalibration
        Of the two cameras.
    settings : RangeNodeSettings
        All parameters of range_node.

    Raises
    ------
    CalibrationError
        Raw images need all of it. Rectified ones need P, and R for points in the frame of the
        physical camera.

    """
    if not settings.input.rectified:
        calibration.check_raw()
    elif settings.output.frame == 'camera':
        check_rotation('output.frame = camera needs R of the left camera_info: left R',
                       calibration.left.R)


def _content(info):
    """Return what makes two CameraInfo messages the same calibration."""
    roi = info.roi
    return (info.header.frame_id, info.width, info.height, info.distortion_model,
            *(bytes(memoryview(getattr(info, name))) for name in 'dkrp'),
            info.binning_x, info.binning_y, roi.x_offset, roi.y_offset, roi.width, roi.height)


def _oddities(left):
    """Return sentences about what is legal but probably a mistake."""
    frame = left.header.frame_id
    if not frame:
        return ['left camera_info has an empty frame_id: the points have no frame']
    if 'optical' not in frame:
        return [f'left frame_id {brief(frame)} does not say "optical" (REP 103): if it is a body '
                'frame, the points appear turned by 90 degrees']
    return []

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
"""Why a pixel has no range: the one list of status codes."""

from enum import IntEnum


class Status(IntEnum):
    """Why a pixel has no range; the values of the `status/image` topic."""

    VALID = 0
    OUTSIDE_IMAGE = 1
    DARK = 2
    SATURATED = 3
    NO_MATCH = 4
    AMBIGUOUS = 5
    INCONSISTENT = 6
    OUT_OF_RANGE = 7
    IMPLAUSIBLE = 8
    MOVED = 9

    @property
    def label(self) -> str:
        """Return the name as people write it, for example 'out of range'."""
        return self.name.lower().replace('_', ' ')

    @property
    def meaning(self) -> str:
        """Return one sentence for people."""
        return STATUS_MEANINGS[self]


STATUS_MEANINGS = {
    Status.VALID: 'the pixel has a range',
    Status.OUTSIDE_IMAGE: 'the rectified pixel lies outside the raw left image',
    Status.DARK: 'too little pattern light: shadow, dark surface, or outside the projection',
    Status.SATURATED: 'a color channel is overexposed',
    Status.NO_MATCH: 'no similar color within the disparity limits',
    Status.AMBIGUOUS: 'several places match equally well, or the colors are too uniform',
    Status.INCONSISTENT: 'left and right disagree: seen by the left camera only',
    Status.OUT_OF_RANGE: 'the match lies outside range.min_depth .. range.max_depth, or its point '
                         'outside output.region',
    Status.IMPLAUSIBLE: 'the match does not fit the surface around it',
    Status.MOVED: 'the surface moved between the pairs that were fused (capture.pairs)',
}

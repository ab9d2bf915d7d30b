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
"""The codes of `Status` as compiled loops know them: uint8, the type of the images they fill."""

import numpy as np

from .status import Status

VALID = np.uint8(Status.VALID)
OUTSIDE_IMAGE = np.uint8(Status.OUTSIDE_IMAGE)
DARK = np.uint8(Status.DARK)
SATURATED = np.uint8(Status.SATURATED)
NO_MATCH = np.uint8(Status.NO_MATCH)
AMBIGUOUS = np.uint8(Status.AMBIGUOUS)
INCONSISTENT = np.uint8(Status.INCONSISTENT)
OUT_OF_RANGE = np.uint8(Status.OUT_OF_RANGE)
IMPLAUSIBLE = np.uint8(Status.IMPLAUSIBLE)
MOVED = np.uint8(Status.MOVED)

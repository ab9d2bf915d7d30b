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
"""When the middleware received something, however late it is taken."""

import time

_LONGEST = 10_000_000_000


def received_at(timestamp):
    """
    Return when a message or request was received, s of `time.monotonic`.

    Parameters
    ----------
    timestamp : int
        `received_timestamp` of the middleware, ns since 1970. Where it does not tell, or tells
        more than 10 s, the present counts.

    """
    age = time.time_ns() - timestamp
    return time.monotonic() - (age * 1e-9 if 0 <= age < _LONGEST else 0.0)

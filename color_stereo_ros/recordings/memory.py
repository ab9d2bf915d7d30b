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
"""Memory of images is kept from pair to pair, not returned to the system and fetched again."""

import numpy as np

LARGEST = (1 << 25) - (1 << 16)
"""Bytes, a little below the 32 MB above which glibc always asks the system."""


def keep_memory():
    """
    Let this process keep the memory that it frees.

    glibc takes memory of up to the size of what was freed before from what it keeps, and keeps
    twice as much. Nothing else happens: the block is not written to, so it costs no memory. Where
    MALLOC_TRIM_THRESHOLD_ is set, as for Dask's workers, that holds instead.

    """
    np.empty(LARGEST, np.uint8)

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
"""
numba's cache of machine code, and the way on where nothing can be written to it.

numba looks for a folder that it can write to: NUMBA_CACHE_DIR, `__pycache__` beside the source,
the user's cache. A read-only installation without a home has none. The kernels are then compiled
in every process, and the log says so once. The same happens where the disk is full.

"""

import logging

from numba import njit

NOTICE = ('no folder for compiled kernels can be written (%s): every process compiles them anew, '
          'which takes up to a minute; set NUMBA_CACHE_DIR to a folder that can be written')


class _Cache:
    """Whether compiled code can be kept: yes until it has failed."""

    def __init__(self):
        self.usable = True

    def give_up(self, why):
        """Say once that compiled code is not kept."""
        if self.usable:
            self.usable = False
            reason = ' '.join(str(why).split())
            logging.getLogger('color_stereo_ros').warning(NOTICE, reason[:200])


CACHE = _Cache()


def cached(function, **options):
    """
    Return what numba makes of a function; its machine code is cached where that is possible.

    options are those of `numba.njit`.

    """
    try:
        return njit(cache=True, **options)(function)
    except RuntimeError as error:
        if 'cannot cache function' not in str(error):
            raise
        CACHE.give_up('read-only installation, and no home')
    return njit(**options)(function)


def is_cached():
    """Return whether compiled code is kept for the next process, as far as is known."""
    return CACHE.usable

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
The stamp of compiled code: it changes when anything changes that the code contains.

numba keeps machine code in a cache. It compiles a kernel anew when the file of that kernel has
another time or another size. It does not look at other files, although a kernel contains their
functions and constants. The stamp is a part of the name of each kernel, and so of its files in
the cache.

"""

from functools import cache
import hashlib
import inspect
from pathlib import Path

PACKAGE = Path(__file__).parents[2]

SOURCES = (
    'core/compiled/*.py',
    'core/compiled/internals/*.py',
    'core/constants.py',
    'core/paper/*kernels.py',
    'core/paper/tuning.py',
    'core/projector/*kernels.py',
    'core/projector/tuning.py',
    'core/rows/*kernels.py',
    'core/rows/tuning.py',
    'core/status.py',
    'core/status_codes.py',
    'core/surface/*_kernels.py',
    'core/surface/fitted.py',
    'core/surface/models/*.yaml',
    'core/surface/third/*kernels.py',
    'core/surface/third/tuning.py',
    'core/surface/tuning.py',
)
"""Files whose functions or constants are parts of kernels elsewhere; a test finds omissions."""


def stamp(function):
    """Return 8 hexadecimal digits for a function that becomes a kernel."""
    return _digest(stamped_files(function))


def stamped_files(function):
    """Return the files of which a kernel may contain something: SOURCES, and its own."""
    own = Path(inspect.getfile(function)).resolve()
    shared = _shared()
    return shared if own in shared or not own.is_file() else (*shared, own)


@cache
def _shared():
    """Return the files that SOURCES names, in a fixed order."""
    return tuple(sorted(path.resolve() for pattern in SOURCES for path in PACKAGE.glob(pattern)))


@cache
def _digest(files):
    """Return 8 hexadecimal digits of what some files contain."""
    return hashlib.sha256(b''.join(path.read_bytes() for path in files)).hexdigest()[:8]

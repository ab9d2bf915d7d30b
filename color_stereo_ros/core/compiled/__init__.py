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
The compiled room: the only door to numba, and the memory that kernels work on.

A kernel is a compiled loop that Python calls. Modules of kernels import from here alone:

- `banded` makes a parallel kernel of a function of one band of the data; `band` gives its rows.
- `serial` and `parallel` make a kernel by numba's own means; loops run over `prange`.
- `part` is for a function that only kernels call.
- `stack_array`, `stack_row`, `stack_integers` give a kernel small arrays on its stack.
- `Arena` gives out buffers beside each other.
- `forget_bitcode` frees what only callers would need of kernels that no kernel calls.
- `told_of_compiling` and `is_cached` say whether kernels are compiled, and whether for good.
- `one_thread` leaves the other cores to other processes.
- `refuse_after_fork` keeps a forked process from hanging.

Behind the door:

- `threads` sets how long threads wait awake. It must come before numba.
- `requirement` says which numba fits.
- `caching` keeps compiled code, or goes on without.
- `stamp` names what compiled code contains, so that no stale code is loaded.
- `decorators` chooses between `internals` and `plain`.
- `internals` uses private parts of numba, `plain` does the same without.

Each private part is there for speed. `internals.parts` skips machine code and wrappers that nobody
calls: a third of the time that a cold start takes to compile. `internals.bands` compiles a
parallel kernel once, where numba does it twice, and lets threads take work from each other.
`internals.stack` makes arrays that LLVM vectorizes around. numba changes its private parts
without notice. Therefore setup.py has an upper bound for its version, and `plain` is tested.

"""

from . import threads  # noqa: F401, before numba is imported
from . import requirement  # noqa: F401, I100, tells what to install if numba is missing
from .alone import one_thread
from .arena import Arena
from .caching import is_cached
from .compiling import told_of_compiling
from .decorators import (
    band, banded, BANDS, forget_bitcode, get_num_threads, LENGTH, parallel, part, prange, serial,
    stack_array, stack_integers, stack_row)
from .forks import refuse_after_fork

__all__ = [
    'Arena', 'BANDS', 'LENGTH', 'band', 'banded', 'forget_bitcode', 'get_num_threads', 'parallel',
    'part', 'prange', 'is_cached', 'one_thread', 'refuse_after_fork', 'serial', 'stack_array',
    'stack_integers', 'stack_row', 'told_of_compiling']

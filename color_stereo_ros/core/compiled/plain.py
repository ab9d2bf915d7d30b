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
Kernels by public means of numba only: what remains where its private parts are not as known.

The same three as in `internals`. They compute the same, except for rounding: the compiler may
order the operations of fast math otherwise. They take longer to compile, and a pair takes longer.

"""

import inspect

from numba import njit, prange
import numpy as np

from .caching import cached

BANDS = 8  # per kernel: fixed, so that results do not depend on the number of threads


def part(**options):
    """Return a decorator for a function that only kernels call."""
    return njit(nogil=True, error_model='numpy', **options)


def banded(count, **options):
    """Return a decorator that makes a parallel kernel of a function of one of `count` bands."""
    def decorate(function):
        names = argument_names(function)
        # prange counts without sign, and what mixes both kinds of integers becomes a float
        lines = ('for k in prange(count):', f'    body(number(k), {names})')
        return cached(written(
            function, lines, body=part(**options)(function), count=count, number=np.intp,
            prange=prange), nogil=True, parallel=True)

    return decorate


def interpreted(function, count):
    """Return what does all bands of a function that is not compiled."""
    def kernel(*args):
        for k in range(count):
            function(k, *args)

    return kernel


def stack_array(dtype, *shape):
    """Return a function for kernels that returns an uninitialized array."""
    dtype = np.dtype(dtype).type

    @part()
    def array():
        return np.empty(shape, dtype)

    return array


def argument_names(function):
    """Return the arguments of a function of one band but for the band, as source text."""
    return ', '.join(list(inspect.signature(function).parameters)[1:])


def written(function, lines, **scope):
    """
    Return a function of these lines that has the name and the arguments of another but its first.

    numba unpacks named arguments much faster than *args.

    """
    text = f'def {function.__name__}({argument_names(function)}):\n    ' + '\n    '.join(lines)
    exec(compile(text + '\n', inspect.getfile(function), 'exec'), scope)
    kernel = scope[function.__name__]
    kernel.__module__, kernel.__doc__ = function.__module__, function.__doc__
    kernel.__qualname__ = function.__qualname__
    return kernel

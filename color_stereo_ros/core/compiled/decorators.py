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
The decorators of kernels, and the way out where numba's private parts are not as known.

A *kernel* is a compiled loop that Python calls. A *part* is a function that only kernels call.
Some kernels are called by other kernels, too.
There are two ways to compile them: `internals`, with private parts of numba, and `plain`, without.
`internals` is the first choice. It is given up when it cannot be imported or when a kernel does
not compile. Then all kernels are compiled the plain way, and the log says so once.

"""

from functools import cache, cached_property, update_wrapper
import logging
from types import FunctionType

import numba
from numba import config, get_num_threads, prange, typeof  # noqa: F401, for the door
import numpy as np

from . import plain
from .caching import CACHE, cached
from .forks import refuse_after_fork
from .plain import BANDS
from .requirement import InstallationError, is_tested, REQUIREMENT
from .stamp import stamp

MOST_PARTS = 32  # more functions than any kernel calls: each may fail to be kept
LENGTH = 64
"""Entries of a stack row: a tile or a patch row fits."""


class _Way:
    """How kernels are compiled: `internals` until it has failed, then `plain`."""

    def __init__(self):
        """Choose the first way."""
        self.chosen = plain
        self.kernels = []
        if not is_tested():
            self._tell('it is newer than what was tested')
            return
        try:
            from . import internals
            self.chosen = internals
        except Exception as error:  # whatever a changed module raises
            self._tell(error)

    def give_up(self, error):
        """Compile the plain way from now on."""
        if self.chosen is not plain:
            self.chosen = plain
            self._tell(error)
        for kernel in self.kernels:
            vars(kernel).pop('dispatcher', None)

    @staticmethod
    def _tell(why):
        reason = ' '.join(f'{type(why).__name__}: {why}'.split()) if isinstance(
            why, Exception) else why
        logging.getLogger('color_stereo_ros').warning(
            'numba %s is not as color_stereo_ros knows it (%.200s): measuring goes on, but starts '
            "and runs more slowly; pip install '%s' makes it fast again", numba.__version__,
            reason, REQUIREMENT)


_WAY = _Way()
_PARTS = {}  # by id: what `internals` has made, and a function that makes the same the plain way


class Kernel:
    """
    A compiled loop that Python calls: a function that compiles itself at the first call.

    It has the attributes of numba's dispatcher, for example `stats` and `signatures`.

    """

    def __init__(self, function, make):
        """Take a function, and what makes a dispatcher of it: `make(way, function)`."""
        update_wrapper(self, function)
        self._function, self._make, self._made = function, make, {}
        self._linked = self._forgotten = False
        _WAY.kernels.append(self)

    def __call__(self, *args):
        """Run; where the first way fails to compile, compile the plain way and run."""
        try:
            return self.dispatcher(*args)
        except Exception as error:
            instead = self._compiled_instead(error, args)
        return instead(*args)

    def __getattr__(self, name):
        """Return what numba's dispatcher has under this name."""
        if name.startswith('_'):
            raise AttributeError(f'{type(self).__name__!r} has no attribute {name!r}')
        return getattr(self.dispatcher, name)

    @cached_property
    def dispatcher(self):
        """Return what numba has made of the function, the way that is chosen now."""
        refuse_after_fork()
        # A kernel from the cache does not know that there must be threads. This decides on
        # numba's threading layer and tells the compiler where to find it. Not earlier: a process
        # that was forked after this cannot run kernels.
        get_num_threads()
        return self.made(_WAY.chosen)

    def made(self, way):
        """Return what numba has made of the function in one of the two ways."""
        if way not in self._made:
            self._made[way] = self._make(way, self._stamped(way))
        return self._made[way]

    def linkable(self, way):
        """Return what numba has made of the function, with what a kernel that calls it needs."""
        self._linked = True
        if self._forgotten:  # by a caller that was defined too late: from the cache once more
            self._forgotten = False
            self._made.clear()
            vars(self).pop('dispatcher', None)
        return self.made(way)

    def called(self):
        """Return the kernels that the function calls."""
        scope = self._function.__globals__
        found = (scope.get(name) for name in _names(self._function.__code__))
        return [each for each in found if isinstance(each, Kernel)]

    def forget(self):
        """Return what numba has made, to be forgotten; nothing where a kernel calls this one."""
        made = [] if self._linked else list(self._made.values())
        self._forgotten |= bool(made)
        return made

    def _stamped(self, way):
        """Return the function under the name of its machine code in the cache."""
        function = _bound(self._function, way)
        if function is self._function:
            function = _copied(function, function.__globals__)
        function.__qualname__ += f'_{stamp(self._function)}' + '_plain' * (way is plain)
        return function

    def _kept_in_memory(self, error, signature):
        """Return None where all that failed was to keep what is compiled; else the error."""
        for _ in range(MOST_PARTS):
            if not isinstance(error, OSError):
                break
            CACHE.give_up(error)
            try:
                self.dispatcher.compile(signature)  # goes on behind what is compiled already
                return None
            except Exception as next_one:
                error = next_one
        return error

    def _compiled_instead(self, error, args):
        """Return the kernel as compiled the plain way; raise the error if that is no way out."""
        signature = tuple(map(typeof, args))
        error = self._kept_in_memory(error, signature)
        if error is None:
            return self.dispatcher
        if any(signature in made.signatures for made in self._made.values()):
            raise error  # it was compiled, and raised the error itself
        instead = self.made(plain)
        try:
            instead.compile(signature)
        except Exception as again:
            if is_tested():
                raise error from again  # it does not depend on the way: the arguments are wrong
            raise InstallationError(
                f'numba {numba.__version__} does not compile the kernels: '
                f"pip install '{REQUIREMENT}' installs one that does") from error
        _WAY.give_up(error)
        return instead


def forget_bitcode():
    """
    Free what numba keeps of kernels for functions that would call them.

    Kernels that other kernels call keep it. The others stay compiled, and can be compiled for
    other arguments.

    """
    if _WAY.chosen is plain:
        return  # nothing private of numba
    from .internals.linking import unlinked
    for kernel in _WAY.kernels:
        for each in kernel.called():  # also by kernels that have not run yet
            each._linked = True
    unlinked([made for kernel in _WAY.kernels for made in kernel.forget()])


def banded(count=BANDS, **options):
    """
    Return a decorator that makes a parallel kernel of a function of one band.

    The first argument of the function is the band, 0 .. count - 1 (count at most 63, a bit each).
    The kernel does not have this argument. The function must not raise: nobody would hear of it.
    Bands must not write to the same places, and arrays must not overlap. options are those of
    `numba.njit`.

    """
    if not 1 <= count <= 63:
        raise ValueError(f'count = {count} is no number of bands, 1 .. 63')

    def decorate(function):
        if config.DISABLE_JIT:
            return plain.interpreted(function, count)
        return Kernel(function, lambda way, bound: way.banded(count, **options)(bound))

    return decorate


def serial(error_model='numpy', **options):
    """Return a decorator that makes a kernel of a function; options are those of `numba.njit`."""
    options = {'nogil': True, 'error_model': error_model, **options}

    def decorate(function):
        if config.DISABLE_JIT:
            return function
        return Kernel(function, lambda way, bound: cached(bound, **options))

    return decorate


def parallel(**options):
    """Return a decorator like `serial` for a function that has loops over `prange`."""
    return serial(parallel=True, **options)


def part(**options):
    """
    Return a decorator for a function that only kernels call; options are those of `numba.njit`.

    Python can call its `py_func`.

    """
    def decorate(function):
        if config.DISABLE_JIT:
            return function
        return _made_both_ways(lambda way: way.part(**options)(_bound(function, way)))

    return decorate


def stack_array(dtype, *shape):
    """Return a function for kernels that returns an uninitialized array in its caller's frame."""
    if config.DISABLE_JIT:
        return lambda: np.empty(shape, dtype)
    return _made_both_ways(lambda way: way.stack_array(dtype, *shape))


def _made_both_ways(make):
    """Return what `make(way)` returns for the chosen way; remember how to make the plain one."""
    try:
        made = make(_WAY.chosen)
    except Exception as error:
        if _WAY.chosen is plain:
            raise
        _WAY.give_up(error)
        made = make(plain)
    _PARTS[id(made)] = made, cache(lambda: make(plain))
    return made


def _bound(function, way):
    """Return the function; if need be a copy that calls the parts and kernels made this way."""
    scope = function.__globals__
    changed = {name: _counterpart(scope[name], way) for name in _names(function.__code__)
               if name in scope}
    changed = {name: value for name, value in changed.items() if value is not scope[name]}
    return _copied(function, {**scope, **changed}) if changed else function


def _counterpart(value, way):
    """Return a part or kernel as made this way; any other value as it is."""
    if isinstance(value, Kernel):
        return value.linkable(way)
    if way is plain and id(value) in _PARTS:
        return _PARTS[id(value)][1]()
    return value


def _names(code):
    """Return the names in some code and in the functions that it defines."""
    inner = (each for each in code.co_consts if hasattr(each, 'co_names'))
    return {*code.co_names, *(name for each in inner for name in _names(each))}


def _copied(function, scope):
    """Return a copy of a function with other global names."""
    copy = FunctionType(function.__code__, scope, function.__name__, function.__defaults__,
                        function.__closure__)
    copy.__qualname__, copy.__doc__ = function.__qualname__, function.__doc__
    return copy


@part()
def band(k, size):
    """Return first and last row + 1 of band k of BANDS."""
    return size * k // BANDS, size * (k + 1) // BANDS


stack_row = stack_array(np.float32, LENGTH)
stack_integers = stack_array(np.int16, LENGTH)

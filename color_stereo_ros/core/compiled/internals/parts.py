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
Parts of kernels: functions that only kernels call, never Python.

numba makes every function able to run by itself: it optimizes the function, makes machine code of
it and adds two wrappers for callers. A kernel then takes in the code of all its functions,
optimizes it once more and makes machine code of it again. Parts stay as numba writes them until a
kernel takes them in. The kernels of the surface method then compile in two thirds of the time.
Parts are not cached: the machine code of the kernel contains them. They do not count references:
they make no arrays except on the stack (see `stack`).

"""

from numba import njit
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, Flags
from numba.core.compiler_machinery import LoweringPass, register_pass
from numba.core.typed_passes import NativeLowering


def part(compiler=None, **options):
    """
    Return a decorator for a function that only kernels call; options are those of `numba.njit`.

    Python can call its `py_func`. compiler: a subclass of PartCompiler.

    """
    def decorate(function):
        return njit(nogil=True, error_model='numpy', _nrt=False, no_cpython_wrapper=True,
                    no_cfunc_wrapper=True, pipeline_class=compiler or PartCompiler,
                    **options)(function)

    return decorate


class PartCompiler(Compiler):
    """Compiles as far as other code needs it to take a function in."""

    def __init__(self, typing_context, target_context, library, args, return_type, flags,
                 locals):  # noqa: A002, numba's name
        """Take the flags over."""
        super().__init__(typing_context, target_context, library, args, return_type,
                         _Flags(flags), locals)

    def define_pipelines(self):
        """Return the usual steps and one more."""
        state = self.state
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        pipelines = super().define_pipelines()
        for pipeline in pipelines:
            pipeline.add_pass_after(_Offer, NativeLowering)
            pipeline.finalize()
        return pipelines


class _Flags(Flags):
    """
    Flags that compare faster.

    At every indexing of an array numba looks up half a dozen functions by arguments and flags;
    to hash and compare all flags takes a tenth of the time that a kernel takes to compile.

    """

    __slots__ = ()

    def __eq__(self, other):
        return self is other or self._values == other._values or super().__eq__(other)

    def __hash__(self):
        return 0  # the arguments tell enough


class _PartLibrary(JITCodeLibrary):
    """Code that is neither optimized nor made machine code by itself."""

    def finalize(self):
        """Take in what other parts contribute."""
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalized = True


@register_pass(mutates_CFG=False, analysis_only=True)
class _Offer(LoweringPass):
    """Tells numba how to call a function that has no machine code."""

    _name = 'offer_part'

    def __init__(self):
        LoweringPass.__init__(self)

    def run_pass(self, state):
        """Register the code under a built-in function, which the dispatcher insists on."""
        nothing = state.cr.fndesc.mangled_name.index  # who calls it gets a TypeError
        state.targetctx.insert_user_function(nothing, state.cr.fndesc, [state.library])
        state.cr = state.cr._replace(cfunc=nothing)
        return False

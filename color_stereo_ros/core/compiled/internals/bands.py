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
Parallel kernels: a function that works on one band of the data becomes one that does all bands.

numba's `parallel=True` has two drawbacks. It compiles every kernel twice, with all that the kernel
contains. And it gives its threads equal shares beforehand: a thread that has no core for a while
holds up all others. Here each thread begins with its own share, which lies in its cache from the
last kernel, and then takes bands of others. There is one loop that is parallel to numba, `_run`.
It calls a compiled function by its address.

"""

from llvmlite import ir
from numba import prange, types
from numba.core import cgutils
from numba.extending import intrinsic

from .parts import part, PartCompiler
from ..caching import cached
from ..plain import argument_names, BANDS, written
from ..stamp import stamp


def banded(count, **options):
    """Return a decorator that makes a parallel kernel of a function of one of `count` bands."""
    def decorate(function):
        lines = (f'address, data = prepare(body, count, ({argument_names(function)},))',
                 'run(address, data)')
        return cached(written(
            function, lines, body=part(_DisjointArrays, **options)(function), count=count,
            prepare=_prepare, run=_run), nogil=True, no_cfunc_wrapper=True, _nrt=False)

    return decorate


class _DisjointArrays(PartCompiler):
    """Assumes that no two arrays overlap: more loops become SIMD, as with `parallel=True`."""

    def define_pipelines(self):
        """Return the usual steps."""
        self.state.flags.noalias = True
        return super().define_pipelines()


@intrinsic
def _call(typing_context, address, data, first):
    """Call the function at an address with the address of its data and a number."""
    def generate(context, builder, signature, args):
        kind = ir.FunctionType(ir.VoidType(), [cgutils.voidptr_t, args[2].type])
        builder.call(builder.inttoptr(args[0], kind.as_pointer()),
                     [builder.inttoptr(args[1], cgutils.voidptr_t), args[2]])
        return context.get_dummy_value()

    return types.none(types.uintp, types.uintp, types.intp), generate


def _run(address, data):
    """Let every thread do what is left of the bands, from the first of its own on."""
    for first in prange(BANDS):
        _call(address, data, first)


_run.__qualname__ += f'_{stamp(_run)}'
_run = cached(_run, nogil=True, parallel=True)


@intrinsic
def _prepare(typing_context, body, count, args):
    """
    Return the addresses of a function that does the bands that are left, and of its data.

    The data live in the frame of the caller: a bit for every band that is taken, the number of
    bands, and the arguments.

    """
    resolved = body.get_call_type(typing_context, (types.intp, *args), {})

    def generate(context, builder, signature, values):
        compiled = body.dispatcher.get_compile_result(resolved)
        context.active_code_library.add_linking_library(compiled.library)
        borrowed = (_borrowed(context, builder, *each) for each in zip(
            args, cgutils.unpack_tuple(builder, values[2], len(args))))
        parts = [context.get_constant(types.intp, 0), values[1], *borrowed]
        data = cgutils.alloca_once_value(builder, cgutils.pack_struct(builder, parts))
        function = _band_loop(context, builder.module, compiled.fndesc, data.type)
        number = context.get_value_type(types.uintp)
        return context.make_tuple(builder, signature.return_type, [
            builder.ptrtoint(function, number), builder.ptrtoint(data, number)])

    return types.UniTuple(types.uintp, 2)(body, types.intp, args), generate


def _borrowed(context, builder, kind, value):
    """Return an array without its owner, so that no thread counts references; else the value."""
    if not isinstance(kind, types.Array):
        return value
    array = context.make_array(kind)(context, builder, value)
    array.meminfo, array.parent = (
        cgutils.get_null_value(owner.type) for owner in (array.meminfo, array.parent))
    return array._getvalue()


def _band_loop(context, module, description, data_type):
    """Write the function that `_call` calls: from band `first` on, around to the one before it."""
    number = context.get_value_type(types.intp)
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [cgutils.voidptr_t, number]),
                           module.get_unique_name('bands'))
    function.linkage = 'internal'
    builder = ir.IRBuilder(function.append_basic_block())
    data, first = builder.bitcast(function.args[0], data_type), function.args[1]
    taken = cgutils.gep_inbounds(builder, data, 0, 0)
    count, *args = (builder.load(cgutils.gep_inbounds(builder, data, 0, 1 + i))
                    for i in range(len(description.argtypes)))
    body = context.declare_function(module, description)
    with cgutils.for_range(builder, count) as loop:
        band = builder.srem(builder.add(first, loop.index), count)
        bit = builder.shl(number(1), band)
        before = builder.atomic_rmw('or', taken, bit, 'seq_cst')
        with builder.if_then(builder.icmp_unsigned('==', builder.and_(before, bit), number(0))):
            # what it returns says whether it raised, which it must not
            context.call_conv.call_function(builder, body, description.restype,
                                            description.argtypes, [band, *args])
    builder.ret_void()
    return function

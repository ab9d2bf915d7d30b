# SPDX-License-Identifier: Apache-2.0
"""
Parallel kernels: a function that works on one band of the data becomes one that does all bands.

Instead of `parallel=True`, for two reasons. Numba then compiles every kernel twice over, with all
that it contains. And its threads get equal shares beforehand: one that has no core for a while
holds up all the others. Here a thread that is done with its share, which lies in its cache from
the last kernel, takes bands of others.
There is one loop that is parallel to numba, `_run`; it calls a compiled function by its address.

"""

import hashlib
import inspect
from pathlib import Path

from llvmlite import ir
from numba import config, get_num_threads, njit, prange, types
from numba.core import cgutils
from numba.extending import intrinsic

from .parts import part, PartCompiler

# A kernel from the cache does not know that there must be threads. This decides on numba's
# threading layer, which starts none with OpenMP, and tells the compiler where to find it.
get_num_threads()

# numba's cache asks whether the file of a kernel has changed, but not those of what it contains.
_STAMP = hashlib.sha256(b''.join(
    path.read_bytes() for path in sorted(Path(__file__).parent.glob('*_kernels.py')))
).hexdigest()[:8]

BANDS = 8  # per kernel: fixed, so that results do not depend on the number of threads


@part()
def band(k, size):
    """Return first and last row + 1 of band k of BANDS."""
    return size * k // BANDS, size * (k + 1) // BANDS


def banded(count=BANDS, **options):
    """
    Return a decorator that makes a parallel kernel of a function of one band.

    The first argument of the function is the band, 0 .. count - 1 (count at most 63, a bit each),
    the kernel does not have it. The function must not raise: nobody would hear of it.
    Bands must not write to the same places, nor may arrays overlap. options are those of
    `numba.njit`.

    """
    if not 1 <= count <= 63:
        raise ValueError(f'count = {count} is no number of bands, 1 .. 63')

    def decorate(function):
        names = ', '.join(list(inspect.signature(function).parameters)[1:])
        if config.DISABLE_JIT:
            return _interpreted(function, count)
        function.__qualname__ += f'_{_STAMP}'  # part of the names of the files in the cache
        body = part(_DisjointArrays, **options)(function)
        scope = {'body': body, 'count': count, 'prepare': _prepare, 'run': _run}
        # numba unpacks named arguments much faster than *args
        exec(compile(f'def {function.__name__}({names}):\n'
                     f'    address, data = prepare(body, count, ({names},))\n'
                     f'    run(address, data)\n', inspect.getfile(function), 'exec'), scope)
        kernel = scope[function.__name__]
        kernel.__module__, kernel.__doc__ = function.__module__, function.__doc__
        kernel.__qualname__ = function.__qualname__
        return njit(cache=True, nogil=True, no_cfunc_wrapper=True, _nrt=False)(kernel)

    return decorate


def serial(**options):
    """Return a decorator that makes a kernel of a function; options are those of `numba.njit`."""
    def decorate(function):
        function.__qualname__ += f'_{_STAMP}'
        return njit(cache=True, nogil=True, error_model='numpy', **options)(function)

    return decorate


class _DisjointArrays(PartCompiler):
    """Assumes that no two arrays overlap: more loops become SIMD, as with `parallel=True`."""

    def define_pipelines(self):
        """Return the usual steps."""
        self.state.flags.noalias = True
        return super().define_pipelines()


def _interpreted(function, count):
    """Return what does all bands of a function that is not compiled."""
    def kernel(*args):
        for k in range(count):
            function(k, *args)

    return kernel


@intrinsic
def _call(typing_context, address, data, first):
    """Call the function at an address with the address of its data and a number."""
    def generate(context, builder, signature, args):
        kind = ir.FunctionType(ir.VoidType(), [cgutils.voidptr_t, args[2].type])
        builder.call(builder.inttoptr(args[0], kind.as_pointer()),
                     [builder.inttoptr(args[1], cgutils.voidptr_t), args[2]])
        return context.get_dummy_value()

    return types.none(types.uintp, types.uintp, types.intp), generate


@njit(cache=True, nogil=True, parallel=True)
def _run(address, data):
    """Let every thread do what is left of the bands, from the first of its own on."""
    for first in prange(BANDS):
        _call(address, data, first)


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

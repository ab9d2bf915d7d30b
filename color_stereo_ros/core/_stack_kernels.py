# SPDX-License-Identifier: Apache-2.0
"""
Small arrays on the stack, for kernels that gather.

LLVM vectorizes a loop only if it can tell that no store changes what a later iteration loads. It
compares the bounds of affine accesses at run time, but a gather has none; and beyond a few arrays
it gives up comparing. Nothing else can point at the stack: a loop that writes into such an array
is vectorized whatever it reads (seen in the assembly: vgatherdps and vfmadd...ps instead of
vmovss and vfmadd...ss, three times as fast), and a second loop copies the result out.

"""

from numba import carray, types
from numba.core import cgutils
from numba.extending import intrinsic, overload
import numpy as np

LENGTH = 64
"""Entries of a stack row: a tile or a patch row fits."""


def stack_row():
    """Return an uninitialized float32 (LENGTH,) that lives as long as the calling kernel."""
    return np.empty(LENGTH, np.float32)


def stack_integers():
    """Return the like of int16."""
    return np.empty(LENGTH, np.int16)


def _pointer_to(number):
    """Return an intrinsic: a pointer to LENGTH numbers in the frame of the caller."""
    @intrinsic
    def pointer(typing_context):
        def generate(context, builder, signature, args):
            kind = context.get_value_type(number)
            place = cgutils.alloca_once(builder, kind, size=LENGTH)
            place.align = 64
            return place

        return types.CPointer(number)(), generate

    return pointer


_floats, _integers = _pointer_to(types.float32), _pointer_to(types.int16)


@overload(stack_row, inline='always')  # else the frame would be gone when the array is used
def _compiled_stack_row():
    def row():
        return carray(_floats(), LENGTH)
    return row


@overload(stack_integers, inline='always')
def _compiled_stack_integers():
    def row():
        return carray(_integers(), LENGTH)
    return row

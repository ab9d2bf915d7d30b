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


@intrinsic
def _stack_pointer(typing_context):
    """Return a pointer to LENGTH floats in the frame of the caller."""
    def generate(context, builder, signature, args):
        kind = context.get_value_type(types.float32)
        place = cgutils.alloca_once(builder, kind, size=LENGTH)
        place.align = 64
        return place

    return types.CPointer(types.float32)(), generate


@overload(stack_row, inline='always')  # else the frame would be gone when the array is used
def _compiled_stack_row():
    def row():
        return carray(_stack_pointer(), LENGTH)
    return row

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
Small arrays on the stack, for kernels that gather.

LLVM vectorizes a loop only if no store can change what a later iteration loads. For affine
accesses it compares the bounds at run time. A gather has no bounds, and with more than a few
arrays LLVM does not compare. Nothing else can point at the stack, so a loop that writes into such
an array is vectorized whatever it reads; a second loop copies the result out. The assembly shows
vgatherdps and vfmadd...ps instead of vmovss and vfmadd...ss: three times as fast.

"""

import math

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array
from numba.np.numpy_support import from_dtype
import numpy as np


def stack_array(dtype, *shape):
    """Return a function for kernels that returns an uninitialized array in its caller's frame."""
    dtype = np.dtype(dtype)
    number = from_dtype(dtype)
    kind = types.Array(number, len(shape), 'C')
    strides = [dtype.itemsize * math.prod(shape[axis + 1:]) for axis in range(len(shape))]

    @intrinsic
    def array(typing_context):
        def generate(context, builder, signature, args):
            place = cgutils.alloca_once(builder, context.get_value_type(number),
                                        size=math.prod(shape))
            place.align = 64
            made = context.make_array(kind)(context, builder)
            numbers = [[context.get_constant(types.intp, each) for each in group]
                       for group in (shape, strides, (dtype.itemsize,))]
            populate_array(made, place, numbers[0], numbers[1], numbers[2][0], None)
            return made._getvalue()

        return kind(), generate

    return array

# SPDX-License-Identifier: Apache-2.0
"""
Private parts of numba and llvmlite: nothing outside this folder may import them.

`plain` has the same three functions without them.

"""

from .bands import banded
from .parts import part
from .stack import stack_array

__all__ = ['banded', 'part', 'stack_array']

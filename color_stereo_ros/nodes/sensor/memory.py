# SPDX-License-Identifier: Apache-2.0
"""Memory that is free, but not given back to the system."""

import ctypes


def give_back():
    """
    Give free memory back to the system, where the C library can.

    The allocator of glibc keeps what is freed, for each thread apart. What a search has needed
    once would count as memory of the node forever. Takes some milliseconds.

    """
    try:
        trim = ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):  # another C library than glibc
        return
    trim(0)

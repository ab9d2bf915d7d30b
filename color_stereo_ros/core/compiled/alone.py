# SPDX-License-Identifier: Apache-2.0
"""One thread for all kernels, where other processes have the other cores."""

from numba import set_num_threads


def one_thread():
    """Let the kernels that the calling thread starts use one thread."""
    set_num_threads(1)

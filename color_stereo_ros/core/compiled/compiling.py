# SPDX-License-Identifier: Apache-2.0
"""Notice that kernels are compiled, which takes long, instead of loaded, which does not."""

from contextlib import contextmanager, nullcontext


@contextmanager
def told_of_compiling(tell):
    """Call `tell` once if something is compiled during the block, when that begins."""
    try:
        from .internals.compiling import listening
    except Exception:  # numba is not as known: kernels are compiled, and nobody is told
        listening = nullcontext
    with listening(tell):
        yield

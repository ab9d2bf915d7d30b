# SPDX-License-Identifier: Apache-2.0
"""Say why nothing seems to happen."""

from contextlib import contextmanager
import sys
import threading

AFTER = 2.0  # s: who waits longer wants to know why
COMPILING = 'the kernels are being compiled; this takes up to a minute'


@contextmanager
def patience(reason=COMPILING, after=AFTER):
    """
    Print a reason on standard error if the block takes long, and how long it has taken.

    Parameters
    ----------
    reason : str
        What is waited for.
    after : float
        s until the reason is printed; afterwards a dot shows every so many seconds that
        something goes on.

    """
    done = threading.Event()

    def tell():
        if done.wait(after):
            return
        print(f'color_stereo: {reason} ', end='', file=sys.stderr, flush=True)
        while not done.wait(after):
            print('.', end='', file=sys.stderr, flush=True)
        print(' done', file=sys.stderr, flush=True)

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield
    finally:
        done.set()
        teller.join()

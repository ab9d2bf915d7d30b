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

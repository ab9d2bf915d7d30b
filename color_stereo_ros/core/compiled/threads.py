# SPDX-License-Identifier: Apache-2.0
"""
How long numba's threads wait awake for the next parallel loop; imported before they start.

GNU OpenMP lets them spin for many milliseconds. On a machine that has other work, too, the one
thread that everybody waits for then finds no core: a pair takes four times as long, and four
times the processor time. 2000 turns, some 30 us, bridge most gaps between kernels (docs/speed.md).

"""

import os

if not {'OMP_WAIT_POLICY', 'GOMP_SPINCOUNT'} & os.environ.keys():
    os.environ['GOMP_SPINCOUNT'] = '2000'

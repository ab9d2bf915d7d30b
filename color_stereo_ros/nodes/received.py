# SPDX-License-Identifier: Apache-2.0
"""When the middleware received something, however late it is taken."""

import time

_LONGEST = 10_000_000_000


def received_at(timestamp):
    """
    Return when a message or request was received, s of `time.monotonic`.

    Parameters
    ----------
    timestamp : int
        `received_timestamp` of the middleware, ns since 1970. Where it does not tell, or tells
        more than 10 s, the present counts.

    """
    age = time.time_ns() - timestamp
    return time.monotonic() - (age * 1e-9 if 0 <= age < _LONGEST else 0.0)

# SPDX-License-Identifier: Apache-2.0
"""Arrays of immutable values."""

import numpy as np


def constant_array(values):
    """Return a float64 array of its own that cannot be written."""
    values = np.array(values, np.float64)
    values.flags.writeable = False
    return values

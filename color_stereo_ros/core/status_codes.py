# SPDX-License-Identifier: Apache-2.0
"""The codes of `Status` as compiled loops know them: uint8, the type of the images they fill."""

import numpy as np

from .status import Status

VALID = np.uint8(Status.VALID)
OUTSIDE_IMAGE = np.uint8(Status.OUTSIDE_IMAGE)
DARK = np.uint8(Status.DARK)
SATURATED = np.uint8(Status.SATURATED)
NO_MATCH = np.uint8(Status.NO_MATCH)
AMBIGUOUS = np.uint8(Status.AMBIGUOUS)
INCONSISTENT = np.uint8(Status.INCONSISTENT)
OUT_OF_RANGE = np.uint8(Status.OUT_OF_RANGE)
IMPLAUSIBLE = np.uint8(Status.IMPLAUSIBLE)
MOVED = np.uint8(Status.MOVED)

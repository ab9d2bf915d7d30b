# SPDX-License-Identifier: Apache-2.0
"""Types of arrays in the hints of the public classes; docstrings give their shapes and units."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Image: TypeAlias = NDArray[np.uint8] | NDArray[np.uint16]
"""What a camera sends: color uint8 (H, W, 3), RGB, or gray uint8 or uint16 (H, W)."""
Bytes: TypeAlias = NDArray[np.uint8]
Floats: TypeAlias = NDArray[np.float32]
Doubles: TypeAlias = NDArray[np.float64]
Mask: TypeAlias = NDArray[np.bool_]
Size: TypeAlias = tuple[int, int]
"""Width and height, px."""

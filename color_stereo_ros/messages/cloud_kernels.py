# SPDX-License-Identifier: Apache-2.0
"""The kernel that writes a point cloud: one pass, without the interpreter's lock."""

import numpy as np

from ..core.compiled import serial

F4 = np.float32
U4 = np.uint32


@serial()
def fill_points(depth, image, rays_x, rays_y, records):
    """
    Write x, y, z (float32, m) and the bits of 0x00RRGGBB of every pixel into records (H, W, 4).

    depth float32 (H, W), m, NaN = unknown; image uint8 (H, W, 3), RGB; rays_x (W,) and rays_y
    (H,): X/Z of the columns and Y/Z of the rows, float32.

    """
    rows, columns = depth.shape
    for v in range(rows):
        line, pixels, out, ray_y = depth[v], image[v], records[v], rays_y[v]
        for u in range(columns):
            z = line[u]
            red, green, blue = U4(pixels[u, 0]), U4(pixels[u, 1]), U4(pixels[u, 2])
            out[u, 0] = rays_x[u] * z
            out[u, 1] = ray_y * z
            out[u, 2] = z
            out[u, 3] = U4((red << U4(16)) | (green << U4(8)) | blue).view(F4)

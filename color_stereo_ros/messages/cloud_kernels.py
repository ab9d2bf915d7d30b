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
"""The kernels that write and cut a point cloud: one pass, without the interpreter's lock."""

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


@serial()
def turn_vectors(vectors, rotation):
    """Turn the first three of the last axis of float32 (H, W, n) by float32 (3, 3), in place."""
    rows, columns = vectors.shape[:2]
    for v in range(rows):
        for u in range(columns):
            x, y, z = vectors[v, u, 0], vectors[v, u, 1], vectors[v, u, 2]
            for axis in range(3):
                vectors[v, u, axis] = (rotation[axis, 0] * x + rotation[axis, 1] * y
                                       + rotation[axis, 2] * z)


@serial()
def join_fields(records, values, out):
    """
    Write the four fields and the optional ones of every pixel beside each other.

    records float32 (H, W, 4), values float32 (N, H, W), out float32 (H, W, 4 + N).

    """
    rows, columns = records.shape[:2]
    for v in range(rows):
        for u in range(columns):
            for each in range(4):
                out[v, u, each] = records[v, u, each]
            for each in range(values.shape[0]):
                out[v, u, 4 + each] = values[each, v, u]


@serial()
def find_outside(depth, rays_x, rays_y, rotation, box, outside):
    """
    Write into outside, bool (H, W), which pixels have a point outside of a box.

    depth, rays_x, rays_y as for `fill_points`; rotation float32 (3, 3), from the rectified left
    camera to the frame of the box; box float32 (3, 2), smallest and largest x, y, z, m.

    """
    rows, columns = depth.shape
    for v in range(rows):
        line, out, ray_y = depth[v], outside[v], rays_y[v]
        for u in range(columns):
            z = line[u]
            x, y = rays_x[u] * z, ray_y * z
            beyond = False
            for axis in range(3):
                place = rotation[axis, 0] * x + rotation[axis, 1] * y + rotation[axis, 2] * z
                beyond |= (place < box[axis, 0]) | (place > box[axis, 1])  # False for NaN
            out[u] = beyond

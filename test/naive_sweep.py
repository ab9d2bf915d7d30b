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
"""Loop-only twins of the kernels of the third view, from their formulas, in double precision."""

import numpy as np


def place(sweep, x, y, d):
    """Return column and row of the pattern, and their slopes against d."""
    u, v, w = (float(row @ [x, y, 1.0, d]) for row in np.asarray(sweep, float))
    place = np.array([u, v]) / w
    slope = (np.asarray(sweep, float)[:2, 3] - place * float(sweep[2][3])) / w
    return place, slope, w


def light_at(image, u, v):
    """Return the light of a pattern, (H, W, 3), 0..1, interpolated linearly, and its slopes."""
    i, j = int(u), int(v)
    s, t = u - i, v - j
    a, b, c, d = (image[j, i], image[j, i + 1], image[j + 1, i], image[j + 1, i + 1])
    value = (1 - t) * ((1 - s) * a + s * b) + t * ((1 - s) * c + s * d)
    return value, (1 - t) * (b - a) + t * (d - c), (1 - s) * (c - a) + s * (d - b)


def thin_light(image, u, v):
    """Return the light of the top left of 2 x 2 pixels, and slopes that nobody reads."""
    nothing = np.zeros(3)
    return image[int((v + 0.5) / 2) * 2, int((u + 0.5) / 2) * 2], nothing, nothing


def color(image, colors, light, sweep, x, y, d, margin, light_at=light_at):
    """Return chromaticity (2,) and its slope against d; None outside the pattern."""
    (u, v), (du, dv), depth = place(sweep, x, y, d)
    height, width = image.shape[:2]
    inside = margin <= u < width - 1 - margin and margin <= v < height - 1 - margin
    if not (depth > 0 and inside):
        return None

    def chroma(u, v):
        rgb = colors[:, :3] @ light_at(image, u, v)[0] + colors[:, 3]
        r, g, b = rgb * [light[0], 1.0, light[1]]
        return light[2] * np.array([2 * r - g - b, 3 ** 0.5 * (g - b)]) / (r + g + b)

    value, by_u, by_v = light_at(image, u, v)
    gains = np.array([light[0], 1.0, light[1]])
    rgb = gains * (colors[:, :3] @ value + colors[:, 3])
    change = gains * (colors[:, :3] @ (by_u * du + by_v * dv))
    total = rgb.sum()
    seen = chroma(u, v)
    raw = np.array([2 * change[0] - change[1] - change[2], 3 ** 0.5 * (change[1] - change[2])])
    return seen, light[2] * raw / total - seen * change.sum() / total


def windows(cost):
    """Return the sums of a volume (h, w, D) over 3 x 3 nodes, weights 1 2 1, halved."""
    rows, columns, _ = cost.shape
    out = np.zeros_like(cost)
    for y in range(rows):
        for x in range(columns):
            total = 0
            for j, down in ((-1, 1), (0, 2), (1, 1)):
                for i, along in ((-1, 1), (0, 2), (1, 1)):
                    near = cost[min(max(y + j, 0), rows - 1), min(max(x + i, 0), columns - 1)]
                    total = total + down * along * near.astype(int)
            out[y, x] = total >> 1
    return out


def path(costs, small, large):
    """Return the path costs of a line of nodes (N, D), less the lowest of the node before."""
    out = np.zeros(costs.shape, int)
    last = np.zeros(costs.shape[1], int)
    for n, here in enumerate(costs.astype(int)):
        for d in range(len(here)):
            steps = [last[d], large]
            steps += [last[d - 1] + small] if d > 0 else []
            steps += [last[d + 1] + small] if d + 1 < len(here) else []
            out[n, d] = here[d] + min(steps)
        last = out[n] - out[n].min()
    return out


def better_plane(d, a, b, y, x, step, costs, best, wanted):
    """Return cost and plane (d, a, b) of a node: its own, or the best `step` nodes away."""
    found = best, d[y, x], a[y, x], b[y, x]
    rows, columns = d.shape
    if not wanted or not (step <= y < rows - step and step <= x < columns - step):
        return found
    which = int(np.argmin(costs))
    down, along = ((0, -step), (0, step), (-step, 0), (step, 0))[which]
    j, i = y + down, x + along
    moved = d[j, i] - along * a[j, i] - down * b[j, i]
    return (costs[which], moved, a[j, i], b[j, i]) if (
        costs[which] < best and not np.isnan(moved)) else found


def best_window(cost, y, x):
    """Return the lowest mean of the windows of 3 x 3 nodes that hold a node."""
    return min(cost[j - 1:j + 2, i - 1:i + 2].astype(float).mean()
               for j in range(y - 1, y + 2) for i in range(x - 1, x + 2))

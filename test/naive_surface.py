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
"""
Loop-only twins of the surface method's kernels, in float64, written from their formulas.

One function for every parallel kernel of the surface method, with its name;
helpers without a twin of their own name are part of these. Twins return what the kernels write.

"""

import math

from color_stereo_ros.core.status import Status
from color_stereo_ros.core.surface import (
    bend_kernels, grid_kernels, quality_kernels, raw_kernels, step_kernels, texture_kernels,
    trust_kernels)
from color_stereo_ros.core.surface.coarse_kernels import AGREEMENT, LARGEST, RIVAL_DISTANCE
from color_stereo_ros.core.surface.contest_kernels import ALIKE, NEIGHBOR, OWN, SEED
from color_stereo_ros.core.surface.grid_kernels import PAD, PHASE_VARIANCE, TILE_COLUMNS, TILE_ROWS
from color_stereo_ros.core.surface.neighbor_kernels import HALO
from color_stereo_ros.core.surface.pixel_kernels import bounded, OWN_SHARE
from color_stereo_ros.core.surface.plane_kernels import LEAST_WEIGHT, RADIUS, SPAN
from color_stereo_ros.core.surface.row_kernels import (
    BESIDE, BESIDE_WEIGHT, CELL, CELL_STEP, NODE_STEP, STEP)
from color_stereo_ros.core.surface.trust_kernels import (
    APART, FULL_SIZE, HIGHEST_ODDS, HOPELESS_ODDS, IMBALANCE_OFFSET, ISLAND_ODDS, STD_PER_DISTANCE,
    UNKNOWN_ODDS, UNLIT, VARIANCE_FACTOR)
import numpy as np

BRIGHTNESS_CAP = float(texture_kernels.BRIGHTNESS_CAP)
SILENT_VARIANCE = float(grid_kernels.SILENT_VARIANCE)
MISFIT_CAP = float(trust_kernels.MISFIT_CAP)
WINDOW = [(j, i) for j in (-1, 0, 1) for i in (-1, 0, 1)]
CROSS = [(0, 0), (-1, 0), (1, 0), (0, -1), (0, 1)]


def nodes_of(shape):
    """Yield all index pairs of a two-dimensional array."""
    for y in range(shape[0]):
        for x in range(shape[1]):
            yield y, x


def tile_nodes(tile, halo=0):
    """Yield the nodes of one tile and of so many around it."""
    for y in range(tile[0] - halo, tile[0] + TILE_ROWS + halo):
        for x in range(tile[1] - halo, tile[1] + TILE_COLUMNS + halo):
            yield y, x


def box_sums(image):
    """Return the sums of 2 x 2 pixels right of and below each pixel, borders repeated."""
    height, width = image.shape[:2]
    out = np.zeros(image.shape, int)
    for y, x in nodes_of((height, width)):
        for v in (y, min(y + 1, height - 1)):
            for u in (x, min(x + 1, width - 1)):
                out[y, x] += image[v, u]
    return out


def look_at_rows(image):
    """Return the quantities of an image by name, and the shares of its edges."""
    image = image.astype(int)
    (height, width), raw = image.shape[:2], raw_kernels
    out, edges = dict.fromkeys(raw.QUANTITIES, 0), []
    for y, x in nodes_of((height, width)):
        lit = max(image[y, x]) > raw.LIT
        if (y - height % 8 // 2) % 8 == 0 and y >= height % 8 // 2 and x % 4 == 0 and lit:
            out['lit'] += 1
            out['colored'] += np.ptp(image[y, x]) > raw.GRAY_DIFFERENCE
    spike_rows = range(max(raw.FIRST_ROW, 2), height - 2, raw.ROW_STEP)
    step = max(1, min(raw.ROW_STEP, height // raw.LEAST_ROWS))
    chroma_rows = range(raw.FIRST_ROW, height, step)
    if width >= raw.LEAST_COLUMNS:
        out['spike_rows'], out['chroma_rows'] = len(spike_rows), len(chroma_rows)
        for y in spike_rows:
            for x in range(width):
                ring = [image[y + j, x + i] for j in range(-2, 3) for i in range(-2, 3)
                        if max(abs(j), abs(i)) == 2 and 0 <= x + i < width]
                out['spikes'] += (image[y, x] > np.max(ring, axis=0) + raw.SPIKE).sum()
        for y in chroma_rows:
            for name, color in (('red', 0), ('blue', 2)):
                third = np.abs(np.diff(image[y, :, color] - image[y, :, 1], 3))
                out[f'even_{name}'] += third[::2].sum()
                out[f'odd_{name}'] += third[1::2].sum()
    if width > 2:
        for y in range(raw.NOISE_ROW, height, raw.NOISE_STEP):
            out['near'] += np.abs(image[y, 1:] - image[y, :-1]).sum()
            out['far'] += np.abs(image[y, 2:] - image[y, :-2]).sum()
    if width > raw.EDGE_REACH:
        for y in range(raw.EDGE_ROWS // 2, height, raw.EDGE_ROWS):
            green, reach = image[y, :, 1], raw.EDGE_REACH // 2
            for x in range(1, width - 1):
                span = np.ptp(green[max(x - reach, 0):x + reach + 1])
                if span > raw.LEAST_EDGE:
                    edges.append(abs(green[x + 1] - green[x - 1]) / span)
    out['edges'] = len(edges)
    return out, edges


def bilinear(image, y, x, fy, fx):
    """Return the value of an image between four pixels."""
    above = (1 - fx) * image[y, x] + fx * image[y, x + 1]
    below = (1 - fx) * image[y + 1, x] + fx * image[y + 1, x + 1]
    return (1 - fy) * above + fy * below


def channel_levels(image, step, known_dark, darkest):
    """Return the dark level and the mean above it of each channel of every step-th pixel."""
    out = []
    for channel in range(3):
        values = sorted(int(v) for v in image[step // 2::step, step // 2::step, channel].ravel())
        dark = known_dark
        if known_dark < 0:
            # the first value that more than half a percent are not above
            dark = min(values[len(values) // 200], darkest)
        out.append((dark, sum(max(v - dark, 0) for v in values) / len(values)))
    return np.array(out).T


def sample_colors(box, index, frac_x, frac_y, dark, gain, soft, saturation, noise):
    """Return u, v, s, peak and variance of the nodes; box is (H, W, 3)."""
    u, v, s, peak, lowest = np.zeros((5, *index.shape))
    for y, x in nodes_of(index.shape):
        if index[y, x] < 0:
            peak[y, x] = lowest[y, x] = -1
            continue
        row, column = divmod(index[y, x], box.shape[1])
        raw = bilinear(box, row, column, frac_y[y, x], frac_x[y, x]) / 4
        r, g, b = [max(c - d, 0) * k for c, d, k in zip(raw, dark, gain)]
        s[y, x] = r + g + b
        u[y, x] = (2 * r - g - b) / (s[y, x] + soft)
        v[y, x] = math.sqrt(3) * (g - b) / (s[y, x] + soft)
        peak[y, x], lowest[y, x] = max(raw), min(raw)
    return u, v, s, peak, color_variance(s, lowest, saturation, *map(float, noise))


def reduce_colors(u, v, s, top, left, step_x, step_y, soft, scale, knee, shape):
    """Return coarse u, v (units of 1 / scale), brightness and trust, not yet quantized."""
    out = np.zeros((4, *shape))
    for y, x in nodes_of(shape):
        inner = [(j, i) for j in range(top + y * step_y, top + (y + 1) * step_y)
                 for i in range(left + x * step_x, left + (x + 1) * step_x)]
        weight = sum(s[p] + soft for p in inner)
        out[0, y, x] = scale * sum(u[p] * (s[p] + soft) for p in inner) / weight
        out[1, y, x] = scale * sum(v[p] * (s[p] + soft) for p in inner) / weight
        out[2, y, x] = np.mean([s[p] for p in inner])
        out[3, y, x] = min(16, 16 * out[2, y, x] / knee)
    return out


def color_variance(s, lowest, saturation, floor, shot, relative):
    """Return the variance of each chromaticity."""
    out = np.empty(s.shape)
    for y, x in nodes_of(s.shape):
        total = max(float(s[y, x]), 1e-3)
        out[y, x] = (floor + shot * total + relative * total ** 2) / total ** 2
        if lowest[y, x] < 0 or lowest[y, x] >= saturation or out[y, x] > SILENT_VARIANCE:
            out[y, x] = SILENT_VARIANCE
    return out


def node_cost(left, right, y, x, disparity, cap, neutral):
    """
    Return the cost of one pair of coarse nodes.

    left is (u, v, texture, trust), right (lowest u, v, highest u, v, texture, trust).

    """
    at = x - disparity
    inside = 0 <= at < right.shape[2]
    *color, texture, trusted = [int(c) for c in right[:, y, at]] if inside else [0] * 6
    cost = abs(int(left[2, y, x]) - texture) + sum(
        max(0, int(left[c, y, x]) - color[c + 2], color[c] - int(left[c, y, x])) for c in (0, 1))
    cost = min(cap, cost)
    trust = min(int(left[3, y, x]), trusted)
    return neutral + (cost - neutral) * trust // 16


def half_way(colors):
    """Return the lowest and highest of colors (2, h, w) within half a node along the rows."""
    low, high = colors.copy(), colors.copy()
    for c in range(2):
        for y, x in nodes_of(colors.shape[1:]):
            for at in (x - 1, x + 1):
                if 0 <= at < colors.shape[2]:
                    middle = math.floor((int(colors[c, y, x]) + int(colors[c, y, at])) / 2)
                    low[c, y, x] = min(low[c, y, x], middle)
                    high[c, y, x] = max(high[c, y, x], middle)
    return low, high


def cost_volume(left, right, first, depth, cap, neutral):
    """Return costs summed over 3 x 3 weighted nodes, (h, w, depth), of disparities from first."""
    rows, columns = left.shape[1:]
    out = np.zeros((rows, columns, depth), int)
    for y, x in nodes_of((rows, columns)):
        for d in range(depth):
            out[y, x, d] = sum(
                (2 - abs(j)) * (2 - abs(i)) * node_cost(
                    left, right, min(max(y + j, 0), rows - 1), min(max(x + i, 0), columns - 1),
                    first + d, cap, neutral)
                for j, i in WINDOW) // 2
    return out


def path_costs(costs, small, large):
    """Return the costs along one path of nodes, costs (n, D) (Hirschmueller 2008, eq. 13)."""
    path = np.zeros(costs.shape, int)
    path[0] = costs[0]
    for n in range(1, len(costs)):
        before, least = path[n - 1], min(path[n - 1])
        for d in range(costs.shape[1]):
            steps = [before[e] + small for e in (d - 1, d + 1) if 0 <= e < costs.shape[1]]
            path[n, d] = costs[n, d] + min(before[d], least + large, *steps) - least
    return path


def sgm_paths(cost, small, large):
    """Return the sum of the path costs from left, right, above and below, cost (h, w, D)."""
    turned = cost.transpose(1, 0, 2)
    return (np.stack([both_ways(row, small, large) for row in cost])
            + np.stack([both_ways(column, small, large) for column in turned], axis=1))


def both_ways(costs, small, large):
    """Return the sum of the path costs along a path and back."""
    return path_costs(costs, small, large) + path_costs(costs[::-1], small, large)[::-1]


def add_turned(turned, total):
    """Return total (h, w, D) + turned (w, h, D)."""
    out = total.copy()
    for y, x in nodes_of(total.shape[:2]):
        out[y, x] += turned[x, y]
    return out


def winners(total, first, least_gap):
    """Return the disparity of each coarse node, NaN where sides disagree, and which are clear."""
    disparity = np.full(total.shape[:2], np.nan)
    clear = np.ones(total.shape[:2])
    for y in range(total.shape[0]):
        best = [int(np.argmin(line)) for line in total[y]]
        for x, at in enumerate(best):
            rivals = [cost for k, cost in enumerate(total[y, x])
                      if abs(k - at) > RIVAL_DISTANCE]
            clear[y, x] = min(rivals, default=math.inf) >= total[y, x, at] + least_gap
            right = x - (first + at)
            if not 0 <= right < total.shape[1]:
                continue
            bids = [(total[y, i, k], -k) for i, k in enumerate(best) if i - (first + k) == right]
            if abs(-min(bids)[1] - at) <= AGREEMENT:
                disparity[y, x] = first + at + v_fit(total[y, x], at)
    return disparity, clear


def v_fit(line, at):
    """Return the offset of the tip of a V with equal slopes through three costs."""
    if not 0 < at < len(line) - 1:
        return 0.0
    rise = max(line[at - 1], line[at + 1]) - line[at]
    return 0.5 * (line[at - 1] - line[at + 1]) / rise if rise > 0 else 0.0


def seed_planes(coarse, factor, offset, rows, columns):
    """Return d, a, b of the half grid, (3, rows, columns) without frame."""
    planes = np.zeros((3, rows, columns))
    for y, x in nodes_of((rows, columns)):
        cy, cx = min(y // factor, coarse.shape[0] - 1), min(x // factor, coarse.shape[1] - 1)
        a = 2 * one_sided_slope(coarse[cy], cx)
        b = 2 * one_sided_slope(coarse[:, cx], cy)
        center = (factor - 1) / 2
        planes[:, y, x] = (2 * factor * coarse[cy, cx] + offset + a * (x - cx * factor - center)
                           + b * (y - cy * factor - center), a, b)
    return planes


def one_sided_slope(values, at):
    """Return the smaller of the steps to the known neighbors, the end of a row repeated."""
    backward = values[at] - values[max(at - 1, 0)]
    forward = values[min(at + 1, len(values) - 1)] - values[at]
    known = [step for step in (forward, backward) if not math.isnan(step)]
    return min(known, key=abs, default=0.0)


def cubic(p, t):
    """Return value and derivative, t from p[1] towards p[2], of the cubic through four points."""
    through = np.polynomial.Polynomial(np.linalg.solve(np.vander([-1, 0, 1, 2])[:, ::-1], p))
    return through(t), through.deriv()(t)


def foreshortened(left, y, x, psf, a, b):
    """Return the left chromaticities of a node, blurred as the right view of its plane."""
    shown = max(1 - a / 2, 0.25)
    variance = psf * ((1 + (b / 2) ** 2) / shown ** 2 - 1)  # px^2
    gain = min(variance / 4 / 2, 1 / 3)
    u = left[:2].astype(float)
    return u[:, y, x] + gain * (u[:, y, x - 1] - 2 * u[:, y, x] + u[:, y, x + 1])


def linearize(left, right, psf, matrix, planes, tiles, robust, scale, reference):
    """Return weight, moment and misfit, NaN outside the tiles; left, right are (u, v, var)."""
    d, a, b = planes
    out = np.full((3, *d.shape), np.nan)
    for y, x in (node for tile in tiles for node in tile_nodes(tile)):
        out[:, y, x] = 0, 0, np.nan
        place = 2.0 * (x - PAD) - float(d[y, x])
        if not 1 <= place < right.shape[2] - 2:
            continue
        i = int(place)
        noise = max(right[2, y, i], right[2, y, i + 1])
        if noise >= SILENT_VARIANCE or left[2, y, x] >= SILENT_VARIANCE:
            continue
        (u, gu), (v, gv) = (cubic(right[c, y, i - 1:i + 3].astype(float), place - i)
                            for c in (0, 1))
        blurred = max(left[2, y, x - 1], left[2, y, x + 1]) < SILENT_VARIANCE
        own = foreshortened(left, y, x, psf if blurred else 0, a[y, x], b[y, x])
        error = own - matrix @ (u, v, 1)
        slope = matrix[:, :2] @ (gu, gv)
        steep = slope @ slope
        w = 1 / (scale * (left[2, y, x] + noise) + PHASE_VARIANCE * steep)
        chi = w * (error @ error)
        w /= 1 + chi / robust
        out[:, y, x] = w * steep, w * steep * (d[y, x] - reference) - w * (slope @ error), chi
    return out


def local_colors(u, v, s, mean, row, column, level, channels, shape):
    """Return colors with the brightness against the surroundings, not rounded."""
    out = np.zeros((*shape, channels))
    for j, i in nodes_of(shape):
        at = row + j, column + i
        total = level * s[at] / mean[at]
        red = total * (1 + u[at])
        green = (3 * total - red) / 2 + math.sqrt(3) / 2 * total * v[at]
        colors = (total,) if channels == 1 else (red, green, 3 * total - red - green)
        out[j, i] = [min(max(each, 0), 255) for each in colors]
    return out


def linearize_brightness(left, right, psf, planes, tiles, robust, scale, reference, fold, colors):
    """Return weight, moment, misfit and own misfit; left, right are (t, variance)."""
    d, a, b = planes
    out = np.full((4, *d.shape), np.nan)
    for y, x in (node for tile in tiles for node in tile_nodes(tile)):
        out[:3, y, x] = colors[:, y, x]
        place = 2.0 * (x - PAD) - float(d[y, x])
        if not 1 <= place < right.shape[2] - 2:
            continue
        i = int(place)
        noise = max(right[1, y, i], right[1, y, i + 1])
        if noise >= SILENT_VARIANCE or left[1, y, x] >= SILENT_VARIANCE:
            continue
        value, slope = cubic(right[0, y, i - 1:i + 3].astype(float), place - i)
        blurred = max(left[1, y, x - 1], left[1, y, x + 1]) < SILENT_VARIANCE
        error = foreshortened(left, y, x, psf if blurred else 0, a[y, x], b[y, x])[0] - value
        w = 1 / (scale * (left[1, y, x] + noise) + PHASE_VARIANCE * slope * slope)
        chi = w * error * error
        w /= 1 + chi / robust
        out[0, y, x] += w * slope * slope
        out[1, y, x] += w * slope * slope * (d[y, x] - reference) - w * slope * error
        if fold:
            own = min(chi, BRIGHTNESS_CAP)
            out[2, y, x] = 2 * own if np.isnan(colors[2, y, x]) else 2 / 3 * (
                colors[2, y, x] + own)
        out[3, y, x] = chi
    return out


def add_seeds(seed, d, tiles, gate, seed_weight, reference, weight, moment):
    """Return weight and moment with the seeds of some tiles."""
    weight, moment = weight.copy(), moment.copy()
    for y, x in (node for tile in tiles for node in tile_nodes(tile)):
        if abs(seed[y, x] - d[y, x]) < gate and weight[y, x] > 0:
            weight[y, x] += seed_weight
            moment[y, x] += seed_weight * (seed[y, x] - reference)
    return weight, moment


def rival_gaps(cost, total):
    """Return by how much the own cost of the nearest rival of a match exceeds that of it."""
    rows, depth, columns = total.shape
    gaps = np.full((rows, columns), float(LARGEST))
    for y, x in np.ndindex(rows, columns):
        best = int(np.argmin(total[y, :, x]))
        others = [d for d in range(depth) if abs(d - best) > RIVAL_DISTANCE]
        if others:
            rival = min(others, key=lambda d: total[y, d, x])
            gaps[y, x] = int(cost[y, rival, x]) - int(cost[y, best, x])
    return gaps


def count_rivals(total, trust, full_trust, worst, gap, step):
    """Return how many of every step-th nodes are fully trusted, and how many have a rival."""
    counts = [0, 0]
    for y in range(0, total.shape[0], step):
        for x in range(0, total.shape[2], step):
            costs = [int(each) for each in total[y, :, x]]
            best = costs.index(min(costs))
            if trust[y, x] >= full_trust and costs[best] < worst:
                counts[0] += 1
                counts[1] += any(abs(d - best) > RIVAL_DISTANCE and cost < costs[best] + gap
                                 for d, cost in enumerate(costs))
    return counts


def widen(u, gain_x, gain_y):
    """Return a chromaticity with second differences added, borders repeated, ends of rows kept."""
    out = u.copy()
    for y, x in nodes_of(u.shape):
        if 0 < x < u.shape[1] - 1:
            above, below = u[max(y - 1, 0), x], u[min(y + 1, u.shape[0] - 1), x]
            out[y, x] += (gain_x[y, x] * (u[y, x - 1] - 2 * u[y, x] + u[y, x + 1])
                          + gain_y[y, x] * (above - 2 * u[y, x] + below))
    return out


def fit_planes(weight, moment, planes, tiles, reach, gate, stride, noise_weight, ridge,
               steepest, reference):
    """Return d, a, b and variance, NaN outside the tiles."""
    out = np.full((4, *weight.shape), np.nan)
    for tile, radius in zip(tiles, reach):
        widest = max(radius, RADIUS)
        informed = any(weight[node] > 0 for node in tile_nodes(tile, widest))
        for y, x in tile_nodes(tile):
            if not informed:
                out[:, y, x] = *planes[:, y, x], np.inf
                continue
            window = [(j, i) for j in range(-widest, widest + 1, 1 if radius else stride)
                      for i in range(-widest, widest + 1)
                      if radius or on_plane(planes, y, x, j, i, gate)]
            out[:, y, x] = fitted_plane(weight, moment, planes[:, y, x], y, x, window,
                                        noise_weight, ridge, steepest, reference)
    return out


def on_plane(planes, y, x, j, i, gate):
    """Return whether node (y + j, x + i) lies within gate of the plane of node (y, x)."""
    d, a, b = planes[:, y, x]
    return abs(planes[0, y + j, x + i] - (d + a * i + b * j)) < gate


def fitted_plane(weight, moment, last, y, x, window, noise_weight, ridge, steepest, reference):
    """Return d, a, b, variance of the weighted least squares of one node."""
    normal, pulled = np.zeros((3, 3)), np.zeros(3)
    for j, i in window:
        place = np.array([1.0, i, j])
        normal += weight[y + j, x + i] * np.outer(place, place)
        pulled += moment[y + j, x + i] * place
    total = normal[0, 0]
    if total <= LEAST_WEIGHT:
        return *last, np.inf
    means = normal[0, 1:] / total
    held = normal + ridge * total * np.diag([0, 1, 1])
    slopes = np.linalg.solve(held, pulled + ridge * total * np.array([0, last[1], last[2]]))[1:]
    slopes = np.clip(slopes, -steepest, steepest)
    signal = total - noise_weight * sum(weight[y + j, x + i] > 0 for j, i in window)
    variance = np.linalg.inv(held)[0, 0] * total / signal if signal > 0.02 * total else np.inf
    return reference + pulled[0] / total - means @ slopes, *slopes, variance


def second_differences(d, y, x):
    """Return those over bend_kernels.SPAN nodes, along the row and along the column."""
    span = bend_kernels.SPAN
    return (d[y, x - span] + d[y, x + span] - 2 * d[y, x],
            d[y - span, x] + d[y + span, x] - 2 * d[y, x])


def find_bent_tiles(d, variance, misfit, tiles, least_bend, noise_ratio, usual_misfit,
                    misfit_gain, least_share):
    """Return which tiles bend, bool (N,), and the factor of their noise (N,)."""
    most = float(bend_kernels.LARGEST_BEND)
    bent, noise = [], []
    for tile in tiles:
        nodes = [(y, x) for y, x in tile_nodes(tile) if (y - tile[0]) % 2 == 0]
        counted = [node for node in nodes if variance[node] < most and misfit[node] >= 0]
        roots = [math.sqrt(min(misfit[node], bend_kernels.MISFIT_CAP)) for node in counted]
        level = np.mean(roots) if roots else 0.0
        noise.append(1 + misfit_gain * max(level - usual_misfit, 0))
        spread = np.mean([variance[node] for node in counted]) if counted else 0.0
        least = least_bend ** 2 + noise_ratio * noise[-1] * spread
        bends = sum(any(least < bend ** 2 < most ** 2 for bend in second_differences(d, *node))
                    for node in nodes)
        bent.append(bends > least_share * len(nodes))
    return np.array(bent), np.array(noise)


def write_pulls(weight, moment, d, reference):
    """Return what every node asks for beyond its own disparity; 0 where that is unknown."""
    out = np.zeros(d.shape)
    for node in nodes_of(d.shape):
        asked = moment[node] - weight[node] * (d[node] - reference)
        out[node] = asked if math.isfinite(asked) else 0.0
    return out


def unbend(weight, pull, planes, variance, tiles, noise, smooth, gate, noise_weight, ridge,
           steepest, doubt):
    """Return d, a, b and variance, NaN outside the tiles."""
    out = np.full((4, *weight.shape), np.nan)
    for tile, factor, free in zip(tiles, noise, smooth):
        for y, x in tile_nodes(tile):
            out[:, y, x] = *planes[:, y, x], variance[y, x]
            stride = 1 if free else bend_kernels.ROW_STRIDE
            window = [(j, i) for j in range(-RADIUS, RADIUS + 1, stride)
                      for i in range(-RADIUS, RADIUS + 1)
                      if free or on_plane(planes, y, x, j, i, gate)]
            step, slope_x, slope_y, spread = fitted_plane(
                weight, pull, np.zeros(3), y, x, window, noise_weight, ridge, np.inf, 0.0)
            if not (math.isfinite(spread) and math.isfinite(planes[0, y, x])):
                continue
            spread *= factor
            share = 1 - spread / step ** 2 if step ** 2 > spread else 0.0
            out[0, y, x] += share * step
            for at, slope in ((1, slope_x), (2, slope_y)):
                out[at, y, x] = np.clip(out[at, y, x] + share * slope, -steepest, steepest)
            out[3, y, x] += (share ** 2 * spread + min(((1 - share) * step) ** 2, spread)
                             + (doubt * step) ** 2)
    return out


def sample_quality(d, weight, moment, variance, reference, step, shape):
    """Return root pull, second difference, 1 and height of the samples (4, h, w)."""
    kernels = quality_kernels
    out = np.zeros((4, *shape))
    reach = range(-kernels.REACH, kernels.REACH + 1)
    pulls = write_pulls(weight, moment, d, reference)
    for row, column in nodes_of(shape):
        y, x = (PAD + at * step + step // 2 for at in (row, column))
        window = [(y + j, x + i) for j in reach for i in reach]
        total = sum(weight[node] for node in window if math.isfinite(d[node]))
        bends = [abs(each) for each in second_differences(d, y, x)]
        if not (np.isfinite(bends).all() and total > 0
                and variance[y, x] < kernels.WORST_VARIANCE):
            continue
        pull = abs(sum(pulls[node] for node in window)) / math.sqrt(total)
        out[:, row, column] = (min(pull, kernels.PULL_CAP),
                               min(*bends, kernels.UNEVEN_CAP), 1, height(d, window))
    return out


def height(d, window):
    """Return the range of the known disparities of a window, 0 without any."""
    known = [d[node] for node in window if math.isfinite(d[node])]
    return max(known) - min(known) if known else 0.0


def lower_beside_steps(d, rough, low, high, lost, kept, odds):
    """Return the log-odds of all nodes after `step_kernels.lower_beside_steps`, framed."""
    out, reach = odds.copy(), range(-step_kernels.REACH, step_kernels.REACH + 1)
    for row, column in nodes_of(rough.shape):
        y, x = row + PAD, column + PAD
        size = height(d, [(y + j, x + i) for j in reach for i in reach]) * rough[row, column]
        share = min(max((size - low) / (high - low), 0), 1)
        out[y, x] = max(odds[y, x] - lost * share, min(odds[y, x], kept))
    rows, end = slice(PAD, PAD + rough.shape[0]), PAD + rough.shape[1]
    out[rows, PAD - 1], out[rows, end] = out[rows, PAD], out[rows, end - 1]
    return out


def window_difference(left, right, gain, y, x, plane, cap):
    """Return the truncated absolute differences of 3 x 3 nodes under a plane."""
    d, a, b = plane
    rows, columns, _ = left.shape
    total = 0.0
    for row, column in ((min(max(y + j, 0), rows - 1), min(max(x + i, 0), columns - 1))
                        for j in (-1, 0, 1) for i in (-1, 0, 1)):
        place = 2 * column - (d + a * (column - x) + b * (row - y))
        if not 0 <= place < right.shape[1] - 1:
            total += cap
            continue
        at = int(place)
        found = (1 - place + at) * right[row, at].astype(float) + (
            place - at) * right[row, at + 1].astype(float)
        total += min(np.abs(left[row, column] - gain * found).sum(), cap)
    return total


def average_alike(u, v, variance, reach_y, reach_x, tolerance, noise):
    """Return averages (u, v) of colors with opposite pairs that are alike, and their counts."""
    rows, columns = u.shape
    out = np.stack([u, v, np.ones(u.shape)]).astype(float)
    for y, x in np.ndindex(rows, columns):
        if not variance[y, x] < SILENT_VARIANCE:
            continue
        alike = [(y, x)]
        for j, i in np.ndindex(2 * reach_y + 1, 2 * reach_x + 1):
            pair = [(y + sign * (j - reach_y), x + sign * (i - reach_x)) for sign in (1, -1)]
            if pair[0] != (y, x) and all(
                    0 <= row < rows and 0 <= column < columns
                    and variance[row, column] < SILENT_VARIANCE
                    and ((u[row, column] - u[y, x]) ** 2 + (v[row, column] - v[y, x]) ** 2
                         < tolerance ** 2 + noise * variance[y, x])
                    for row, column in pair):
                alike.append(pair[0])
        out[:, y, x] = *(np.mean([plane[each] for each in alike]) for plane in (u, v)), len(alike)
    return out


def contest(left, right, gain, wanted, seed, seed_variance, cap, margin, planes, y, x):
    """Return d, a, b, variance and winner of one node; planes: these four, framed."""
    d, a, b, variance = (each[y + PAD, x + PAD] for each in planes)
    best, least = (d, a, b, variance, OWN), 9 * cap
    if not wanted[y, x]:
        return best
    if np.isfinite(d):
        least = window_difference(left, right, gain[y, x], y, x, (d, a, b), cap) - margin
    candidates = [(seed[y + PAD, x + PAD], 0, 0, seed_variance, SEED)]
    for j, i in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        there = [each[y + PAD + j, x + PAD + i] for each in planes]
        candidates.append((there[0] - there[1] * i - there[2] * j, *there[1:], NEIGHBOR))
    for candidate in candidates:
        alike = candidate[-1] == NEIGHBOR and sum(
            abs(each - other) for each, other in zip(candidate[:3], best)) < ALIKE
        if np.isfinite(candidate[0]) and not alike:
            cost = window_difference(left, right, gain[y, x], y, x, candidate[:3], cap)
            if cost < least - 1e-3:  # the kernel adds in float32
                best, least = candidate, cost
    return best


def find_smooth_tiles(planes, variance, tiles, halo, step):
    """Return which tiles one surface fills, bool (N,)."""
    d, a, b = planes
    smooth = []
    for tile in tiles:
        speaking = [node for node in tile_nodes(tile, halo) if variance[node] < SILENT_VARIANCE]
        inside = set(speaking)
        smooth.append(all(
            ((y - SPAN, x) not in inside
             or abs(d[y, x] - d[y - SPAN, x] - SPAN * b[y - SPAN, x]) < step)
            and ((y, x - SPAN) not in inside
                 or abs(d[y, x] - d[y, x - SPAN] - SPAN * a[y, x - SPAN]) < step)
            for y, x in speaking))
    return np.array(smooth)


def capped(chi):
    """Return a misfit, at most MISFIT_CAP; NaN counts as that."""
    return float(chi) if chi < MISFIT_CAP else MISFIT_CAP


def plane_misfit(left, right, psf, matrix, scale, cap, planes, y, x, step_y, step_x,
                 brightness=None):
    """
    Return the truncated misfit of one node under the plane of the node a step away.

    brightness: (left, right, scale) of (t, variance), if it counts beside the colors.

    """
    d, a, b = planes[:, y + step_y, x + step_x].astype(float)
    place = 2.0 * (x - PAD) - (d - a * step_x - b * step_y)
    if not 0 <= place < right.shape[2] - 1:
        return cap
    i = int(place)
    here, there = right[:, y, i].astype(float), right[:, y, i + 1].astype(float)
    noise = max(here[2], there[2])
    slope = (there - here)[:2]
    u, v = here[:2] + slope * (place - i)
    error = foreshortened(left, y, x, psf, a, b) - matrix @ (u, v, 1)
    spread = scale * (left[2, y, x] + noise) + float(PHASE_VARIANCE) * (slope @ slope)
    chi = min(cap, error @ error / spread) if noise < SILENT_VARIANCE else cap / 2
    if brightness is None:
        return chi
    (left_t, right_t, own_scale), at = brightness, place - i
    below, above = right_t[:, y, i].astype(float), right_t[:, y, i + 1].astype(float)
    noise = max(below[1], above[1])
    if noise >= SILENT_VARIANCE:
        return chi
    rise = above[0] - below[0]
    error = foreshortened(left_t, y, x, psf, a, b)[0] - below[0] - rise * at
    spread = own_scale * (left_t[1, y, x] + noise) + float(PHASE_VARIANCE) * rise ** 2
    return min(cap, 2 / 3 * (chi + min(BRIGHTNESS_CAP, error ** 2 / spread)))


def shifted_mean(misfits, y, x):
    """Return the lowest of the nine 3 x 3 means that contain a node."""
    return min(np.mean([misfits[y + j + v, x + i + u] for v, u in WINDOW]) for j, i in WINDOW)


def propagate(left, right, psf, matrix, scale, cap, inertia, planes, tiles, step,
              own_cost=None, brightness=None):
    """Return d, a, b and cost, NaN outside the tiles; own_cost: of the planes, if judged."""
    out = np.full((4, *planes.shape[1:]), np.nan)
    for tile in tiles:
        if not any(planes[0][node] > -np.inf for node in tile_nodes(tile, step + HALO)):
            for y, x in tile_nodes(tile):
                out[3, y, x] = cap
            continue
        misfits = {(j, i): {(y, x): plane_misfit(left, right, psf, matrix, scale, cap, planes,
                                                 y, x, step * j, step * i, brightness)
                            for y, x in tile_nodes(tile, HALO)} for j, i in CROSS}
        for y, x in tile_nodes(tile):
            costs = {side: shifted_mean(misfits[side], y, x) for side in CROSS}
            if own_cost is not None:
                costs[0, 0] = own_cost[y, x]
            best = min(CROSS, key=lambda side: costs[side] - inertia * (side == (0, 0)))
            j, i = best[0] * step, best[1] * step
            d, a, b = planes[:, y + j, x + i]
            out[:, y, x] = d - a * i - b * j, a, b, costs[best]
    return out


def imbalance(left, right):
    """Return the difference over the sum of two brightnesses."""
    return (left - right) / (left + right + 2 * float(IMBALANCE_OFFSET))


def brightness_balance(d, misfit, left_s, right_s, step, worst, shape):
    """Return the imbalance and the weight of every step-th node."""
    balance, weight = np.zeros((2, *shape))
    for row, column in nodes_of(shape):
        y, x = PAD + row * step + step // 2, column * step + step // 2
        place = 2 * x - d[y, x + PAD]
        if misfit[y, x + PAD] < worst and 0 <= place < right_s.shape[1] - 1:
            balance[row, column] = imbalance(left_s[y, x + PAD], right_s[y, int(place)])
            weight[row, column] = 1
    return balance, weight


def color_sums(left, right, d, misfit, worst, rows, columns, step_y, step_x):
    """Return sums of x x^T and x y^T over the matched nodes; see the kernel."""
    normal, target = np.zeros((3, 3)), np.zeros((3, 2))
    for y in range(PAD + 1, PAD + rows, step_y):
        for x in range(PAD + 1, PAD + columns, step_x):
            if misfit[y, x] < worst:
                place = 2 * (x - PAD) - float(d[y, x])
                i = min(max(int(place), 0), right.shape[2] - 2)
                color = right[:2, y, i] + (place - i) * (right[:2, y, i + 1] - right[:2, y, i])
                inputs = np.append(color, 1)
                normal += np.outer(inputs, inputs)
                target += np.outer(inputs, left[:2, y, x])
    return normal, target


def weigh_evidence(planes, cost, misfit, variance, left_s, right_s, usual_balance, rows, columns,
                   form):
    """Return evidence (5, rows, columns) and trust (rows, columns)."""
    d, a, b = planes
    evidence, trust = np.zeros((rows, columns, 5)), np.zeros((rows, columns))
    for row, column in nodes_of((rows, columns)):
        y, x = row + PAD, column + PAD
        steps = (d[y, x + 1] - d[y, x] - a[y, x], d[y, x - 1] - d[y, x] + a[y, x],
                 d[y + 1, x] - d[y, x] - b[y, x], d[y - 1, x] - d[y, x] + b[y, x])
        place = 2 * column - d[y, x]
        place = place if 0 <= place < right_s.shape[1] - 1 else 0
        other = np.interp(place, np.arange(right_s.shape[1]), right_s[y])
        evidence[row, column] = np.sqrt([
            capped(cost[y, x]), np.mean([capped(misfit[y + j, x + i]) for j, i in WINDOW]),
            math.sqrt(min(variance[y, x], 1)),
            np.mean([abs(s) if abs(s) < 2 else 2.0 for s in steps]),
            min(abs(imbalance(left_s[y, x], other) - usual_balance[row, column]), 1)])
        inputs = np.append(1, evidence[row, column])
        known = np.isfinite(d[y, x]) and np.isfinite(variance[y, x])
        trust[row, column] = inputs @ form @ inputs if known else UNKNOWN_ODDS
    return np.moveaxis(evidence, 2, 0), trust


def join_nodes(planes, trust, first_row, last_row, columns, joined_distance):
    """Return the segments of the nodes of some rows, lists of joined nodes."""
    d, a, b = planes
    waiting = {(y + PAD, x + PAD) for y in range(first_row, last_row) for x in range(columns)
               if trust[y + PAD, x + PAD] > 0}

    def together(p, q):
        slope = b if p[0] != q[0] else a
        sign = (q[0] - p[0]) + (q[1] - p[1])
        return any(abs(d[q] - d[p] - sign * slope[r]) < joined_distance
                   for r in (p, q))

    segments = []
    while waiting:
        segment = [waiting.pop()]
        for y, x in segment:
            near = {(y + j, x + i) for j, i in CROSS[1:]} & waiting
            joined = [q for q in sorted(near) if together((y, x), q)]
            segment += joined
            waiting -= set(joined)
        segments.append(segment)
    return segments


def size_of(segment, s, full_brightness):
    """Return the size of a segment, dark nodes counting less, in parts of a bright node."""
    return sum(max(1, min(FULL_SIZE, int(FULL_SIZE * s[node] / full_brightness)))
               for node in segment)


def distrust_islands(planes, trust, s, full_brightness, rows, columns, joined_distance,
                     least_size):
    """Return trust with ISLAND_ODDS in small segments."""
    out = trust.copy()
    for segment in join_nodes(planes, trust, 0, rows, columns, joined_distance):
        if size_of(segment, s, full_brightness) < FULL_SIZE * least_size:
            for node in segment:
                out[node] = ISLAND_ODDS
    return out


def find_hidden(planes, trust, rows, columns, width, hidden_distance):
    """Return which nodes claim the place of a more trusted surface, bool (rows, columns)."""
    d, a = planes[:2].astype(float)
    hidden = np.zeros((rows, columns), bool)
    for row in range(rows):
        y = row + PAD
        claims = [x for x in range(PAD, PAD + columns) if trust[y, x] > ISLAND_ODDS]
        owner = {}
        for x in claims:
            center = 2 * (x - PAD) - d[y, x]
            reach = min(max(0.5, 1 - 0.5 * a[y, x]), 4)
            for at in range(width):
                if abs(at - center) <= reach and (
                        at not in owner or trust[y, x] > trust[y, owner[at]]):
                    owner[at] = x
        for x in claims:
            rival = owner.get(math.floor(2 * (x - PAD) - d[y, x] + 0.5), x)
            apart = abs(d[y, rival] + a[y, rival] * (x - rival) - d[y, x])
            hidden[row, x - PAD] = apart > hidden_distance + 0.25 * abs(x - rival)
    return hidden


def rescale_std(std, apart, assumed, variance):
    """Return standard deviations of true variances instead of assumed ones."""
    scaled = std.astype(float)
    for row, column in nodes_of(std.shape):
        before, after = float(assumed[row, column]), float(variance[row, column])
        other = (STD_PER_DISTANCE * apart[row, column] ** 2) ** 2 / VARIANCE_FACTOR
        if 0 < before < math.inf:
            scaled[row, column] *= math.sqrt((after + other) / (before + other))
    return scaled


def settle(d, variance, evidence, cost, trust, hidden, peak, s, rows, columns, limits,
           saturation, min_signal, hidden_odds, vague_std):
    """Return standard deviation, log-odds and the reason for no range, (rows, columns) each."""
    std, odds = np.zeros((2, rows, columns))
    reason = np.zeros((rows, columns), np.uint8)
    for row, column in nodes_of((rows, columns)):
        node = row + PAD, column + PAD
        apart = STD_PER_DISTANCE * evidence[APART, row, column] ** 2
        std[row, column] = math.sqrt(VARIANCE_FACTOR * variance[node] + apart ** 2)
        bright = peak[node] >= saturation
        reasons = [
            (Status.OUTSIDE_IMAGE, peak[node] < 0),
            (Status.SATURATED, bright),
            (Status.DARK, s[node] < min_signal),
            (Status.NO_MATCH, math.isnan(d[node])),
            (Status.AMBIGUOUS, variance[node] > vague_std ** 2),
            (Status.OUT_OF_RANGE, not limits[0] <= d[node] <= limits[1]),
            (Status.INCONSISTENT, hidden[node]),
            (Status.AMBIGUOUS, std[row, column] > vague_std),
            (Status.NO_MATCH, cost[node] > 0.3 * MISFIT_CAP),
            (Status.IMPLAUSIBLE, True)]
        reason[row, column] = next(code for code, holds in reasons if holds)
        hopeless = (peak[node] < 0 or variance[node] > vague_std ** 2
                    or trust[node] < -HIGHEST_ODDS
                    or not limits[0] <= d[node] <= limits[1]
                    or s[node] < UNLIT and not bright)
        odds[row, column] = HOPELESS_ODDS if hopeless else (
            trust[node] + (hidden_odds if hidden[node] else 0))
    return std, odds, reason


def pixel_odds(odds, v, u, rows, columns):
    """Return the log-odds of a pixel: those of its node and the bilinear ones around it."""
    node = min(v // 2, rows - 1), min(u // 2, columns - 1)
    interpolated = 0
    for j, weight_y in ((0, 0.75), (1 if v > 2 * node[0] else -1, 0.25)):
        for i, weight_x in ((0, 0.75), (1 if u > 2 * node[1] else -1, 0.25)):
            y, x = min(max(node[0] + j, 0), rows - 1), min(max(node[1] + i, 0), columns - 1)
            interpolated += weight_y * weight_x * bounded.py_func(odds[y + PAD, x + PAD])
    own = bounded.py_func(odds[node[0] + PAD, node[1] + PAD])
    return OWN_SHARE * own + (1 - OWN_SHARE) * interpolated


def expand(planes, std, odds, reason, beyond, rows, columns, limits, focal_baseline, offset,
           least_odds, shape):
    """Return disparity, depth, standard deviation, confidence (4, H, W) and status (H, W)."""
    images = np.full((4, *shape), np.nan)
    codes = np.zeros(shape, np.uint8)
    for v, u in nodes_of(shape):
        row, column = min(v // 2, rows - 1), min(u // 2, columns - 1)
        node = row + PAD, column + PAD
        d, a, b = planes[:, node[0], node[1]].astype(float)
        # a node lies at the center of its 2 x 2 pixels and is two pixels wide
        value = d + a * (u - 2 * column - 0.5) / 2 + b * (v - 2 * row - 0.5) / 2
        certainty = pixel_odds(odds, v, u, rows, columns)
        images[3, v, u] = 0
        if odds[node] == HOPELESS_ODDS or certainty < least_odds:
            codes[v, u] = reason[node]
        elif not limits[0] <= value <= limits[1]:
            codes[v, u] = Status.OUT_OF_RANGE
        elif not (0 <= u - value <= shape[1] - 1 or beyond[node]):
            codes[v, u] = Status.INCONSISTENT
        else:
            images[:, v, u] = (value, focal_baseline / (value - offset), std[node],
                               1 / (1 + math.exp(-certainty)))
    return images, codes


def rise(view, y, i, t):
    """Return the vertical gradient of u, v per px, t from column i on, by five rows 2 px apart."""
    rows = [(1 - t) * view[:2, y + j, i] + t * view[:2, y + j, i + 1] for j in (-2, -1, 1, 2)]
    return (8 * (rows[2] - rows[1]) - (rows[3] - rows[0])) / 12 / 2


def told_by_node(left, right, matrix, d, y, x, robust, scale):
    """Return misfit, place and the weighted gg, gh, hh, ge, he of a node; None: it is silent."""
    place = 2.0 * (x - PAD) - float(d[y, x])
    if not 1 <= place < right.shape[2] - 2:
        return None
    i = int(place)
    noise = max(right[2, y, i], right[2, y, i + 1])
    if max(noise, *(right[2, y + j, i] for j in (-2, -1, 1, 2))) >= SILENT_VARIANCE:
        return None
    (u, gu), (v, gv) = (cubic(right[c, y, i - 1:i + 3].astype(float), place - i) for c in (0, 1))
    e = left[:2, y, x] - matrix @ (u, v, 1)
    g, h = matrix[:, :2] @ (gu, gv), matrix[:, :2] @ rise(right.astype(float), y, i, place - i)
    w = 1 / (scale * (left[2, y, x] + noise) + PHASE_VARIANCE * (g @ g + h @ h))
    chi = w * (e @ e)
    w /= 1 + chi / robust
    around = np.array([d[y, x - BESIDE], d[y, x + BESIDE], d[y - BESIDE, x], d[y + BESIDE, x]])
    if not (np.abs(around - d[y, x]) < STEP).all():
        w *= BESIDE_WEIGHT
    return chi, place, w * np.array([g @ g, g @ h, h @ h, g @ e, h @ e])


def row_cells(left, right, matrix, d, robust, scale, rows, columns, turn, shape):
    """Return what every cell tells of its rows; left, right are (u, v, var)."""
    out = np.zeros((*shape, 7))
    for line, column in nodes_of(shape):
        top, first = CELL * line, CELL * (CELL_STEP * column + (turn + 2 * line) % CELL_STEP)
        told, structure = np.zeros(5), np.zeros(3)
        for y in range(PAD + top, PAD + min(top + CELL, rows)):
            for x in range(PAD + first, PAD + min(first + CELL, columns), NODE_STEP):
                if max(left[2, y + j, x + i] for j, i in CROSS) >= SILENT_VARIANCE:
                    continue
                across = (left[:2, y, x + 1] - left[:2, y, x - 1]).astype(float) / 4
                down = (left[:2, y + 1, x] - left[:2, y - 1, x]).astype(float) / 4
                structure += np.array([across @ across, across @ down, down @ down]) / (
                    2 * min(scale, 1) * left[2, y, x]
                    + PHASE_VARIANCE * (across @ across + down @ down))
                found = told_by_node(left, right, matrix, d, y, x, robust, scale)
                if found:
                    out[line, column, [0, 3, 4, 5]] += 1, found[0], found[1], d[y, x]
                    told += found[2]
        gg, gh, hh, ge, he = told
        share = gh / max(gg, 1e-6)
        out[line, column, [1, 2]] = hh - share * gh, he - share * ge
        out[line, column, 6] = structure[2] - structure[1] ** 2 / max(structure[0], 1e-6)
    return out


def moved_rows(places_x, places_y, seen, margin, step_x, c, size):
    """Return index, frac_x and frac_y of moved nodes; size: columns and lines of the image."""
    columns, lines = size
    out = np.zeros((3, places_x.shape[0] - 2 * margin, places_x.shape[1]))
    for j, i in nodes_of(out.shape[1:]):
        u = (step_x * i + 0.5 - (columns - 1) / 2) / (columns / 2)
        v = (2 * j + 0.5 - (lines - 1) / 2) / (columns / 2)
        moved = c @ (1, u, v, u * u, u * v, v * v, v * (u * u + v * v))
        at = min(max(j + margin + moved / 2, 0), len(places_x) - 2)
        above = int(at)
        x, y = ((1 - at + above) * each[above, i] + (at - above) * each[above + 1, i]
                for each in (places_x, places_y))
        inside = (seen[above, i] and seen[above + 1, i] and -1 / 32 <= x <= columns - 1 + 1 / 32
                  and -1 / 32 <= y <= lines - 1 + 1 / 32)
        x, y = min(max(x - 0.5, 0), columns - 2), min(max(y - 0.5, 0), lines - 2)
        out[:, j, i] = int(y) * columns + int(x) if inside else -1, x % 1, y % 1
    return out

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
"""Twins of the kernels of boards and corners: the same by NumPy and plain loops."""

import math

import numpy as np


def model(values, x, y):
    """Return the gray value of two crossing blurred edges at one pixel."""
    cx, cy, angle_1, angle_2, log_1, log_2, height, level, shade_x, shade_y = values
    dx, dy = x - cx, y - cy
    away_1 = math.cos(angle_1) * dy - math.sin(angle_1) * dx
    away_2 = math.cos(angle_2) * dy - math.sin(angle_2) * dx
    edges = (math.erf(away_1 / math.sqrt(2) / math.exp(log_1))
             * math.erf(away_2 / math.sqrt(2) / math.exp(log_2)))
    return (1 + (shade_x * dx + shade_y * dy) / 10) * (level + height * edges)


def window(gray, middle, inverse, reach, gap, guard, black, largest):
    """Return column, row and value of the pixels of a corner's window, three lists."""
    found = []
    for row in range(gray.shape[0]):
        for column in range(gray.shape[1]):
            left, top = int(middle[0]) - largest, int(middle[1]) - largest
            if not (left <= column < left + 2 * largest + 2
                    and top <= row < top + 2 * largest + 2):
                continue
            q = inverse @ np.array([column - middle[0], row - middle[1]])
            if max(abs(q)) > reach:
                continue
            near = gap - guard * np.linalg.norm(inverse, axis=1)
            if q[0] * q[1] * black > 0 or (abs(q) < near).any():
                found.append((column, row, float(gray[row, column])))
    return [list(each) for each in zip(*found)]


def differentiated(values, x, y):
    """Return the derivatives of `model` at one pixel by central differences."""
    steps = 1e-5 * np.eye(10)
    return np.array([(model(values + step, x, y) - model(values - step, x, y)) / 2e-5
                     for step in steps])


def fitted(start, window_pixels, rounds=60):
    """Return the parameters of the best fit by damped steps of Gauss and Newton."""
    columns, rows, seen = window_pixels
    values, damping = np.array(start, np.float64), 1e-2

    def residuals(these):
        return np.array([value - model(these, x, y) for x, y, value in zip(columns, rows, seen)])

    for _ in range(rounds):
        jacobian = np.array([differentiated(values, x, y) for x, y in zip(columns, rows)])
        here = residuals(values)
        normal = jacobian.T @ jacobian
        trial = values + np.linalg.solve(normal + damping * np.diag(np.diag(normal)),
                                         jacobian.T @ here)
        trial[4:6] = np.clip(trial[4:6], math.log(0.25), math.log(8))
        if (residuals(trial) ** 2).sum() < (here ** 2).sum():
            values, damping = trial, max(damping / 10, 1e-9)
        else:
            damping *= 10
    return values


def variance(values, window_pixels, lag=5):
    """Return the mean variance of both coordinates, neighbors' residuals counted as related."""
    columns, rows, seen = window_pixels
    jacobian = np.array([differentiated(values, x, y) for x, y in zip(columns, rows)])
    residual = np.array([value - model(values, x, y) for x, y, value in zip(columns, rows, seen)])
    influence = (jacobian @ np.linalg.inv(jacobian.T @ jacobian))[:, :2] * residual[:, None]
    at = dict(zip(zip(columns, rows), influence))
    twice = np.floor(2 * (values[:2] - (columns[0], rows[0])) + 0.5).astype(int)
    twice += 2 * np.array([columns[0], rows[0]])
    # A pixel outside of the window may lie opposite to one inside.
    places = {*at, *((twice[0] - x, twice[1] - y) for x, y in at)}
    zero = np.zeros(2)
    folded = {(x, y): at.get((x, y), zero) + at.get((twice[0] - x, twice[1] - y), zero)
              for x, y in places}
    total = 0.0
    for (x, y), push in folded.items():
        for j in range(-lag, lag + 1):
            for i in range(-lag, lag + 1):
                weight = (1 - abs(i) / (lag + 1)) * (1 - abs(j) / (lag + 1))
                total += weight * push @ folded.get((x + i, y + j), zero)
    return total / 4 * len(seen) / (len(seen) - 10)


def board_mean(corners, drawing, border, levels, samples=256):
    """Return the mean radiance of one pixel, given what its four corners see of the board."""
    total, u, v = 0.0, 0.5, 0.5
    for _ in range(samples // 2):
        u, v = (u + 0.7548776662466927) % 1.0, (v + 0.5698402909980532) % 1.0
        for p, q in ((u, v), (1 - u, 1 - v)):
            x, y = ((1 - p) * (1 - q) * corners[0] + p * (1 - q) * corners[1]
                    + (1 - p) * q * corners[2] + p * q * corners[3])
            total += _level(x, y, drawing, border, levels)
    return total / samples


def _level(x, y, drawing, border, levels):
    if not (drawing.x[0] - border <= x < drawing.x[-1] + border
            and drawing.y[0] - border <= y < drawing.y[-1] + border):
        return levels[2]
    for row in range(len(drawing.y) - 1):
        for column in range(len(drawing.x) - 1):
            if (drawing.dark[row, column] and drawing.x[column] <= x < drawing.x[column + 1]
                    and drawing.y[row] <= y < drawing.y[row + 1]):
                return levels[0]
    for center_x, center_y, radius in drawing.disks:
        if math.hypot(x - center_x, y - center_y) < radius:
            return levels[0]
    return levels[1]

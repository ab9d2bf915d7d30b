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


def profile(away, blur):
    """Return an edge from -1 to 1: a Gaussian lens before pixels 1 px wide."""
    def integral(x):
        return (x * math.erf(x / math.sqrt(2) / blur)
                + blur * math.sqrt(2 / math.pi) * math.exp(-0.5 * (x / blur) ** 2))

    return integral(away + 0.5) - integral(away - 0.5)


def model(values, x, y, bends=(0.0, 0.0)):
    """Return the gray value of two crossing blurred edges at one pixel."""
    cx, cy, angle_1, angle_2, log_1, log_2, height, level, shade_x, shade_y = values
    dx, dy = x - cx, y - cy
    edges = 1.0
    for angle, log, bend in ((angle_1, log_1, bends[0]), (angle_2, log_2, bends[1])):
        along = math.cos(angle) * dx + math.sin(angle) * dy
        away = math.cos(angle) * dy - math.sin(angle) * dx - bend / 2 * along ** 2
        edges *= profile(away, math.exp(log))
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


def differentiated(values, x, y, bends=(0.0, 0.0)):
    """Return the derivatives of `model` at one pixel by central differences."""
    steps = 1e-5 * np.eye(10)
    return np.array([(model(values + step, x, y, bends) - model(values - step, x, y, bends)) / 2e-5
                     for step in steps])


def fitted(start, window_pixels, bends=(0.0, 0.0), rounds=60):
    """Return the parameters of the best fit by damped steps of Gauss and Newton."""
    columns, rows, seen = window_pixels
    values, damping = np.array(start, np.float64), 1e-2

    def residuals(these):
        return np.array([value - model(these, x, y, bends)
                         for x, y, value in zip(columns, rows, seen)])

    for _ in range(rounds):
        jacobian = np.array([differentiated(values, x, y, bends) for x, y in zip(columns, rows)])
        here = residuals(values)
        normal = jacobian.T @ jacobian
        trial = values + np.linalg.solve(normal + damping * np.diag(np.diag(normal)),
                                         jacobian.T @ here)
        trial[4:6] = np.clip(trial[4:6], math.log(0.1), math.log(8))
        if (residuals(trial) ** 2).sum() < (here ** 2).sum():
            values, damping = trial, max(damping / 10, 1e-9)
        else:
            damping *= 10
    return values


def related(apart):
    """Return how much pixels count together whose places differ by so many columns and rows."""
    return np.prod(np.clip((6 - np.abs(apart)) / 4, 0, 1), axis=-1)


def spread(values, window_pixels, bends=(0.0, 0.0)):
    """Return what a corner's variance is made of, see corner_kernels.spread; dense matrices."""
    columns, rows, seen = window_pixels
    jacobian = np.array([differentiated(values, x, y, bends) for x, y in zip(columns, rows)])
    residual = np.array([value - model(values, x, y, bends)
                         for x, y, value in zip(columns, rows, seen)])
    places = np.column_stack([columns, rows]).astype(float)
    # Each pixel, and four beside the one opposite to it
    mirrored = 2 * values[:2] - places
    corners = np.floor(mirrored)[:, None] + np.array([(0, 0), (1, 0), (0, 1), (1, 1)])
    shares = np.prod(1 - np.abs(mirrored[:, None] - corners), axis=2)
    points = np.concatenate([places, corners.reshape(-1, 2)])
    weights = np.concatenate([np.ones(len(places)), shares.ravel()])
    owner = np.concatenate([np.arange(len(places)), np.repeat(np.arange(len(places)), 4)])
    kernel = np.zeros((len(places), len(places)))
    near = related(points[:, None] - points[None]) * weights[:, None] * weights[None] / 4
    np.add.at(kernel, (owner[:, None], owner[None]), near)
    covariance = np.linalg.inv(jacobian.T @ jacobian)
    influence = (jacobian @ covariance)[:, :2]
    basis = np.linalg.qr(jacobian)[0]
    seen_sum = expected = 0.0
    for push in influence.T:
        seen_sum += (push * residual) @ kernel @ (push * residual) / 2
        alone = 0.5 * (1 + related(2 * (places - values[:2]))) @ push ** 2
        fitted_away = sum((push * each) @ kernel @ (push * each) for each in basis.T)
        expected += (alone - fitted_away) / 2
    return seen_sum, expected, np.trace(covariance[:2, :2]) / 2


def cell_of(corners, i, j, fine):
    """Return the corners (4, 2) of one of fine x fine cells of a pixel (4, 2)."""
    shares = [(p / fine, q / fine) for q in (i, i + 1) for p in (j, j + 1)]
    return np.array([(1 - p) * (1 - q) * corners[0] + p * (1 - q) * corners[1]
                     + (1 - p) * q * corners[2] + p * q * corners[3] for p, q in shares])


def board_mean(corners, drawing, border, levels, samples=64):
    """Return the mean radiance of one cell, given what its four corners see of the board."""
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

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
"""ChArUco: a chessboard with a marker in each white square; an image may show a part of it."""

import cv2
import numpy as np

from .board_kind import BoardKind, Drawing, LEAST_CORNERS, squares
from .corners import detection
from ..core.registry import suggestion
from ..errors import CalibrationError, InstallationError

NEAR_MARKERS = 5     # that predict a corner; chosen: the four around it and one more
OUTLIER_SHARE = 0.25  # of the side of a marker, from one homography; leaves room for distortion


class Charuco(BoardKind):
    """
    Black squares, and markers in the white ones.

    The layout is OpenCV's since 4.6.0: the top left square is black, the markers are counted row
    by row.

    """

    summary = 'chessboard with a marker in each white square; a part of it is enough'
    marker_share = 0.75

    def check(self, board):
        """Refuse markers that do not fit, that are too many, or that OpenCV does not know."""
        if not 0.3 * board.square_m <= board.marker_m <= 0.9 * board.square_m:
            raise CalibrationError(
                f'markers of {1e3 * board.marker_m:g} mm in squares of '
                f'{1e3 * board.square_m:g} mm, expected {300 * board.square_m:g} .. '
                f'{900 * board.square_m:g} mm')
        if min(board.columns, board.rows) < 3:
            raise CalibrationError(f'a ChArUco board of {board.columns} x {board.rows} squares '
                                   'shows too few corners; take at least 3 along each side')
        known = len(dictionary(board.dictionary).bytesList)
        count = len(marker_places(board))
        if count > known:
            raise CalibrationError(f'a ChArUco board of {board.columns} x {board.rows} squares '
                                   f'needs {count} markers, {board.dictionary} has {known}')

    def drawing(self, board):
        """Return the Drawing."""
        bits = [~marker_bits(board.dictionary, index)
                for index in range(len(marker_places(board)))]
        cells = len(bits[0])
        lead = (board.square_m - board.marker_m) / 2
        # Within a square: white, the modules of the marker, white.
        steps = np.concatenate([[0.0], lead + np.linspace(0, board.marker_m, cells + 1)])
        dark = np.kron(squares(board), np.ones((cells + 2, cells + 2), bool))
        for (row, column), marker in zip(marker_places(board), bits):
            top, left = row * (cells + 2) + 1, column * (cells + 2) + 1
            dark[top:top + cells, left:left + cells] = marker

        def breaks(count):
            inner = np.arange(count)[:, None] * board.square_m + steps
            return np.append(inner.ravel(), count * board.square_m)

        return Drawing(breaks(board.columns), breaks(board.rows), dark)

    def describe(self, board):
        """Return one line for people."""
        return (f'ChArUco, {board.columns} x {board.rows} squares of {1e3 * board.square_m:g} mm,'
                f' markers {board.dictionary} of {1e3 * board.marker_m:g} mm')

    def detect(self, board, gray):
        """Return the Detection in a uint8 image (H, W), or None."""
        located = locate(board, gray)
        if located is None:
            return None
        ids, pixels, homographies = located
        scale = board.square_m * slopes(homographies, board.corners[ids, :2])
        gap = 0.5 - 0.5 * board.marker_m / board.square_m
        return detection(board, gray, ids, pixels, scale, gap)


def is_available():
    """Return whether OpenCV knows ArUco markers."""
    return hasattr(cv2, 'aruco')


def _aruco():
    if not is_available():
        raise InstallationError(
            f'ChArUco boards need cv2.aruco, which OpenCV {cv2.__version__} has not: pip install '
            '"opencv-python-headless>=4.7" or opencv-contrib-python-headless, or take a '
            'chessboard (kind chessboard)')
    return cv2.aruco


def dictionary(name):
    """Return OpenCV's dictionary of markers; an unknown name raises CalibrationError."""
    aruco = _aruco()
    names = [each.removeprefix('DICT_') for each in dir(aruco) if each.startswith('DICT_')]
    if name not in names:
        raise CalibrationError(f'unknown dictionary of markers {name!r}'
                               f'{suggestion(str(name), names)}; known are {", ".join(names)}')
    return aruco.getPredefinedDictionary(getattr(aruco, f'DICT_{name}'))


def marker_bits(name, index):
    """Return the modules of a marker with its black border, bool (n + 2, n + 2), True = white."""
    markers = dictionary(name)
    side = markers.markerSize + 2
    draw = getattr(_aruco(), 'generateImageMarker', None) or cv2.aruco.drawMarker
    return draw(markers, index, side) > 127


def marker_places(board):
    """Return row and column of the square of each marker, a list of (int, int)."""
    return list(zip(*(axis.tolist() for axis in np.nonzero(~squares(board)))))


def find_markers(board, gray):
    """
    Find the markers of a board.

    Returns
    -------
    index : numpy.ndarray, int64, shape (n,)
    pixels : numpy.ndarray, float64, shape (n, 4, 2)
        The corners of each, clockwise from its top left one.

    """
    aruco, markers = _aruco(), dictionary(board.dictionary)
    if hasattr(aruco, 'ArucoDetector'):
        parameters = aruco.DetectorParameters()
        parameters.cornerRefinementMethod = aruco.CORNER_REFINE_SUBPIX
        pixels, index, _ = aruco.ArucoDetector(markers, parameters).detectMarkers(gray)
    else:
        parameters = aruco.DetectorParameters_create()
        parameters.cornerRefinementMethod = aruco.CORNER_REFINE_SUBPIX
        pixels, index, _ = aruco.detectMarkers(gray, markers, parameters=parameters)
    if index is None:
        return np.empty(0, np.int64), np.empty((0, 4, 2))
    index = np.asarray(index).ravel().astype(np.int64)
    pixels = np.array(pixels, np.float64).reshape(-1, 4, 2)
    once = np.bincount(index)[index] == 1  # of a marker seen twice, one is not on the board
    ours = once & (index < len(marker_places(board)))
    return index[ours], pixels[ours]


def marker_corners(board):
    """Return the corners of all markers on the board, float64 (M, 4, 2), m."""
    places = np.array(marker_places(board), np.float64)[:, None, ::-1]
    unit = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
    return (places + 0.5) * board.square_m + unit * board.marker_m


def locate(board, gray):
    """
    Predict all corners that lie in the image from the markers around them.

    Returns
    -------
    located : (ids, pixels, homographies) or None
        int64 (n,); float64 (n, 2), px; float64 (n, 3, 3), from m to px, each true near its
        corner.

    """
    index, seen = find_markers(board, gray)
    if not len(index):
        return None
    known = marker_corners(board)[index]
    index, seen, known = _consistent(index, seen, known)
    if len(index) < 2:
        return None
    points = board.corners[:, :2]
    middle = known.mean(axis=1)
    ids, pixels, homographies = [], [], []
    for corner, point in enumerate(points):
        distance = np.linalg.norm(middle - point, axis=1)
        near = np.argsort(distance, kind='stable')[:NEAR_MARKERS]
        if distance[near[0]] > board.square_m:
            continue
        homography = cv2.findHomography(known[near].reshape(-1, 2), seen[near].reshape(-1, 2))[0]
        if homography is None:
            continue
        place = cv2.perspectiveTransform(point[None, None], homography)[0, 0]
        if (place > 2).all() and (place < np.array(gray.shape[::-1]) - 3).all():
            ids.append(corner)
            pixels.append(place)
            homographies.append(homography)
    if len(ids) < LEAST_CORNERS:
        return None
    return np.array(ids), np.array(pixels), np.array(homographies)


def _consistent(index, seen, known):
    """Drop markers that do not lie where the others say."""
    side = np.linalg.norm(np.roll(seen, -1, axis=1) - seen, axis=2).mean()
    homography, inliers = cv2.findHomography(
        known.reshape(-1, 2), seen.reshape(-1, 2), cv2.RANSAC, OUTLIER_SHARE * side)
    if homography is None:
        return index[:0], seen[:0], known[:0]
    good = inliers.reshape(-1, 4).all(axis=1)
    return index[good], seen[good], known[good]


def slopes(homographies, points):
    """Return the derivatives of the pixels at points (n, 2) of boards, float64 (n, 2, 2), px/m."""
    mapped = np.einsum('nij,nj->ni', homographies, np.column_stack([points, np.ones(len(points))]))
    place = mapped[:, :2] / mapped[:, 2:]
    return (homographies[:, :2, :2] - place[:, :, None] * homographies[:, 2:, :2]) / (
        mapped[:, 2, None, None])

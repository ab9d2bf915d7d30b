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
"""From shots of a board to a calibrated pair: checked, adjusted, judged, written."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .adjustment import adjust
from .evidence import agreement_of_halves, choose_lens
from .guidance import grid_of
from .moves import check_moved
from .shots import check_sizes, without_blurred
from .suspicions import check_shots, explain
from .views import SIDES
from ..core.cameras.lenses import LENSES
from ..errors import CalibrationError
from ..files.atomic import write_text, written_whole

AUTOMATIC = 'automatic'
"""Lens model by evidence."""
MODELS = AUTOMATIC, *LENSES
MOST_RMS = 1.0        # px of the residuals; chosen: what is beyond is no calibration
MANY = 0.25           # of the views: so many that are dropped want an explanation
BASELINE_OFF = 0.02   # of the baseline; chosen: a ruler is better, a wrong square is worse
FEW = 9               # views: fewer do not choose a lens model
CALIBRATION = 'left.yaml', 'right.yaml', 'stereo_covariance.yaml'
REPORT = 'report.html'


@dataclass(frozen=True, eq=False)
class Geometry:
    """A calibrated pair, with everything that a report tells of it."""

    board: object
    """Board."""
    size: tuple
    """(width, height) of the images, px."""
    shots: tuple
    """All Shot, also those that were not used."""
    adjustment: object
    """Adjustment."""
    lens: object
    """LensChoice, or None where the lens model was given."""
    agreement: object
    """Agreement of halves, or None where the views are too few."""
    distance: float
    """Working distance, m."""

    @property
    def calibration(self):
        """Return the StereoCalibration."""
        return self.adjustment.calibration

    @property
    def covariance(self):
        """Return its StereoCovariance."""
        return self.adjustment.covariance

    @property
    def dropped(self):
        """Return the names of the views that were not used and why, a dict."""
        told = {shot.name: shot.problem for shot in self.shots if shot.problem is not None}
        return told | self.adjustment.dropped

    def depth_std(self, distance=None):
        """Return the standard deviation of the depth, m, root mean square over the image."""
        return _rms(self.covariance.depth_std(
            self.calibration, *grid_of(self.calibration, distance or self.distance)))

    def rows_std(self, distance=None):
        """Return the standard deviation of the rows, px, root mean square over the image."""
        return _rms(self.covariance.rows_std(
            self.calibration, *grid_of(self.calibration, distance or self.distance)))

    def view_rms(self):
        """Return the root mean square residual of each used view, float64 (V,), px."""
        adjustment, found = self.adjustment, []
        for index in range(len(adjustment.views)):
            parts = [adjustment.residuals[side][adjustment.corners[side].of_view(index)]
                     for side in SIDES]
            found.append(_rms(np.concatenate(parts)))
        return np.array(found)

    def rows(self):
        """
        Return where corners lie in the rectified left image, and their row errors.

        Returns
        -------
        places : numpy.ndarray, float64, shape (n, 2)
            px.
        errors : numpy.ndarray, float64, shape (n,)
            y_left - y_right, px.

        """
        corners = self.adjustment.corners
        keys = {side: corners[side].view * len(self.board.corners) + corners[side].ids
                for side in SIDES}
        _, left, right = np.intersect1d(keys['left'], keys['right'], return_indices=True)
        kept = self.adjustment.kept['left'][left] & self.adjustment.kept['right'][right]
        places = [rectified(getattr(self.calibration, side), corners[side].pixels[chosen[kept]])
                  for side, chosen in zip(SIDES, (left, right))]
        return places[0], places[0][:, 1] - places[1][:, 1]

    def summary(self):
        """Return what people want to know first, as lines of text."""
        adjustment, geometry = self.adjustment, self.calibration.geometry
        std = dict(zip(adjustment.parameters.names, self.covariance.std))
        values = dict(zip(adjustment.parameters.names, adjustment.parameters.vector))
        focal = ', '.join(f'{side} {values[f"{side}.fx"]:.3f} +- {std[f"{side}.fx"]:.3f} px'
                          for side in SIDES)
        lines = [
            f'Views: {len(adjustment.views)} used, {len(self.dropped)} not; residual '
            f'{adjustment.rms:.3f} px rms',
            f'Lens model: {adjustment.parameters.distortion_model}'
            + ('' if self.lens is None else f' ({self.lens.reason})'),
            f'Focal lengths: {focal}',
            f'Baseline: {1e3 * geometry.baseline:.3f} +- {1e3 * self.baseline_std:.3f} mm',
            f'Rows: {self.rows_std():.4f} px; depth: {1e3 * self.depth_std():.4f} mm at '
            f'{1e3 * self.distance:.0f} mm (1 sigma, by the calibration alone)']
        if self.agreement is not None:
            told = self.agreement
            lines.append(f'Halves of the views differ by {1e3 * told.depth:.4f} mm and '
                         f'{told.rows:.4f} px, {told.ratio:.2f} times what is expected')
        return lines + [f'Not used: {name}: {reason}' for name, reason in self.dropped.items()]

    @property
    def baseline_std(self):
        """Return the standard deviation of the baseline, m."""
        direction = self.adjustment.parameters.translation
        direction = direction / np.linalg.norm(direction)
        return float(np.sqrt(direction @ self.covariance.matrix[-3:, -3:] @ direction))

    def write(self, folder, report=None):
        """
        Write the two camera_infos, the covariance and the report; all of them or none.

        Parameters
        ----------
        folder : path-like
            Made if it is not there; files of these names are replaced.
        report : str or None
            HTML.

        Raises
        ------
        OSError
            If a file cannot be written.

        """
        left, right, covariance = (Path(folder) / name for name in CALIBRATION)
        covariance_text = self.covariance.text()
        with written_whole(left) as first, written_whole(right) as second, \
                written_whole(covariance) as third:
            self.calibration.to_yaml(first, second)
            third.write_text(covariance_text, encoding='utf-8')
            if report is not None:
                write_text(Path(folder) / REPORT, report)


def _rms(values):
    return float(np.sqrt(np.nanmean(np.square(values))))


def rectified(camera, pixels):
    """
    Return raw pixels of a CameraModel in its rectified image.

    Parameters
    ----------
    camera : CameraModel
        One camera of the pair.
    pixels : numpy.ndarray, float64, shape (n, 2)
        Column and row in the raw image.

    Returns
    -------
    pixels : numpy.ndarray, float64, shape (n, 2)

    """
    rays = LENSES[camera.distortion_model].undistort(pixels, camera.K, camera.D)
    points = np.column_stack([rays, np.ones(len(rays))]) @ (camera.P[:, :3] @ camera.R).T
    return points[:, :2] / points[:, 2:]


def calibrate(board, shots, *, model=AUTOMATIC, distance=None, baseline=None, reopened=None):
    """
    Calibrate a pair from shots of a board.

    Parameters
    ----------
    board : Board
        The calibration board.
    shots : list of Shot
        In the order in which they were taken.
    model : str
        One of `MODELS`.
    distance : float or None
        Working distance, m; None = the median distance of the board.
    baseline : float or None
        m, as measured by a ruler, to check the size of the squares.
    reopened : callable or None
        Returns both gray images of a shot by its place in the list; helps to find reasons.

    Returns
    -------
    geometry : Geometry

    Raises
    ------
    CalibrationError
        If the shots are no calibration; says why as far as that can be found out.

    """
    size = check_sizes(shots)
    shots = without_blurred(shots)
    places = [place for place, shot in enumerate(shots)
              if shot.problem is None or not any(shot.detections)]
    sharp = [shots[place] for place in places]
    reopened_sharp = reopened and (lambda place: reopened(places[place]))
    check_shots(board, sharp, size, reopened_sharp)
    try:
        adjustment, lens = _adjusted(board, sharp, size, model)
    except CalibrationError:
        explain(board, sharp, size, reopened_sharp)
        raise
    if len(adjustment.dropped) > MANY * len(adjustment.views):
        explain(board, sharp, size, reopened_sharp)
    check_moved(board, [shot.view for shot in sharp if any(shot.detections)], adjustment)
    _check_residual(adjustment)
    check_baseline(board, adjustment.calibration, baseline)
    distance = distance or float(np.median(
        (adjustment.rotations @ board.corners.mean(axis=0) + adjustment.translations)[:, 2]))
    return Geometry(board, size, tuple(shots), adjustment, lens,
                    _agreement(board, adjustment, size, distance), distance)


def _adjusted(board, shots, size, model):
    """Return Adjustment and LensChoice."""
    views = [shot.view for shot in shots if any(shot.detections)]
    if model != AUTOMATIC:
        return adjust(size, board.corners, views, model), None
    first = adjust(size, board.corners, views)
    if len(first.views) < FEW:
        return first, None
    lens = choose_lens(size, board.corners, list(first.views))
    if lens.model == first.parameters.distortion_model:
        return first, lens
    return adjust(size, board.corners, views, lens.model), lens


def _agreement(board, adjustment, size, distance):
    """Return the Agreement of halves, or None where a half is no calibration by itself."""
    try:
        return agreement_of_halves(size, board.corners, list(adjustment.views),
                                   adjustment.parameters.distortion_model, distance)
    except CalibrationError:
        return None


def _check_residual(adjustment):
    if adjustment.rms > MOST_RMS:
        raise CalibrationError(
            f'the corners fit to {adjustment.rms:.2f} px rms only, expected less than {MOST_RMS} '
            'px: compare the numbers of the board with the options; is the board flat, are the '
            'images those of the cameras, not scaled ones?')


def check_baseline(board, calibration, baseline):
    """
    Refuse a baseline that is not the one that a ruler shows: the squares have another size.

    Parameters
    ----------
    board : Board
        The calibration board.
    calibration : StereoCalibration
        Of the two cameras.
    baseline : float or None
        m; None = not measured.

    Raises
    ------
    CalibrationError
        Names the size that the squares should have.

    """
    found = calibration.geometry.baseline
    if baseline is None or abs(found / baseline - 1) <= BASELINE_OFF:
        return
    square = 1e3 * board.square_m
    raise CalibrationError(
        f'baseline {found:.3f} m, you said {baseline:.3f}: is the square '
        f'{square * baseline / found:.1f} mm? {square:g} mm was given; measure ten squares in a '
        'row')

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
"""The health of the calibration as a message, and the numbers of the drift from such a message."""

import numpy as np

from .contents import DiagnosticArray, DiagnosticStatus, KeyValue
from ..core.cameras.covariance import check_hashes, hashes_of
from ..core.cameras.parameters import SIDES
from ..core.health.drift import corrected, COUNT, NAMES, SHOWN, UNITS
from ..core.health.posterior import KnownDrift
from ..errors import CalibrationError
from ..files.yaml import load_yaml, UnreadableError

TOPIC = 'calibration_health'
VALUE, SPREAD = '{} ({})', '{}, standard deviation ({})'
HASH = '{} calibration'
KNOCKED = 'knocked'
BEFORE = '{}, standard deviation as calibrated ({})'
CORRELATIONS = 'correlations of {}'
DIGITS = 9  # of a correlation: a line of them stays below the 128 characters that echo prints
OK, WARN, STALE = 0, 1, 3
UNKNOWN = 'the drift of the calibration is not measured: matching.row_alignment is off, or '\
          'matching.method does not measure the rows'


def health_values(health):
    """
    Return what is known of a calibration, for people and for programs.

    Parameters
    ----------
    health : Health
        What is known of the drift.

    Returns
    -------
    values : dict
        Names with their units to bool, int or float.

    """
    values = {'pairs': health.pairs, 'rows observable': health.observable,
              'drifted': health.drifted, 'corrected': health.is_applied}
    if not health.pairs:
        return values
    values |= {'rows (px)': health.rows, 'rows, standard deviation (px)': health.rows_std,
               'depth (mm)': 1e3 * health.depth,
               'depth, standard deviation (mm)': 1e3 * health.depth_std,
               'working distance (m)': health.distance}
    known = health.known
    for index, (name, (value, spread, unit)) in enumerate(health.numbers().items()):
        values[VALUE.format(name, unit)] = value
        values[SPREAD.format(name, unit)] = spread
        values[f'{name} observable'] = bool(known[index])
    return values


def health_message(health, name, header, calibration=None, suggested=None):
    """
    Return a Health as a message.

    Parameters
    ----------
    health : Health or None
        None: it is not measured.
    name : str
        Of the status.
    header : Header
        Stamp and frame of the message.
    calibration : StereoCalibration, optional
        That the drift refers to; its hash is told.
    suggested : StereoCalibration, optional
        What would fit now; its right K and R are told.

    Returns
    -------
    content : DiagnosticArray
        One status. Numbers are written with all their digits.

    """
    if health is None:
        return DiagnosticArray(header, (DiagnosticStatus(STALE, name, UNKNOWN, '', ()),))
    values = health_values(health) | _for_programs(health)
    if calibration is not None:
        values |= {HASH.format(side): value for side, value in hashes_of(calibration).items()}
    if suggested is not None:
        for side, field in (('left', 'R'), ('right', 'K'), ('right', 'R')):
            matrix = getattr(getattr(suggested, side), field)
            values[f'suggested {side} {field}'] = numbers_of(matrix)
    level = WARN if needs_care(health) else OK
    pairs = tuple(KeyValue(key, value if isinstance(value, str) else repr(value))
                  for key, value in values.items())
    return DiagnosticArray(header, (DiagnosticStatus(level, name, health.sentence(), '', pairs),))


def needs_care(health):
    """Return whether the cameras have drifted, and nothing has been done about it."""
    return health.drifted and not (health.is_applied and health.correctable)


def suggestion(health, calibration, settings):
    """Return the calibration that would fit now, where `health.correct` asks for it, or None."""
    asked = settings.health.correct == 'suggest'
    if not (asked and health is not None and health.drifted and health.correctable):
        return None
    return corrected(calibration, health.drift)


def _for_programs(health):
    """Return what an update of the calibration needs beside `health_values`."""
    if not health.pairs:
        return {}
    values = {KNOCKED: bool(health.knocked)}
    before, correlations = np.sqrt(np.diag(health.prior)) * SHOWN, correlations_of(health)
    for index, (name, unit) in enumerate(zip(NAMES, UNITS)):
        values[BEFORE.format(name, unit)] = float(before[index])
        values[CORRELATIONS.format(name)] = ' '.join(
            f'{each:.{DIGITS}g}' for each in correlations[index, :index + 1])
    return values


def correlations_of(health):
    """Return the correlations of the drift, float64 (6, 6)."""
    return health.covariance / np.outer(health.std, health.std)


def numbers_of(matrix):
    """Return the numbers of a matrix, row by row, as text with all their digits."""
    return ' '.join(repr(float(each)) for each in np.ravel(matrix))


def read_drift(path, calibration):
    """
    Return the drift that a file of the topic `calibration_health` tells.

    Parameters
    ----------
    path : path-like
        What `ros2 topic echo --once calibration_health` prints.
    calibration : StereoCalibration
        In use when the drift was measured.

    Returns
    -------
    known : KnownDrift

    Raises
    ------
    CalibrationError
        If the file cannot be read, tells no drift, or belongs to another calibration; names the
        file.

    """
    try:
        content = load_yaml(path)
    except UnreadableError as error:
        raise CalibrationError(f'health {path} {error}') from error
    try:
        values = {each['key']: each['value'] for each in content['status'][0]['values']}
        hashes = {side: str(values[HASH.format(side)]) for side in SIDES}
        known = _known_drift(values)
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise CalibrationError(
            f'{path}: tells no drift of a calibration, expected a message of the topic '
            f'{TOPIC} that has seen at least one pair') from error
    if not all(np.isfinite(each).all() for each in (known.drift, known.covariance,
                                                    known.prior_std)):
        raise CalibrationError(f'{path}: the drift holds values that are no finite numbers')
    check_hashes(f'{path}: the drift', hashes, calibration)
    return known


def _known_drift(values):
    """Return the KnownDrift of the values of a message, a dict of text; KeyError, ValueError."""
    drift, std, before = (np.array([float(values[key.format(name, unit)])
                                    for name, unit in zip(NAMES, UNITS)]) / SHOWN
                          for key in (VALUE, SPREAD, BEFORE))
    correlations = np.zeros((COUNT, COUNT))
    for index, name in enumerate(NAMES):
        correlations[index, :index + 1] = values[CORRELATIONS.format(name)].split()
    correlations += np.tril(correlations, -1).T
    return KnownDrift(drift, correlations * np.outer(std, std), before,
                      str(values[KNOCKED]) == 'True')

# SPDX-License-Identifier: Apache-2.0
"""The health of the calibration as a message, and the numbers of the drift from such a message."""

import numpy as np

from ..core.health.drift import corrected, COUNT, NAMES, SHOWN, UNITS
from ..errors import CalibrationError
from ..files.yaml import load_yaml, UnreadableError
from .contents import DiagnosticArray, DiagnosticStatus, KeyValue

TOPIC = 'calibration_health'
OK, WARN, STALE = 0, 1, 3
UNKNOWN = 'the drift of the calibration is not measured: matching.row_alignment is off, or '\
          'matching.method does not measure the rows'


def health_values(health):
    """
    Return what is known of a calibration, for people and for programs.

    Parameters
    ----------
    health : Health

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
        values[f'{name} ({unit})'] = value
        values[f'{name}, standard deviation ({unit})'] = spread
        values[f'{name} observable'] = bool(known[index])
    return values


def health_message(health, name, header, suggested=None):
    """
    Return a Health as a message.

    Parameters
    ----------
    health : Health or None
        None: it is not measured.
    name : str
        Of the status.
    header : Header
    suggested : StereoCalibration, optional
        What would fit now; its right K and R are told.

    Returns
    -------
    content : DiagnosticArray
        One status. Numbers are written with all their digits.

    """
    if health is None:
        return DiagnosticArray(header, (DiagnosticStatus(STALE, name, UNKNOWN, '', ()),))
    values = health_values(health)
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


def numbers_of(matrix):
    """Return the numbers of a matrix, row by row, as text with all their digits."""
    return ' '.join(repr(float(each)) for each in np.ravel(matrix))


def read_drift(path):
    """
    Return the drift that a file of the topic `calibration_health` tells.

    Parameters
    ----------
    path : path-like
        What `ros2 topic echo --once calibration_health` prints, or a file of `write_health`.

    Returns
    -------
    drift : numpy.ndarray, float64, shape (6,)
        See `core.health.drift`.

    Raises
    ------
    CalibrationError
        If the file cannot be read or tells no drift; names the file.

    """
    try:
        content = load_yaml(path)
    except UnreadableError as error:
        raise CalibrationError(f'health {path} {error}') from error
    try:
        values = {each['key']: each['value'] for each in content['status'][0]['values']}
        drift = np.array([float(values[f'{name} ({unit})'])
                          for name, unit in zip(NAMES, UNITS)]) / SHOWN
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise CalibrationError(
            f'{path}: tells no drift of a calibration, expected a message of the topic '
            f'{TOPIC} that has seen at least one pair') from error
    if drift.shape != (COUNT,) or not np.isfinite(drift).all():
        raise CalibrationError(f'{path}: the drift holds values that are no finite numbers')
    return drift

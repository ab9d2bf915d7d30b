# SPDX-License-Identifier: Apache-2.0
"""The figures as files, and by their names."""

import json

from ..files.atomic import write_text


def figure_of(figures, key):
    """
    Return the number at a dotted key of a record's figures.

    Parameters
    ----------
    figures : dict
        Of `methods.evaluate`.
    key : str
        For example `planes.rms_px`; `mean_mm` is the mean error in mm.

    Returns
    -------
    figure : float or None
        None if the record has no such figure.

    """
    if key == 'mean_mm':
        return None if figures['mean_m'] is None else 1e3 * figures['mean_m']
    for part in key.split('.'):
        figures = None if figures is None else figures.get(part)
    return figures


def write_json(path, records, facts):
    """Write all records and facts as one JSON file; missing figures are null."""
    write_text(path, json.dumps({'facts': facts, 'records': records}, indent=1, default=float))

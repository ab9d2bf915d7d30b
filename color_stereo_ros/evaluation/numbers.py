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

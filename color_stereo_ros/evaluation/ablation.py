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
What each stage of a method is worth: every switchable setting off, one at a time.

The list is derived from settings and constants themselves: every one that names the value that
switches its stage off, and is on by default.

"""

from dataclasses import fields

import numpy as np

from .methods import evaluate, own_settings
from .renders import default_pattern, paper_pattern
from .tuned import switched_off
from ..core import ColorSettings, MatchingSettings

KEYS = ('density', 'mean_percent', 'median_px', 'bad_1', 'false_share', 'milliseconds')


def switches(method):
    """
    Return what can be switched off in a method.

    Parameters
    ----------
    method : str
        'surface', 'paper' or one of `methods.VARIANTS`.

    Returns
    -------
    switches : dict
        Flat name of a setting, or of a constant of the surface method, to its value when off; no
        setting that the variant sets.

    """
    found, given = {}, own_settings(method)
    for group in (ColorSettings, MatchingSettings):
        for spec in fields(group):
            off = spec.metadata['off']
            mine = spec.metadata['method'] in (None, given['matching.method'])
            name = f'{group.prefix}.{spec.name}'
            if mine and off is not None and spec.default != off and name not in given:
                found[name] = off
    return {**found, **switched_off()} if given['matching.method'] == 'surface' else found


def ablation(scenes, method, progress, repeats=3):
    """
    Measure a method whole, and with each of its switches off.

    Parameters
    ----------
    scenes : list of color_stereo_ros.evaluation.datasets.Scene
        Pairs with their truth.
    method : str
        'surface' or 'paper'.
    progress : callable
        Wraps the list of variants for a progress bar.
    repeats : int
        Runs of a fast method; the shortest time counts.

    Returns
    -------
    rows : list of dict
        `off` (flat name, '' for the whole method) and the means of KEYS over the scenes.

    """
    variants = [('', {})] + [(f'{name} = {value}', {name: value})
                             for name, value in switches(method).items()]
    rows = []
    for name, values in progress(variants):
        figures = [evaluate(scene, method, values, repeats)[1] for scene in scenes]
        rows.append({'off': name, **{key: _mean(figures, key) for key in KEYS}})
    return rows


def _mean(figures, key):
    values = [f[key] for f in figures if f[key] is not None]
    return float(np.mean(values)) if values else None


def scenes_for(renders, names, method):
    """Return simulated scenes under the pattern that a method is meant for."""
    pattern = paper_pattern() if method == 'paper' else default_pattern()
    return [renders.pair(name, pattern) for name in names]

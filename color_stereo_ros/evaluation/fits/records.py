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
"""Files of fitted models: what a fit found, from what, and how it differs from what ships."""

from importlib.metadata import version
from pathlib import Path
import subprocess

import numpy as np

from ... import __version__
from ...core.surface.fitted import FittedModel, frozen, KEYS, load_model
from ...files.atomic import write_text
from ...files.yaml import yaml_text

PACKAGES = 'numpy', 'numba', 'opencv-python-headless', 'mitsuba'
CLOSE = 0.01  # fit and shipped value that differ by less are the same but for rounding


def record(model, fitted, command, scenes, left_out=None):
    """
    Return a fit as a model; what was set by hand in the one that ships stays so.

    Parameters
    ----------
    model : str
        For example 'trust'.
    fitted : dict
        Names of parameters to numbers or nested lists.
    command : str
        What made the fit.
    scenes : list of str
        The names of the scenes of the fit.
    left_out : dict, optional
        Scenes to figures of the fit to all others.

    Returns
    -------
    model : FittedModel

    """
    return FittedModel(model=model, command=command, revision=revision(), versions=versions(),
                       scenes=list(scenes), fitted=fitted,
                       overrides=dict(load_model(model).overrides), left_out=left_out or {})


def revision():
    """Return the revision of the source tree, or the version of the package without a tree."""
    try:
        told = subprocess.run(['git', 'describe', '--always', '--dirty', '--exclude=*'],
                              cwd=Path(__file__).parent, capture_output=True, text=True,
                              check=True)
        return told.stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return f'version {__version__}'


def versions():
    """Return the versions of the packages that a fit depends on, without those not installed."""
    found = {}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except ImportError:
            continue
    return found


def write_model(path, model):
    """Write a model as a file that `load_model` reads."""
    content = {key: value for key, value in vars(model).items() if value or key in KEYS}
    text = yaml_text(content)
    # in two parts, so that `reuse lint` does not find a second license in this file
    write_text(path, '# SPDX-License-' 'Identifier: Apache-2.0\n' + text)


def comparison(model):
    """
    Return the lines that say how a fit differs from what ships.

    Parameters
    ----------
    model : FittedModel
        The new fit.

    Returns
    -------
    lines : list of str

    """
    shipped = load_model(model.model)
    lines, different = [], []
    for name, value in model.fitted.items():
        ships = shipped[name]
        lines += [f'{name}', f'  fitted  {value}', f'  ships   {thawed(ships)}']
        if name in shipped.overrides:
            lines.append(f'          set by hand: {shipped.overrides[name]["reason"]}')
        if not same(frozen(value), ships):
            different.append(name)
    if different:
        lines.append(f'The fit differs from what ships: {", ".join(different)}.')
    else:
        lines.append('The fit is what ships.')
    return lines


def same(one, other):
    """Return whether two values agree but for rounding."""
    one, other = np.array(one, float), np.array(other, float)
    return one.shape == other.shape and bool(np.all(np.abs(one - other) <= CLOSE))


def thawed(value):
    """Return nested tuples as lists."""
    return [thawed(each) for each in value] if isinstance(value, tuple) else value

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
Fitted models: files that a command writes and the method reads.

`models/*.yaml` hold what a fit found, with what it was fitted to, and `overrides`: values that
were set by hand instead, each with the reason. What ships is the fit with its overrides.

"""

from dataclasses import dataclass, field
from pathlib import Path

from ..constants import chosen, fitted, recorded
from ...errors import ColorStereoError
from ...files.yaml import load_yaml, UnreadableError

MODELS = Path(__file__).parent / 'models'
FITS = 'python -m color_stereo_ros.evaluation.fits'
NOT_KEPT = 'not recorded'
KEYS = 'model', 'command', 'revision', 'versions', 'scenes', 'fitted', 'overrides'
LEFT_OUT = 'left_out'  # may be missing


@dataclass(frozen=True)
class FittedModel:
    """One fit and what ships of it."""

    model: str
    """Which model it is, for example 'trust'."""
    command: str
    """What made the fit, or NOT_KEPT."""
    revision: str
    """Of the source tree that was fitted."""
    versions: object
    """Names of packages to their versions, or 'not recorded'."""
    scenes: object
    """What it was fitted to: names, or a sentence."""
    fitted: dict
    """Names of parameters to numbers or nested lists of numbers."""
    overrides: dict = field(default_factory=dict)
    """Names of parameters to {'value': ..., 'reason': ...}: set by hand."""
    left_out: dict = field(default_factory=dict)
    """Scenes to figures of a fit to all others; empty: not measured."""

    def __getitem__(self, name):
        """Return the value of a parameter that ships, lists as tuples."""
        override = self.overrides.get(name)
        return frozen(self.fitted[name] if override is None else override['value'])

    def provenance(self, name):
        """
        Return where the shipped value of a parameter comes from.

        'recorded' where the command of the fit was not kept, else 'chosen' where a value was set
        by hand instead of the fitted one, else 'fitted'.

        """
        text, command = self.explained(name), f'{FITS} {self.model}'
        if self.command == NOT_KEPT:
            return recorded(command, text)
        return chosen(text) if name in self.overrides else fitted(command, text)

    def explained(self, name):
        """Return as text where the shipped value of a parameter comes from."""
        scenes = self.scenes if isinstance(self.scenes, str) else ', '.join(self.scenes)
        text = f'Fitted at revision {self.revision} to: {scenes}.'
        if self.command == NOT_KEPT:
            text += ' The values were noted by hand; the command of the fit was not kept.'
        if name in self.overrides:
            text += (f' The fit gave {self.fitted[name]}; set by hand. '
                     f'{self.overrides[name]["reason"]}')
        return text


def load_model(path):
    """
    Return the fitted model of a file.

    Parameters
    ----------
    path : path-like
        Or the name of a model that ships, for example 'trust'.

    Returns
    -------
    model : FittedModel

    Raises
    ------
    ColorStereoError
        If the file cannot be read, or is no fitted model.

    """
    if isinstance(path, str) and '/' not in path and not path.endswith('.yaml'):
        path = MODELS / f'{path}.yaml'
    try:
        content = load_yaml(path)
    except UnreadableError as error:
        raise ColorStereoError(f'{path}: {error}') from error
    problem = problem_of(content)
    if problem:
        raise ColorStereoError(f'{path} is no fitted model: {problem}')
    return FittedModel(**content)


def problem_of(content):
    """Return what is wrong with the content of a file, '' if nothing is."""
    if not isinstance(content, dict):
        return 'it has no names and values'
    missing = [key for key in KEYS if key not in content]
    if missing:
        return f'{missing[0]!r} is missing'
    unknown = [key for key in content if key not in (*KEYS, LEFT_OUT)]
    if unknown:
        return f'{unknown[0]!r} is not one of {", ".join(KEYS)}'
    fit, overrides = content['fitted'], content['overrides']
    if not isinstance(fit, dict) or not fit:
        return "'fitted' has no names and values"
    if not isinstance(overrides, dict):
        return "'overrides' has no names and values"
    for name, override in overrides.items():
        if name not in fit:
            return f'the override {name!r} is no fitted parameter'
        if not isinstance(override, dict) or set(override) != {'value', 'reason'}:
            return f"the override {name!r} needs 'value' and 'reason'"
    values = {**fit, **{name: override['value'] for name, override in overrides.items()}}
    return next((f'{name} = {value!r} is no number and no list of numbers'
                 for name, value in values.items() if not numeric(value)), '')


def numeric(value):
    """Return whether a value is a finite number, or a list of such values that is not empty."""
    if isinstance(value, list):
        return bool(value) and all(numeric(each) for each in value)
    return (isinstance(value, (int, float)) and not isinstance(value, bool)
            and abs(value) < float('inf'))


def frozen(value):
    """Return a number as float, and lists as tuples of them."""
    return tuple(frozen(each) for each in value) if isinstance(value, list) else float(value)

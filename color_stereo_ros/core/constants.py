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
Constants that say what they are: value, unit, reason and provenance.

A method keeps its constants in frozen dataclasses. Every field is declared by `constant`. The
table in docs/tuning.md is made from these fields.

"""

from dataclasses import dataclass, field, fields, is_dataclass, replace

KINDS = 'derived', 'fitted', 'recorded', 'chosen'
ROBUST_STD = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""


@dataclass(frozen=True)
class Provenance:
    """Where a value comes from."""

    kind: str
    """
    One of KINDS.

    'derived' from a formula, 'fitted' by a command, 'recorded' (a fit whose command was not kept;
    its values were noted by hand) or 'chosen' by a person.

    """
    text: str
    """The formula and its source, the data of the fit, or why this value was chosen."""
    command: str = ''
    """What repeats a fit, or fits a recorded value anew; '' where there is none."""
    explained: bool = True
    """Whether it is on record how the value was found."""


@dataclass(frozen=True)
class Entry:
    """One constant with all that is known about it."""

    name: str
    """Flat name, for example `planes.radius`."""
    value: object
    unit: str
    reason: str
    provenance: Provenance
    compiled: bool
    """The value is part of the machine code: a tuning cannot replace it."""
    off: object = None
    """The value that switches a stage off; None: the constant is no switch."""


def derived(how):
    """Return the provenance of a value that follows from a formula or from other values."""
    return Provenance('derived', how)


def fitted(command, data):
    """Return the provenance of a value that a command fits to data."""
    return Provenance('fitted', data, command)


def recorded(command, data):
    """
    Return the provenance of fitted values of which only the values were kept.

    command fits them anew; it is not the one that found them.

    """
    return Provenance('recorded', data, command, explained=False)


def chosen(why):
    """Return the provenance of a value that a person chose, with all that is known of the why."""
    return Provenance('chosen', why)


def unexplained(why):
    """Return the provenance of a chosen value of which nobody noted how it was found."""
    return Provenance('chosen', why, explained=False)


def constant(value, unit, reason, provenance, *, compiled=False, off=None):
    """
    Return the dataclass field of a constant.

    Parameters
    ----------
    value : bool, int, float, str or tuple of them
        The constant.
    unit : str
        '1' for a number without unit.
    reason : str
        What the constant is there for, one short sentence.
    provenance : Provenance
        Where the value comes from.
    compiled : bool
        The kernels contain the value: it cannot be replaced at run time.
    off : bool, int or float, optional
        The value that switches a stage off, for ablations.

    """
    return field(default=value, metadata={'unit': unit, 'reason': reason, 'off': off,
                                          'provenance': provenance, 'compiled': compiled})


class Constants:
    """Base of a group of constants."""

    def __post_init__(self):
        """
        Refuse to replace what is compiled into the kernels.

        Raises
        ------
        ValueError
            If a compiled constant differs from its default.

        """
        for spec in fields(self):
            value = getattr(self, spec.name)
            if spec.metadata.get('compiled') and value != spec.default:
                raise ValueError(f'{spec.name} = {value!r} cannot replace {spec.default!r}: '
                                 'this constant is compiled into the kernels')


def listed(constants, prefix=''):
    """
    Return all constants of a group, and those of the groups in it.

    Parameters
    ----------
    constants : Constants
        Of one stage or method.
    prefix : str
        Put before every name.

    Returns
    -------
    entries : list of Entry

    """
    entries = []
    for spec in fields(constants):
        value = getattr(constants, spec.name)
        if is_dataclass(value):
            entries += listed(value, f'{prefix}{spec.name}.')
        else:
            entries.append(Entry(f'{prefix}{spec.name}', value, **spec.metadata))
    return entries


def replaced(constants, values):
    """
    Return groups of constants with some of them replaced.

    Parameters
    ----------
    constants : Constants
        Made of groups.
    values : dict
        Flat names to values, for example `{'planes.ridge': 0.5}`.

    Returns
    -------
    constants : Constants

    Raises
    ------
    ValueError
        If a name is unknown, or a constant is compiled into the kernels.

    """
    known = {entry.name for entry in listed(constants)}
    unknown = sorted(set(values) - known)
    if unknown:
        raise ValueError(f'unknown constant {unknown[0]!r}')
    groups = {}
    for name, value in values.items():
        group, _, key = name.partition('.')
        groups.setdefault(group, {})[key] = value
    return replace(constants, **{group: replace(getattr(constants, group), **changes)
                                 for group, changes in groups.items()})


@dataclass(frozen=True)
class Change:
    """Another value of a constant under certain conditions, and where it comes from."""

    value: object
    provenance: Provenance


def changed(constants, changes):
    """Return groups of constants with changes (flat name to `Change`); see `replaced`."""
    return replaced(constants, {name: change.value for name, change in changes.items()})

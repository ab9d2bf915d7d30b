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
"""Runs methods under every disturbance; plain data for the table and the page come out."""

from dataclasses import dataclass, field, replace

import numpy as np

from .disturbances import chosen, DISTURBANCES
from .light import MAIN, QUICK
from .shot import moved, Shots
from .. import opencv_matchers
from ..ablation import switches
from ..methods import own_settings
from ..metrics import Truth, words
from ..tuned import stereo_for
from ...core import Settings, SettingsError
from ...core.cameras.rectification import Rectifier

METHODS = ('surface', 'sgbm', '3way')
SEQUENCE = 7
"""Fewest pairs of a disturbance that changes from pair to pair."""

AHEAD = 0.01
"""A method is behind another if its share of right ranges is lower by more than this."""

HONEST = (0.7, 1.4)
"""z68 of an honest standard deviation."""


@dataclass(frozen=True)
class StressPlan:
    """How much is done."""

    scenes: tuple = MAIN
    only: tuple = ()
    """Names and groups of disturbances; empty = all. 'rows=1' is one level of one of them."""
    methods: tuple = METHODS
    pairs: int = 1
    """Pairs of each scene, one after the other, through one ColorStereo."""
    hardest: bool = False
    """Only the `hardest` levels of each disturbance."""
    seed: int = 1
    values: dict = field(default_factory=dict)
    """Flat settings that override those of the scenes and disturbances."""
    variants: dict = field(default_factory=dict)
    """Name in `methods` of a method with other settings or constants: (method, flat values)."""

    @classmethod
    def quick(cls, **values):
        """Return a plan of two scenes and the hardest levels of each disturbance."""
        return cls(**{'scenes': QUICK, 'hardest': True, **values})


@dataclass(frozen=True)
class Case:
    """One disturbance at one level."""

    name: str
    level: float

    @property
    def disturbance(self):
        """Return the entry of the registry."""
        return DISTURBANCES[self.name]

    @property
    def title(self):
        """Return name and level; a disturbance of one step needs no level."""
        alone = len(self.disturbance.levels) == 1 and not self.disturbance.unit
        return self.name if alone else f'{self.name} {self.level:g}'


def cases_of(plan):
    """
    Return the cases of a plan, the undisturbed one first: every curve begins with it.

    Raises
    ------
    SettingsError
        If a level is no number.

    """
    found = [Case('none', 1)]
    asked = [(name, level_of(text)) for name, _, text in (
        each.partition('=') for each in plan.only)]
    for name, entry in chosen([name for name, _ in asked]):
        levels = entry.hardest if plan.hardest else entry.levels
        levels = [level for own, level in asked if own == name and level is not None] or levels
        found += [Case(name, level) for level in levels if name != 'none']
    return found


def level_of(text):
    """Return the level that a text names, None without a text."""
    try:
        return float(text) if text else None
    except ValueError:
        raise SettingsError(f'--only: the level {text!r} is no number') from None


class StressTest:
    """
    Takes the pairs of a plan and measures them.

    Parameters
    ----------
    plan : StressPlan
    scenes : sequence of color_stereo_ros.evaluation.stress.light.LightScene

    """

    def __init__(self, plan, scenes):
        self.plan = plan
        self.shots = [Shots(scene, plan.seed) for scene in scenes]

    def run(self, case):
        """
        Measure one case on every scene.

        Parameters
        ----------
        case : Case
            The disturbance.

        Returns
        -------
        records : list of dict
            `disturbance`, `group`, `level`, `scene`, `method`, `pair` (from 1), `figures` (of
            `metrics.words`).

        """
        return [record for shots in self.shots for record in self._on_scene(case, shots)]

    def _on_scene(self, case, shots):
        entry = case.disturbance
        rig = entry.rig(case.level)
        count = max(self.plan.pairs, SEQUENCE if entry.per_pair else 1)
        matchers = self._matchers(rig, shots.scene, count)
        records = []
        for number in range(1, count + 1):
            pair, truth = self._taken(entry, case.level, rig, shots, number)
            records += [{'disturbance': case.name, 'group': entry.group, 'level': case.level,
                         'scene': shots.scene.name, 'method': method, 'pair': number,
                         'figures': words(match(*pair), truth)}
                        for method, match, last_only in matchers
                        if number == count or not last_only]
        return records

    def _taken(self, entry, level, rig, shots, number):
        """Return the pair of a number and its truth."""
        changes = entry.per_pair(number, level) if entry.per_pair else {}
        if 'rows' in changes:
            rig = moved(rig, rows=changes['rows'])
        pair = shots.pair(rig, number, changes.get('gains', (1.0, 1.0, 1.0)))
        truth = shots.truth(rig.mounting)
        if rig.swap is None:
            return pair, truth
        return rig.swap(*pair, self._other(shots, number)), without(truth)

    def _other(self, shots, number):
        """Return the right view of another scene of this size; without one, the mirrored view."""
        place = self.shots.index(shots)
        for other in (*self.shots[place + 1:], *self.shots[:place], shots):
            if other.scene.depth.shape == shots.scene.depth.shape:
                break
        right = other.pair(DISTURBANCES['none'].rig(1), number)[1]
        return right if other is not shots else np.ascontiguousarray(right[:, ::-1])

    def _matchers(self, rig, scene, count):
        """Return (method, function of a raw pair, whether only the last pair is worth it)."""
        near, far = scene.depth_limits
        settings = Settings().updated({'range.min_depth': near, 'range.max_depth': far,
                                       **rig.settings, **self.plan.values})
        rectifier = Rectifier(scene.calibration)

        def opencv(method):
            return lambda *pair: opencv_matchers.match(method, rectifier.rectify(*pair),
                                                       settings.range)

        def own(name):
            method, values = self.plan.variants.get(name, (name, {}))
            return stereo_for(scene.calibration, settings,
                              {**values, **own_settings(method)}).process

        return [(name, opencv(name), True) if name in opencv_matchers.METHODS else
                (name, own(name), False) for name in self.plan.methods]


def without(truth):
    """Return the truth of a pair in which nothing corresponds: no range is right."""
    nothing = np.zeros(truth.visible.shape, bool)
    return Truth(truth.depth, nothing, np.full(nothing.shape, np.nan), nothing)


def with_switches(plan):
    """
    Return the plan of an ablation.

    Parameters
    ----------
    plan : StressPlan
        What is run.

    Returns
    -------
    plan : StressPlan
        Its first method alone, whole and with each of `ablation.switches` off. A variant has the
        name of its switch as text, such as 'matching.slanted = False'.

    """
    method = plan.methods[0]
    variants = {f'{name} = {off}': (method, {name: off}) for name, off in switches(method).items()}
    return replace(plan, methods=(method, *variants), variants=variants)


def averages(records, method, pair=None):
    """
    Return the means of the figures of one case over its scenes.

    Parameters
    ----------
    records : list of dict
        Of one case.
    method : str
        A matching method, or a matcher of OpenCV.
    pair : int, optional
        Default: the last one.

    Returns
    -------
    figures : dict
        Name to mean, None where no scene has the figure; empty without records.

    """
    own = [record for record in records if record['method'] == method]
    last = max((record['pair'] for record in own), default=0) if pair is None else pair
    figures = [flat(record['figures']) for record in own if record['pair'] == last]
    names = dict.fromkeys(name for each in figures for name in each)
    return {name: mean(each.get(name) for each in figures) for name in names}


def flat(figures):
    """Return figures in which those of bends have names of their own."""
    bends = figures.get('bends') or {}
    return {**{name: value for name, value in figures.items() if name != 'bends'},
            'bends_median_px': bends.get('median_px'), 'bends_z68': bends.get('z68')}


def mean(values):
    """Return the mean of the values that are there, None without any."""
    values = [value for value in values if value is not None]
    return float(np.mean(values)) if values else None


def verdict(cases, by_case, own, rival):
    """
    Count where a method stands.

    Parameters
    ----------
    cases : list of Case
        The disturbances that were tried.
    by_case : dict of Case to list of dict
        The figures of the runs.
    own, rival : str
        Methods.

    Returns
    -------
    counts : dict
        `cases` that have truth; `ahead`, `behind` the rival in the share of right ranges by any
        amount, `far_behind` by more than one point (the names); `untrue`: hi above 1 % (names);
        `dishonest`: z68 outside .7 .. 1.4 (names). None for what the rival does not tell.

    """
    found = {'cases': 0, 'ahead': 0, 'behind': 0, 'far_behind': [], 'untrue': [], 'dishonest': []}
    for case in cases:
        ours, theirs = (averages(by_case[case], method) for method in (own, rival))
        if ours.get('right') is None:
            continue
        found['cases'] += 1
        gap = (theirs.get('right') or 0.0) - ours['right']
        found['ahead'] += gap < 0
        found['behind'] += gap > 0
        if gap > AHEAD:
            found['far_behind'].append(case.title)
        if (ours['hi'] or 0) > 0.01:
            found['untrue'].append(case.title)
        if ours['z68'] is not None and not HONEST[0] <= ours['z68'] <= HONEST[1]:
            found['dishonest'].append(case.title)
    return found

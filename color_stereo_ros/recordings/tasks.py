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
A recording as tasks: runs of consecutive pairs, each of which one process measures alone.

What is carried from pair to pair (rows, projector, drift of the cameras) must not depend on how
many processes work. Therefore the tasks are the same for one process and for a hundred:

- The first task of a calibration begins with nothing known, as a node does that has just started.
- Any other one begins with what the first `SETTLING` pairs of the calibration show. Every process
  measures these pairs once, and finds the same. Then it measures the `WARM_UP` pairs before the
  task, and writes nothing of them.

"""

from dataclasses import dataclass

import numpy as np

from .pairing import FoundPair, Pairing, Places, Taken
from .salvage import is_salvageable
from ..errors import RecordingError
from ..messages.reading import stamp_ns

PAIRS = 64
"""Pairs of a task; chosen: the warm-up costs 5 % then, and a killed process seconds."""
WARM_UP = 3
"""Pairs before a task; chosen by evaluation/carried.py, docs/scale.md shows what it leaves."""
SETTLING = 8
"""Pairs after which a change of what is carried no longer shows; chosen likewise."""

ROW = np.dtype([(f'{side}_{name}', np.int64) for side in ('left', 'right')
                for name in ('time', 'occurrence', 'stamp')]
               + [(name, np.int64) for name in ('recorded', 'time', 'calibration')])
"""A pair of a plan: where its messages lie, see FoundPair; 72 bytes."""


@dataclass(frozen=True, eq=False)
class Plan:
    """The pairs of a recording."""

    rows: np.ndarray
    """ROW (n,), in the order in which the node would measure them."""
    calibrations: tuple
    """StereoCalibration, by the index in the rows."""
    unpaired: int
    """Images that found no partner, or no calibration in time."""
    refusals: object
    """Refusals: messages that could not be decoded."""
    reason: str
    """Why there is no pair; meaningless where there are pairs."""


@dataclass(frozen=True, eq=False)
class Task:
    """Pairs that are measured in their order, all with one calibration."""

    index: int
    rows: np.ndarray
    """ROW (n,)."""
    warm_up: np.ndarray
    """ROW (m,): measured before, not written."""
    settling: np.ndarray
    """ROW (k,): what is known before the warm-up; empty: nothing."""

    @property
    def calibration(self):
        """Return the index of the calibration."""
        return int(self.rows[0]['calibration'])


def plan_of(recording, topics, settings, say, tick=lambda message: None):
    """
    Read a recording once and pair its images as `range_node` would.

    Parameters
    ----------
    recording : Recording
        An open recording.
    topics : StereoTopics
        The topics of images and calibrations.
    settings : RangeNodeSettings
        All parameters of range_node.
    say : callable
        Called with a sentence about a message or calibration that is refused.
    tick : callable
        Called with each RecordedMessage.

    Returns
    -------
    plan : Plan

    """
    pairing, calibrations, rows = Pairing(recording, topics, settings, say), [], []
    for message in recording.messages(topics.names):
        for pair in pairing.take(message):
            if not calibrations or calibrations[-1] is not pair.calibration:
                calibrations.append(pair.calibration)
            rows.append(_row(pair, len(calibrations) - 1))
        tick(message)
    return Plan(np.array(rows, ROW), tuple(calibrations), pairing.unpaired, pairing.refusals,
                pairing.reason())


def readable_plan(recording, topics, settings, say, tick=lambda message: None):
    """
    Return the Plan of a recording, see `plan_of`; of a damaged one, of what can be read.

    Raises
    ------
    RecordingError
        If nothing can be read, or there is no pair.

    """
    try:
        plan = plan_of(recording, topics, settings, say, tick)
    except RecordingError as error:
        if recording.loss is not None or not is_salvageable(recording.path):
            raise
        recording.salvage()
        say(f'{error}; read is what is whole: {recording.loss}')
        plan = plan_of(recording, topics, settings, say, tick)
    if not len(plan.rows):
        raise RecordingError(f'{recording.path}: no pair could be measured: {plan.reason}')
    return plan


def _row(pair, calibration):
    places = [value for taken in (pair.left, pair.right)
              for value in (taken.place.time_ns, taken.place.occurrence, stamp_ns(taken.header))]
    return (*places, pair.recorded, pair.time_ns, calibration)


def pairs_per_task(settings):
    """Return the pairs of a task; None: each pair changes the geometry of the next, so all."""
    return None if settings.health.correct == 'apply' else PAIRS


def tasks_of(rows, pairs=PAIRS):
    """
    Split the pairs of a plan.

    Parameters
    ----------
    rows : numpy.ndarray
        ROW (n,).
    pairs : int or None
        Pairs of a task; None: one task for each calibration.

    Returns
    -------
    tasks : list of Task

    """
    tasks = []
    for calibration in np.unique(rows['calibration']):
        own = rows[rows['calibration'] == calibration]
        for start in range(0, len(own), pairs or len(own)):
            end = start + (pairs or len(own))
            warm_up, settling = own[max(start - WARM_UP, 0):start], own[:SETTLING if start else 0]
            tasks.append(Task(len(tasks), own[start:end], warm_up, settling))
    return tasks


def read_pairs(recording, topics, rows, calibration):
    """
    Yield the pairs of some rows in their order.

    Parameters
    ----------
    recording : Recording
        An open recording.
    topics : StereoTopics
        The topics of images and calibrations.
    rows : numpy.ndarray
        ROW (n,).
    calibration : StereoCalibration
        Of the two cameras.

    Yields
    ------
    pair : FoundPair

    """
    images = {topics.left_image: 'left', topics.right_image: 'right'}
    wanted = {_key(row, side) for row in rows for side in ('left', 'right')}
    times = [rows[f'{side}_time'] for side in ('left', 'right')]
    kept, places, waiting = {}, Places(), list(rows[::-1])
    for message in recording.messages(images, int(np.min(times)), int(np.max(times)) + 1):
        place = places.of(message)
        key = (images[message.topic], place.time_ns, place.occurrence)
        if key in wanted:
            kept[key] = Taken(place, recording.decoded(message))
        while waiting and all(_key(waiting[-1], side) in kept for side in ('left', 'right')):
            row = waiting.pop()
            left, right = (kept.pop(_key(row, side)) for side in ('left', 'right'))
            yield FoundPair(left, right, int(row['left_stamp']), int(row['recorded']),
                            int(row['time']), calibration)


def _key(row, side):
    return side, int(row[f'{side}_time']), int(row[f'{side}_occurrence'])

# SPDX-License-Identifier: Apache-2.0
"""Compare what two trees make of the same combinations: hashes first, arrays where they differ."""

from contextlib import ExitStack
from dataclasses import asdict, dataclass
import json
import math
import shutil

import numpy as np

from .child import Child
from .inputs import pattern_settings

FILLS = 85, 170
"""
What memory holds in the trees before it is written, see `Child`: a result that depends on it
differs, instead of now and then.
"""
NOT_AGAIN = 'the hashes differed, a second run gives equal values: no reproducible result'
MOST_LINES = 8
"""Differences of one combination that are reported one by one."""


@dataclass(frozen=True)
class Difference:
    """One output that differs."""

    combination: int
    """Number in the list, from 1; 0 = a pattern."""
    output: str
    """Pair and array, for example '2 wave/depth'."""
    pixels: int
    """How many pixels (or values, where there is no image) differ."""
    total: int
    """How many pixels the array has."""
    largest: float
    """Largest absolute difference of numbers; NaN where there are none to compare."""
    invalid: int
    """Pixels that are NaN in one tree only."""
    note: str = ''
    """What else there is to say."""

    def __str__(self):
        """Return it as a line for people."""
        if self.note:
            return f'{self.output}: {self.note}'
        text = f'{self.output}: {self.pixels} of {self.total} pixels differ'
        if not math.isnan(self.largest):
            text += f', largest difference {self.largest:.6g}'
        return text + (f', {self.invalid} NaN in one tree only' if self.invalid else '')


@dataclass
class Verdict:
    """What the comparison found."""

    combinations: int = 0
    results: int = 0
    """Pairs that were measured."""
    outputs: int = 0
    """Hashes that were compared."""
    errors: tuple = ()
    """(number, text) of each combination that ended with the same error in both trees."""
    differences: tuple = ()

    def differing(self):
        """Return how many combinations differ, and patterns."""
        return len({each.combination for each in self.differences})


class Comparison:
    """
    Measures combinations with both trees and compares.

    Parameters
    ----------
    trees : (Tree, Tree)
        Revision and working tree.
    inputs : Inputs
    folder : pathlib.Path
        For arrays that differ; must exist.
    report : callable
        Takes a line about a difference.

    """

    def __init__(self, trees, inputs, folder, report):
        """Keep the arguments."""
        self._trees = trees
        self._inputs = inputs
        self._folder = folder
        self._report = report
        self._found = []

    def run(self, numbered, progress):
        """
        Compare combinations.

        Parameters
        ----------
        numbered : list of (int, Combination)
            With the number under which each is reported.
        progress : callable
            Called once for each combination.

        Returns
        -------
        verdict : Verdict

        """
        verdict = Verdict(combinations=len(numbered))
        for threads in sorted({each.threads for _, each in numbered}):
            mine = [each for each in numbered if each[1].threads == threads]
            with ExitStack() as stack:
                pair = [stack.enter_context(Child(tree, threads, fill=fill))
                        for tree, fill in zip(self._trees, FILLS)]
                self.compare_patterns(pair, mine)
                self._run(pair, mine, verdict, progress)
        verdict.differences = tuple(self._found)
        return verdict

    def _run(self, pair, numbered, verdict, progress):
        """Compare with two running processes; make each input while they measure the last."""
        ready = self._inputs.prepare(numbered[0][1])
        for (number, combination), following in zip(numbered, [*numbered[1:], None]):
            request = ready
            for child in pair:
                child.start('measure', **request)
            if following:
                ready = self._inputs.prepare(following[1])
            answers = [child.answer() for child in pair]
            outputs = [answer['outputs'] for answer in answers]
            if outputs[0] != outputs[1]:
                self._explain(pair, request, outputs, number, combination)
            verdict.results += len(request['steps'])
            verdict.outputs += len(outputs[0])
            if answers[0]['error'] and answers[0]['error'] == answers[1]['error']:
                verdict.errors += ((number, answers[0]['error']),)
            self._inputs.forget(request)
            progress()

    def compare_patterns(self, pair, numbered):
        """Make the patterns that are not there yet, with both trees."""
        for _, combination in numbered:
            path = self._inputs.pattern_file(combination)
            settings = pattern_settings(combination)
            if not settings or path.exists():
                continue
            other = self._folder / 'pattern.npy'
            hashes = ask_both(pair, 'pattern', [{'path': str(place)} for place in (path, other)],
                              settings=settings)
            if hashes[0] != hashes[1]:
                self._add([array_difference(0, f'pattern {path.stem}', np.load(path),
                                            np.load(other))])

    def _explain(self, pair, request, outputs, number, combination):
        """Measure again, keep the arrays, and report what differs."""
        names = differing_names(*outputs)
        folders = [self._folder / name for name in ('before', 'after')]
        for folder in folders:
            folder.mkdir()
        ask_both(pair, 'measure', [{'keep': str(folder)} for folder in folders], **request)
        self._report(f'[{number}] {combination}')
        self._add([self._difference(number, name, folders) for name in names])
        for folder in folders:
            shutil.rmtree(folder)

    def _difference(self, number, name, folders):
        """Return the Difference of an output of which both trees have saved a value or none."""
        values = [load_output(folder, name) for folder in folders]
        return output_difference(number, name, *values)

    def _add(self, differences):
        self._found += differences
        for each in differences[:MOST_LINES]:
            self._report(f'    {each}')
        if len(differences) > MOST_LINES:
            self._report(f'    and {len(differences) - MOST_LINES} more outputs')


def ask_both(pair, do, own, **common):
    """Send a request, in part of its own, to both processes; return both answers."""
    for child, values in zip(pair, own):
        child.start(do, **common, **values)
    return [child.answer() for child in pair]


def differing_names(before, after):
    """Return the outputs that are not the same in two dicts of hashes, in their order."""
    return [name for name in {**before, **after} if before.get(name) != after.get(name)]


def load_output(folder, name):
    """Return an output that `gate.worker.Outputs` has saved; None if there is none."""
    place = folder / name.replace('/', '__')
    array, text = (place.with_name(place.name + suffix) for suffix in ('.npy', '.json'))
    if array.exists():
        return np.load(array)
    return json.loads(text.read_text(encoding='utf-8')) if text.exists() else None


def output_difference(number, name, before, after):
    """
    Return the Difference of two values of an output.

    Parameters
    ----------
    number : int
        Of the combination.
    name : str
        Of the output.
    before, after : numpy.ndarray or what JSON can hold
        None = the tree has no such output.

    """
    if isinstance(before, np.ndarray) and isinstance(after, np.ndarray):
        return array_difference(number, name, before, after)
    texts = described(before), described(after)
    note = NOT_AGAIN if texts[0] == texts[1] else '{} before, {} now'.format(*texts)
    return Difference(number, name, 1, 1, math.nan, 0, note)


def described(value):
    """Return an output as a text for people."""
    if isinstance(value, np.ndarray):
        return f'{value.dtype} {value.shape}'
    return 'nothing' if value is None else json.dumps(value)


def array_difference(number, name, before, after):
    """Return the Difference of two arrays; pixels are the first two dimensions."""
    total = int(np.prod(before.shape[:2]))
    if before.shape != after.shape or before.dtype != after.dtype:
        note = f'{described(before)} before, {described(after)} now'
        return Difference(number, name, total, total, math.nan, 0, note)
    differ = pixels_that_differ(before, after)
    note = '' if differ.any() else NOT_AGAIN
    with np.errstate(invalid='ignore'):
        distance = np.abs(before.astype(np.float64) - after.astype(np.float64))
    known = distance[np.isfinite(distance)]
    invalid = np.isnan(before.astype(np.float64)) != np.isnan(after.astype(np.float64))
    invalid = invalid.reshape(*invalid.shape[:2], -1).any(axis=-1)
    return Difference(number, name, int(np.count_nonzero(differ)), total,
                      float(known.max()) if known.size else math.nan,
                      int(np.count_nonzero(invalid)), note)


def pixels_that_differ(before, after):
    """Return where the bytes of two arrays of one shape and type differ, bool (H, W) or (N,)."""
    raw = [np.ascontiguousarray(array).view(np.uint8).reshape(*array.shape[:2], -1)
           for array in (before, after)]
    return (raw[0] != raw[1]).any(axis=-1)


def as_json(verdict):
    """Return a Verdict as what JSON can hold."""
    found = asdict(verdict)
    for each in found['differences']:
        if math.isnan(each['largest']):
            each['largest'] = None
    return found

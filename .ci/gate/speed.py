# SPDX-License-Identifier: Apache-2.0
"""
Compare the speed of two trees.

The processes take turns (A B A' ...), so that what the machine does beside them meets all alike.
The revision runs twice: the ratio of its two processes shows what noise alone makes.

"""

from contextlib import ExitStack
import os
import random
from statistics import median
import time

import numpy as np
from tqdm import tqdm

from . import scenes
from .child import Child

SIZE = 640, 480   # px
SCENE, RIG = 'fence', 'usual'
SHARES = {'surface': (1, 6), 'paper': (4, 2)}
"""Method to: one of how many rounds it takes part in, and pairs per turn."""
CLOCKS = 'time', 'processor time'
UNCOUNTED = 1     # pairs per turn: a process that has waited finds cold caches
CONTENDERS = 'before', 'again', 'after'
"""The revision, the revision once more, the working tree."""
COLD_RUNS, WARM_RUNS = 3, 5


def compare_times(trees, folder, runs, rounds):
    """
    Compare the time of one pair, print what came out, and return the figures.

    Parameters
    ----------
    trees : (Tree, Tree)
        Revision and working tree.
    folder : pathlib.Path
        For the pair.
    runs : int
        Each with new processes: the place of its memory makes a process a little faster or slower.
    rounds : int
        Of each run: each process takes a turn in each.

    Returns
    -------
    figures : dict
        'surface time', 'surface processor time' and so on to what `run_summary` returns.

    """
    request = timed_pair(trees, folder)
    fill_caches(trees, request)
    found = {f'{method} {clock}': [] for method in SHARES for clock in CLOCKS}
    with tqdm(total=runs * rounds, unit='', disable=None, desc='time', smoothing=0) as bar:
        for run in range(runs):
            for name, seconds in take_turns(trees, request, rounds, run, bar.update).items():
                found[name].append(run_figures(seconds))
                bar.write(run_line(name, run + 1, found[name][-1]))
    figures = {name: run_summary(each) for name, each in found.items()}
    for name, each in figures.items():
        print(summary_line(name, each, trees[0].name))
    return figures


def timed_pair(trees, folder):
    """Save the pair whose time is taken; return arguments of `gate.worker.prepare`."""
    width, height = scenes.pattern_size(SIZE)
    pattern, path = folder / 'timed_pattern.npy', folder / 'timed_pair.npy'
    with Child(trees[0], cores()) as child:
        child.ask('pattern', path=str(pattern),
                  settings={'pattern.width': width, 'pattern.height': height})
    np.save(path, scenes.plain(SCENE, SIZE, RIG, np.load(pattern)))
    return {'calibration': scenes.calibration_of(RIG, SIZE), 'rectified': False,
            'path': str(path)}


def fill_caches(trees, request):
    """Let both trees compile before times are taken."""
    for tree in trees:
        with Child(tree, cores()) as child:
            prepare(child, request)


def prepare(child, request):
    """Let a process prepare all methods; the index of each is its place in SHARES."""
    for method in SHARES:
        child.ask('prepare', **request, settings={'matching.method': method})


def take_turns(trees, request, rounds, run, progress):
    """
    Take times in rounds with new processes.

    Returns
    -------
    seconds : dict
        Method and clock to a dict of contender to the least times, s, one a round.

    """
    rng = random.Random(run)
    found = {f'{method} {clock}': {name: [] for name in CONTENDERS}
             for method in SHARES for clock in CLOCKS}
    with ExitStack() as stack:
        children = {}
        for name in rng.sample(CONTENDERS, len(CONTENDERS)):
            tree = trees[name == 'after']
            children[name] = stack.enter_context(Child(tree, cores()))
            prepare(children[name], request)
        for number in range(rounds):
            order = rng.sample(CONTENDERS, len(CONTENDERS))
            for index, (method, (share, times)) in enumerate(SHARES.items()):
                if number % share == 0:
                    for name in order:
                        taken = children[name].ask('take', index=index, times=times,
                                                   uncounted=UNCOUNTED)
                        for clock in CLOCKS:
                            found[f'{method} {clock}'][name].append(taken[clock])
            progress()
    return found


def run_figures(seconds):
    """
    Return the figures of one run.

    Parameters
    ----------
    seconds : dict
        Contender to times, s, one a round.

    Returns
    -------
    figures : dict
        'before', 'after': median times, s; 'ratio': after/before, 'noise': again/before, medians
        over the rounds; 'ratio_spread', 'noise_spread': quartiles of the same.

    """
    ratios = {name: [a / b for a, b in zip(seconds[who], seconds['before'])]
              for name, who in (('ratio', 'after'), ('noise', 'again'))}
    figures = {name: median(seconds[name]) for name in CONTENDERS}
    for name, each in ratios.items():
        figures[name] = median(each)
        figures[f'{name}_spread'] = [float(q) for q in np.quantile(each, (0.25, 0.75))]
    return figures


def run_line(name, run, figures):
    """Return the figures of one run as a line for people."""
    return (f'{name}, run {run}: {1e3 * figures["before"]:.2f} ms -> '
            f'{1e3 * figures["after"]:.2f} ms; this/REV {figures["ratio"]:.4f} '
            '(quartiles {:.3f} .. {:.3f}); REV/REV '.format(*figures['ratio_spread'])
            + f'{figures["noise"]:.4f} '
            '({:.3f} .. {:.3f})'.format(*figures['noise_spread']))


def run_summary(runs):
    """
    Return the figures of all runs.

    Returns
    -------
    figures : dict
        'runs'; 'ratio': median of the runs' after/before; 'band': least and largest of the runs'
        again/before and before/again, since the two are one and the same; 'within': whether the
        ratio lies in the band.

    """
    noise = [each['noise'] for each in runs]
    both = [*noise, *(1 / each for each in noise)]
    ratio, band = median(each['ratio'] for each in runs), (min(both), max(both))
    return {'runs': runs, 'ratio': ratio, 'band': band, 'within': band[0] <= ratio <= band[1]}


def summary_line(name, figures, revision):
    """Return the figures of all runs as a line for people."""
    low, high = figures['band']
    ratio = figures['ratio']
    verdict = 'within the noise' if figures['within'] else (
        'FASTER than noise explains' if ratio < low else 'SLOWER than noise explains')
    return (f'{name}: this/{revision} {ratio:.4f} in {len(figures["runs"])} runs; '
            f'{revision}/{revision} {low:.4f} .. {high:.4f}: {verdict}.')


def compare_starts(trees, folder):
    """
    Compare the start of a process up to its first ColorStereo, print and return the figures.

    Returns
    -------
    figures : dict
        'cold', 'warm' (empty and filled cache of numba) to 'before' and 'after', lists of s from
        the start of the process, and 'ratio' of their medians.

    """
    figures = {}
    with tqdm(total=2 * (COLD_RUNS + WARM_RUNS) + 2, unit='', disable=None, desc='start') as bar:
        figures['cold'] = starts(trees, COLD_RUNS, lambda tree, run: folder / (
            f'cold_{run}_{tree.folder.name}'), bar.update)
        starts(trees, 1, lambda tree, run: tree.cache, bar.update)  # fills the caches
        figures['warm'] = starts(trees, WARM_RUNS, lambda tree, run: tree.cache, bar.update)
    for name, each in figures.items():
        print(f'{name} start: {trees[0].name} {median(each["before"]):.2f} s '
              f'({min(each["before"]):.2f} .. {max(each["before"]):.2f}), this '
              f'{median(each["after"]):.2f} s ({min(each["after"]):.2f} .. '
              f'{max(each["after"]):.2f}); ratio {each["ratio"]:.3f}')
    return figures


def starts(trees, runs, cache_of, progress):
    """Start processes in turn; return 'before', 'after' (lists of s) and 'ratio'."""
    found = {'before': [], 'after': []}
    for run in range(runs):
        turns = list(zip(('before', 'after'), trees))
        for name, tree in turns[::-1] if run % 2 else turns:
            found[name].append(start(tree, cache_of(tree, run)))
            progress()
    return {**found, 'ratio': median(found['after']) / median(found['before'])}


def start(tree, cache):
    """Return how long a new process takes up to its first ColorStereo, s."""
    begin = time.monotonic()
    with Child(tree, cores(), cache) as child:
        child.ask('prepare', calibration=scenes.calibration_of(RIG, SIZE), settings={},
                  rectified=False, path=None)
        return time.monotonic() - begin


def cores():
    """Return how many processor cores this process may use."""
    return len(os.sched_getaffinity(0))

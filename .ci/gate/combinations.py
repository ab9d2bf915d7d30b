# SPDX-License-Identifier: Apache-2.0
"""
Which combinations of scene, pattern, settings, size, rig and threads are measured.

The full product has millions. The list is a covering design: it holds (nearly) every pair of
choices of two different factors at least once. It is the same in every run.

"""

from collections import defaultdict
from dataclasses import dataclass
from itertools import combinations as subsets
import random

PATTERNS = ('hue_field', 'sweep', 'bright_sweep', 'sine', 'walsh', 'lines', 'wave_field',
            'pseudo_noise')
"""Every pattern that the package can make."""
SIZES = ((640, 480), (512, 512), (333, 251), (97, 61), (64, 48), (1281, 300), (320, 240),
         (241, 323), (200, 151), (130, 34), (33, 47), (17, 13))
"""Width and height, px: usual, odd, wide, high and tiny ones."""
THREADS = 1, 2, 3
RIGS = 'usual', 'verged', 'rectified', 'rational', 'fisheye', 'wide', 'parallel'
SEQUENCES = (
    ('plane', 'bright room'),
    ('fence', 'wave'),
    ('strip', 'black', 'ball', 'noise', 'strip'),
    ('bright spot', 'white', 'dark corner'),
    ('slanted', 'slanted swapped', 'noisy', 'slanted'),
    ('unlike cameras', 'unlike cameras dimmed', 'plane', 'plane gray'),
    ('ball', 'ball upside down', 'unlike cameras'),
    ('black', 'slanted', 'noisy'),
    ('noise', 'dark corner', 'wave', 'bright spot'),
)
"""Pairs that one instance measures one after the other; some twice, some are nonsense."""
ROUNDS = 6
"""How often each choice of settings is made."""
RANGE = {'range.min_depth': 0.33, 'range.max_depth': 0.8}
"""The scenes and some room, m."""
SWITCHES = ('matching.slanted', 'matching.foreshortening', 'matching.propagation',
            'matching.color_matching', 'matching.blur_matching', 'matching.occlusion_test',
            'color.equalize')
SURFACE = (
    {}, *({name: False} for name in SWITCHES), dict.fromkeys(SWITCHES, False),
    {'color.dark_level': 0.0}, {'color.dark_level': 8.5}, {'color.saturation_level': 120},
    {'color.min_signal': 20.0, 'color.saturation_level': 256},
    {'color.equalize_cameras': 'shared'}, {'color.equalize_cameras': 'separate'},
    {'matching.min_confidence': 0.0}, {'matching.min_confidence': 0.95},
    {'matching.smoothness': 0.0}, {'matching.smoothness': 4.0, 'matching.texture': 0.0},
    {'matching.texture': 3.0}, {'matching.refinements': 0}, {'matching.refinements': 1},
    {'matching.refinements': 3}, {'matching.refinements': 6, 'matching.min_confidence': 0.3},
    {'matching.min_segment': 0}, {'matching.min_segment': 2000},
    {'matching.row_alignment': 'off'}, {'matching.row_alignment': 'measure'},
    {'matching.third_view': 'off'},
    {'health.correct': 'suggest'}, {'health.correct': 'apply'},
    {'range.min_depth': 0.45, 'range.max_depth': 0.52},
    {'range.min_depth': 0.15, 'range.max_depth': 20.0},
    {'pattern.type': 'unknown'}, {'pattern.cycles': 5}, {'pattern.cycles': 16},
    {'pattern.feature_size': 5.0, 'pattern.seed': 7},
)
"""Settings of the surface method, each other than the default in one or few values."""
PAPER = (
    {}, {'color.zero_weakest': False}, {'color.scale': False}, {'color.equalize': False},
    {'color.equalize_cameras': 'shared'}, {'color.equalize_cameras': 'separate'},
    {'color.smoothing': 0.0}, {'color.smoothing': 2.5}, {'color.dark_level': 4.0},
    {'color.min_signal': 20.0, 'color.saturation_level': 120},
    {'matching.window_width': 5, 'matching.window_height': 3},
    {'matching.window_width': 21, 'matching.window_height': 1},
    {'matching.subpixel': 'weighted'}, {'matching.subpixel': 'none'},
    {'matching.uniqueness_ratio': 0.15}, {'matching.left_right_tolerance': 0.0},
    {'matching.local_limit': 5.5},
    {'matching.local_limit': 3.0, 'matching.subpixel': 'weighted',
     'matching.uniqueness_ratio': 0.05},
    {'range.min_depth': 0.45, 'range.max_depth': 0.52}, {'pattern.type': 'unknown'},
    {'pattern.cycles': 5},
)
"""Settings of the paper method, likewise."""
SETTINGS = (*({'matching.method': 'surface', **changes} for changes in SURFACE),
            *({'matching.method': 'paper', **changes} for changes in PAPER))
FACTORS = {'settings': range(len(SETTINGS)), 'pattern': PATTERNS, 'size': SIZES,
           'sequence': range(len(SEQUENCES)), 'rig': RIGS, 'threads': THREADS}
RARE = (130, 34), (64, 48), (33, 47), (17, 13)
"""Half as often as others: of so small an image many settings change nothing."""
REAL_SCENES = 'flat_350_hue1', 'prism_hue1', 'solids_hue1'
"""Path-traced pairs, folders of test/data/scenes."""
REAL_RANGE = {'range.min_depth': 0.22, 'range.max_depth': 0.62}
REAL_SETTINGS = (
    {'pattern.type': 'hue_field'}, {'pattern.type': 'sweep', 'matching.method': 'paper'},
    {'pattern.type': 'sweep'}, {'pattern.type': 'unknown', 'matching.min_confidence': 0.1},
    {'pattern.type': 'unknown', 'matching.method': 'paper', 'matching.local_limit': 4.0})


@dataclass(frozen=True)
class Combination:
    """One instance of ColorStereo and what it measures."""

    size: tuple
    """Width and height, px; () = that of the real scene."""
    pattern: str
    """What the projector shows; '' = that of the real scene."""
    rig: str
    """A name of `scenes.RIGS`, or a path-traced scene."""
    threads: int
    sequence: tuple
    """Names of pairs, see `inputs`."""
    settings: tuple
    """(flat name, value) of each setting that is not as in `Settings()`."""

    @property
    def method(self):
        """Return 'surface' or 'paper'."""
        return dict(self.settings)['matching.method']

    @property
    def rectified(self):
        """Return whether the pairs are announced as rectified."""
        return self.rig == 'rectified'

    def __str__(self):
        """Return all of it in one line."""
        size = '{} x {}'.format(*self.size) if self.size else 'real'
        usual = {'matching.method': self.method, 'pattern.type': self.pattern,
                 **(RANGE if self.size else REAL_RANGE)}
        changes = ', '.join(f'{name} {value}' for name, value in self.settings
                            if usual.get(name) != value)
        what = [self.method, self.pattern, size, self.rig, f'{self.threads} threads',
                ' + '.join(self.sequence), changes]
        return ' | '.join(part for part in what if part)


def all_combinations():
    """Return the whole list, a tuple of different Combination."""
    rows = covering_rows(FACTORS, 'settings', ROUNDS)
    return (*(synthetic(row) for row in rows), *real_combinations())


def quick_combinations():
    """Return a part of the whole list: most settings, and all choices of the other factors."""
    rows = covering_rows(FACTORS, 'settings', 1)
    thinned = [row for number, row in enumerate(rows) if number % 4 != 3]
    return (*(synthetic(row) for row in thinned), *real_combinations()[::len(REAL_SETTINGS)])


def synthetic(row):
    """Return the Combination of a row, factor to choice."""
    settings = {'pattern.type': row['pattern'], **RANGE, **SETTINGS[row['settings']]}
    return Combination(row['size'], row['pattern'], row['rig'], row['threads'],
                       SEQUENCES[row['sequence']], tuple(settings.items()))


def real_combinations():
    """Return the combinations that measure path-traced pairs."""
    found = []
    for number, scene in enumerate(REAL_SCENES):
        for turn, changes in enumerate(REAL_SETTINGS):
            settings = {'matching.method': 'surface', **REAL_RANGE, **changes}
            others = [each for each in REAL_SCENES if each != scene]
            sequence = (scene, others[turn % 2], scene) if turn % 2 else (scene,)
            found.append(Combination((), '', scene, THREADS[(number + turn) % 3], sequence,
                                     tuple(settings.items())))
    return tuple(found)


def covering_rows(factors, first, rounds):
    """
    Return rows that hold as many pairs of choices as a greedy search reaches.

    Parameters
    ----------
    factors : dict
        Name to choices.
    first : str
        The factor whose choices are gone through, one a row.
    rounds : int
        How often each of them is made.

    Returns
    -------
    rows : list of dict
        Factor to choice, all different.

    """
    rng = random.Random(13)
    counts = defaultdict(int)  # of ((factor, choice), (factor, choice)) and (factor, choice)
    rows = []
    for _ in range(rounds):
        for choice in factors[first]:
            row = {first: choice}
            for factor in rng.sample([name for name in factors if name != first],
                                     len(factors) - 1):
                row[factor] = _best(factor, factors[factor], row, counts, rng)
            rows.append(row)
            for pair in subsets(sorted(row.items(), key=str), 2):
                counts[frozenset(pair)] += 1
            for item in row.items():
                counts[item] += 1
    return rows


def _best(factor, choices, row, counts, rng):
    """Return the choice that makes most pairs that are new; of equal ones a rare one."""
    def merit(choice):
        new = sum(counts[frozenset([(factor, choice), item])] == 0 for item in row.items())
        often = counts[factor, choice] * (2 if choice in RARE else 1)
        return new, -often, rng.random()

    return max(choices, key=merit)

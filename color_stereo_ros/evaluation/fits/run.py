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
"""Run one fit: render, fit, print it beside what ships, write the file."""

from dataclasses import dataclass

from . import certainty, doubts, pairs, period, quality, slow, spread, steps, temper, third, trust
from .records import comparison, record, write_model

FITS = {'trust': trust, 'slow': slow, 'spread': spread, 'period': period,
        'third': third, 'doubts': doubts, 'certainty': certainty, 'steps': steps,
        'temper': temper, 'quality': quality}


@dataclass(frozen=True)
class Options:
    """How a fit is run."""

    cache: str = None
    """Folder that keeps what does not depend on the pattern."""
    seed: int = 1
    """Of the camera noise."""
    quick: bool = False
    """Few scenes and bad pictures: shows that the machinery works, no more."""
    progress: object = list
    """Wraps a sequence for a progress bar."""
    light: str = None
    """Folder of rendered light, see `stress.light`; the scenes are folders in it."""


def run(name, args):
    """
    Run one fit.

    Parameters
    ----------
    name : str
        One of FITS.
    args : argparse.Namespace
        As `arguments.add_arguments` declares them.

    """
    module = FITS[name]
    scenes = args.scenes or scenes_of(module, args.quick)
    options = Options(args.cache, args.seed, args.quick, progress_bar,
                      getattr(args, 'light', None))
    fitted, report, *left_out = module.fit(module.pairs_of(scenes, options), options)
    model = record(name, fitted, command_of(name, args), scenes, *left_out)
    for line in [*comparison(model), *report]:
        print(line)
    if args.output:
        write_model(args.output, model)
        print(args.output)


def scenes_of(module, quick):
    """Return the scenes of a fit."""
    source = pairs if not hasattr(module, 'QUICK_SCENES') else module
    return source.QUICK_SCENES if quick else getattr(module, 'SCENES', pairs.SCENES)


def command_of(name, args):
    """Return the command line that repeats a fit."""
    words = ['python -m color_stereo_ros.evaluation.fits', name, *args.scenes]
    if args.quick:
        words.append('--quick')
    if getattr(args, 'light', None):
        words.append('--light FOLDER')
    return ' '.join([*words, f'--seed {args.seed}'])


def progress_bar(items):
    """Return an iterable with a progress bar on standard error."""
    from tqdm import tqdm
    return tqdm(items, leave=False)

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
"""`color_stereo sample`: pack a pair of images, its truth and its settings into a sample."""

from ..demo.layout import RECORDING, SETTINGS, TRUTH

SUMMARY = 'pack a scene folder into a sample: recording, truth and settings'
NEEDS = '[tools]'

MOST_PAIRS = 10000
LONGEST_PERIOD = 3600.0  # s

START_NS = 1_767_225_600_000_000_000
"""The first stamp, 2026-01-01 00:00 UTC: fixed, so that a sample made again is the same."""


def add_arguments(parser):
    """Declare the arguments."""
    from .arguments import add_settings_arguments
    parser.add_argument('scene', help='folder with left.png right.png left.yaml right.yaml '
                                      'truth.npz')
    parser.add_argument('output', help='folder to fill')
    parser.add_argument('--pairs', type=int, default=3, metavar='N',
                        help='how often the pair is recorded (default 3)')
    parser.add_argument('--period', type=float, default=0.5, metavar='S',
                        help='time between two pairs, s (default 0.5)')
    parser.add_argument('--overwrite', action='store_true', help='replace an earlier sample')
    add_settings_arguments(parser)


def run(args):
    """Write OUTPUT/recording, OUTPUT/truth.npz and OUTPUT/settings.yaml."""
    from pathlib import Path

    from ..core import SettingsError
    from .arguments import given_settings, settings_from
    if not 1 <= args.pairs <= MOST_PAIRS:
        raise SettingsError(f'--pairs = {args.pairs} is outside 1 .. {MOST_PAIRS}')
    if not 0 < args.period <= LONGEST_PERIOD:
        raise SettingsError(f'--period = {args.period} s must be larger than 0 s, at most '
                            f'{LONGEST_PERIOD} s')
    settings_from(args)
    write_sample(Path(args.scene), Path(args.output), given_settings(args), args.pairs,
                 args.period, args.overwrite)
    print(f'{args.output}: {args.pairs} pairs, {_megabytes(args.output):.2f} MB')


def write_sample(scene, output, values, pairs=3, period=0.5, overwrite=False):
    """
    Write a sample.

    Parameters
    ----------
    scene : Path
        Folder with left.png right.png left.yaml right.yaml truth.npz.
    output : Path
        The folder to be written.
    values : dict
        Flat names of settings to values: how this scene is to be measured; they override the
        settings.yaml of the scene.
    pairs : int
        How often the pair is recorded.
    period : float
        s between two pairs.
    overwrite : bool
        Replace what is there.

    """
    import numpy as np

    from ..core import SettingsError
    from ..evaluation.datasets import folder_settings, load_folder
    from ..files.atomic import check_free, write_text, written_whole
    from ..parameters.files import settings_text
    from ..recordings.writing import write_recording
    if output.resolve() == scene.resolve():
        raise SettingsError(f'{output}: is the scene itself; name another folder for the sample')
    if not overwrite:
        for name in (TRUTH, SETTINGS):
            check_free(output / name)
    pair = load_folder(scene, values)
    with write_recording(output / RECORDING, overwrite=overwrite) as writer:
        for index in range(pairs):
            writer.write_pair(START_NS + round(1e9 * index * period), pair.left, pair.right,
                              pair.calibration)
    with written_whole(output / TRUTH) as partial:
        np.savez_compressed(partial, depth=pair.truth.depth,
                            visible=pair.truth.visible)
    write_text(output / SETTINGS, f'# How to measure the scene {scene.name}.\n'
                                  + settings_text(folder_settings(scene) | values, '/**'))


def _megabytes(folder):
    from pathlib import Path
    return sum(path.stat().st_size for path in Path(folder).rglob('*') if path.is_file()) / 1e6

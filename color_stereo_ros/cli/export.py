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
"""`color_stereo export`: a recording of pairs in, files for other programs out."""

SUMMARY = 'measure pairs of a recording and write clouds, images and films for other programs'
NEEDS = '[tools]'


def add_arguments(parser):
    """Declare the arguments."""
    from ..parameters.groups import RangeNodeSettings
    from ..recordings.products import DEFAULT_PRODUCTS, MILLIMETERS, PRODUCTS
    from .arguments import add_settings_arguments
    from .recorded import add_recording_arguments, add_work_arguments
    add_recording_arguments(parser)
    parser.add_argument('folder', help='folder to fill; names of files begin with the stamp of '
                        'their pair in s')
    parser.add_argument('--products', nargs='+', choices=list(PRODUCTS), metavar='WHAT',
                        default=DEFAULT_PRODUCTS, help='what to write (default '
                        f'{" ".join(DEFAULT_PRODUCTS)}), of: ' + '; '.join(
                            f'{name} = {item.description}' for name, item in PRODUCTS.items()))
    parser.add_argument('--frames', default='', metavar='LIST', help='pairs to export: indices '
                        'from 0 and slices as in Python, such as 0,10:20:2 (default: all)')
    parser.add_argument('--depth-scale', type=float, default=MILLIMETERS, metavar='X',
                        help='numbers a meter of the 16-bit depth image: 1000 = mm (default), '
                        '10000 = tenths of a mm up to 6.5 m')
    parser.add_argument('--fps', type=float, metavar='X', help='pictures a second of the film '
                        '(default: as fast as they were recorded)')
    parser.add_argument('--overwrite', action='store_true', help='replace files in FOLDER that '
                        'are not of an earlier run, too')
    add_work_arguments(parser)
    add_settings_arguments(parser, settings=RangeNodeSettings())


def run(args):
    """Export the recording of the command line; return PARTLY if something was refused."""
    from pathlib import Path

    from ..files.atomic import check_folder
    from ..parameters.groups import RangeNodeSettings
    from ..recordings.exporting import Export
    from ..recordings.reading import open_readable
    from .arguments import settings_from
    from .main import warn
    from .progress import Progress
    from .recorded import check_apart, topics_of, workers_of
    settings, wanted = settings_from(args, RangeNodeSettings()), wanted_by(args)
    workers = workers_of(args)
    check_folder(args.folder)
    if Path(args.recording).is_dir():
        check_apart(args.recording, args.folder)
    with open_readable(args.recording, warn) as recording:
        topics = topics_of(args, recording, settings)
        export = Export(recording, args.folder, topics, settings, wanted, workers,
                        args.scheduler)
        with Progress.pairing(recording, topics) as (say, tick):
            export.pair(say, tick)
        with Progress(total=export.pairs, unit='pair') as progress:
            export.measure(progress.say, progress.update)
        loss = recording.loss
    return told(args, export, loss)


def wanted_by(args):
    """Return the Wanted of a command line."""
    from ..core import SettingsError
    from ..recordings.exporting import FASTEST, SLOWEST, Wanted
    if not 0 < args.depth_scale <= 1e6:
        raise SettingsError(f'--depth-scale {args.depth_scale:g}: expected a number above 0, at '
                            'most 1000000')
    if args.fps is not None and not SLOWEST <= args.fps <= FASTEST:
        raise SettingsError(f'--fps {args.fps:g}: expected {SLOWEST:g} .. {FASTEST:g}')
    return Wanted(tuple(args.products), args.frames, args.depth_scale, args.fps, args.overwrite)


def told(args, export, loss):
    """Print how an export went; return PARTLY if something was refused."""
    from .recorded import damaged, warn_of_losses
    plan, tally = export.plan, export.tally
    print(f'{args.folder}: {export.files} files of {tally.measured} pairs, {tally.failed} '
          f'refused; the recording has {len(plan.rows)} pairs'
          f'{damaged(loss)}')
    return warn_of_losses(tally, plan, loss)

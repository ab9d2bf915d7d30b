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
"""`color_stereo calibrate geometry`: views of a board in, camera_infos and a covariance out."""

from contextlib import contextmanager

SUMMARY = 'calibrate two cameras as a pair from views of a board, with a report'
NEEDS = '[tools]; with `--live` [ros]; with `--page` [view]'

NEXT = 'next_pose.png'
"""The picture of the next pose, in the folder of the result."""
MOST_SINGLE = 60
"""Pairs of a recording that are all taken as views; of more, those in which the board is still."""


def add_arguments(parser):
    """Declare the arguments."""
    from ...calibration.geometry import AUTOMATIC, CALIBRATION, MODELS, REPORT
    from ...recordings.topics import OPTIONS
    from ..board_arguments import add_board_arguments
    parser.add_argument('source', nargs='*', help='a folder of image pairs (left_1.png, '
                        'right_1.png ..), two folders (left, then right), or a recording')
    parser.add_argument('--live', action='store_true', help='take the views from live topics '
                        'instead; says which pose of the board helps most next')
    parser.add_argument('--output', default='calibration', metavar='FOLDER',
                        help=f'folder for {", ".join(CALIBRATION)} and {REPORT} (default '
                        'calibration); files of an earlier calibration are replaced, by a good '
                        'one only')
    parser.add_argument('--overwrite', action='store_true', help='replace files of these names '
                        'that are not of an earlier calibration, too')
    parser.add_argument('--baseline-mm', type=float, metavar='X', help='distance of the lenses '
                        'as a ruler shows it, to check the size of the squares')
    parser.add_argument('--distance-mm', type=float, metavar='X', help='working distance for '
                        'which depth errors are told (default: the median distance of the board)')
    parser.add_argument('--model', choices=MODELS, default=AUTOMATIC, metavar='MODEL',
                        help=f'lens model, one of {", ".join(MODELS)}; {AUTOMATIC} takes the one '
                        'that predicts views best that it has not seen (default '
                        f'{AUTOMATIC})')
    add_board_arguments(parser)
    section = parser.add_argument_group('topics, live or of a recording')
    section.add_argument('--namespace', metavar='NAME', help='namespace of the cameras')
    for option, what in zip(OPTIONS[:2], ('left', 'right')):
        section.add_argument(option, metavar='TOPIC', help=f'topic of the images of the {what} '
                             f'camera (default {what}/image_raw)')
    section.add_argument('--compressed', action='store_true', help='the images are JPEG or PNG')
    live = parser.add_argument_group('live')
    live.add_argument('--target-mm', type=float, default=0.05, metavar='X', help='standard '
                      'deviation of the depth at the working distance at which it ends (default '
                      '0.05)')
    live.add_argument('--views', type=int, default=30, metavar='N', help='views after which it '
                      'ends in any case (default 30)')
    live.add_argument('--page', type=int, metavar='PORT', help='show both images with the '
                      'outline of the next pose in a browser, at this port (0 = any free one)')
    live.add_argument('--page-host', default='127.0.0.1', metavar='ADDRESS', help='address '
                      'of the page; 0.0.0.0 lets other machines in (default 127.0.0.1)')
    live.add_argument('--keep', metavar='FOLDER', help='keep the images of the views there')


def run(args):
    """Calibrate with what the command line names."""
    from pathlib import Path

    from ...calibration.geometry import CALIBRATION, REPORT
    from ...files.claim import claimed
    from ..board_arguments import board_from
    check(args)
    board = board_from(args)
    with claimed(Path(args.output), 'calibrate_geometry', [*CALIBRATION, REPORT],
                 overwrite=args.overwrite):
        shots, reopened = live_shots(args, board) if args.live else shots_from(args, board)
        finish(args, board, shots, reopened)


def check(args):
    """Refuse numbers that are no lengths, and too many sources."""
    from ...errors import SettingsError
    if args.live and args.source:
        raise SettingsError(f'--live takes its views from topics; leave out {args.source[0]}')
    if not args.live and not 1 <= len(args.source) <= 2:
        raise SettingsError(f'{len(args.source)} sources, expected a folder, two folders or a '
                            'recording, or --live')
    if args.views < 4:
        raise SettingsError(f'--views = {args.views} is too few, expected at least 4')
    if not args.target_mm > 0:
        raise SettingsError(f'--target-mm = {args.target_mm} mm, expected more than 0')
    for name in ('baseline_mm', 'distance_mm'):
        value = getattr(args, name)
        if value is not None and not 1.0 <= value <= 100_000.0:
            raise SettingsError(f'--{name.replace("_", "-")} = {value} mm is outside 1.0 .. '
                                '100000.0 mm')


def shots_from(args, board):
    """Return the Shots of folders or of a recording, and the function that opens them again."""
    from pathlib import Path

    from ...calibration.pairs import find_pairs
    from ..main import warn
    source = Path(args.source[0])
    if len(args.source) == 1 and (source.is_file() or (source / 'metadata.yaml').exists()):
        return recorded_shots(args, board), None
    found = find_pairs(*args.source)
    if found.alone:
        warn(f'{len(found.alone)} images have no partner: {", ".join(found.alone[:5])}'
             + (' ..' if len(found.alone) > 5 else ''))
    return shots_of(board, found.pairs), lambda place: grays(found.pairs[place])


def grays(pair):
    """Return both images of an ImagePair, gray."""
    from ...calibration.gray import gray_of
    return [gray_of(image) for image in pair.images()]


def shots_of(board, pairs):
    """Return the Shots of some pairs, with a progress bar."""
    from ...calibration.shots import detect_shot
    from ..progress import Progress
    with Progress(pairs, unit='pair') as progress:
        return [detect_shot(board, pair) for pair in progress]


def recorded_shots(args, board):
    """Return the Shots of a recording: all of a short one, else those that stand still."""
    from ...calibration.pairs import ImagePair
    from ...calibration.shots import detect_shot
    from ...calibration.still import StillWatch
    from ...errors import CalibrationError
    from ...recordings.pairs import recorded_pairs
    from ...recordings.reading import Recording
    from ...recordings.topics import image_topics, StereoTopics
    from ..progress import Progress
    with Recording(args.source[0]) as recording:
        left, right = image_topics(recording, args.namespace, StereoTopics(
            args.left_image, args.right_image, None, None), args.compressed)
        count, watch, shots = recording.counts[left], StillWatch(), []
        with Progress(total=count, unit='pair') as progress:
            for pair in recorded_pairs(recording, left, right, progress.say):
                shot = detect_shot(board, ImagePair(f'{pair.stamp / 1e9:.3f} s', pair.left,
                                                    pair.right, pair.skew))
                if count <= MOST_SINGLE or watch.look(shot):
                    shots.append(shot)
                progress.update()
    if not shots:
        raise CalibrationError(f'{args.source[0]}: no view in which the board stands still; hold '
                               'it still for half a second in each pose')
    return shots


def live_shots(args, board):
    """Return the Shots of live cameras, and the function that returns their images again."""
    from ...calibration.capture import Capture
    from ...calibration.geometry import AUTOMATIC
    from ...nodes.live_pairs import live_pairs
    from ..main import warn
    capture = Capture(board, args.target_mm / 1e3, args.views,
                      args.distance_mm and args.distance_mm / 1e3,
                      'plumb_bob' if args.model == AUTOMATIC else args.model)
    with opened_page(args) as page, live_pairs(topics_of(args), args.compressed) as source:
        print(f'Listening to {" and ".join(source.names)}; Ctrl-C ends with the views so far.\n'
              f'Next: {capture.words()}; hold it still for half a second.', flush=True)
        try:
            for pair in source.pairs(warn):
                if look(args, capture, pair, page) and capture.done:
                    break
        except KeyboardInterrupt:
            print()
    return capture.shots, lambda place: capture.images[place]


@contextmanager
def opened_page(args):
    """Yield the LivePage, or None where there is none to show."""
    if args.page is None:
        yield None
        return
    from ...calibration.live_page import LivePage
    page = LivePage(args.page_host, args.page)
    print(f'Open {page.address} in a browser.', flush=True)
    try:
        yield page
    finally:
        page.close()


def topics_of(args):
    """Return the topics of both images that the command line names."""
    prefix = f'/{args.namespace.strip("/")}/' if args.namespace else ''
    ending = '/compressed' if args.compressed else ''
    return [named or f'{prefix}{side}/image_raw{ending}' for side, named in
            (('left', args.left_image), ('right', args.right_image))]


def look(args, capture, pair, page):
    """Show a pair to a Capture; tell and draw what comes next if it has become a view."""
    from pathlib import Path

    from ...calibration.capture import picture
    from ...calibration.pairs import ImagePair
    from ...files.image import write_image
    number = len(capture.shots) + 1
    shot, taken = capture.look(ImagePair(f'view_{number:02d}', pair.left, pair.right, pair.skew))
    shown = picture((pair.left, pair.right), shot, capture.advice)
    if page is not None:
        page.show(shown, f'**{capture.words()}**\n\n{capture.account()}')
    if not taken:
        return False
    if args.keep:
        for side in ('left', 'right'):
            write_image(Path(args.keep) / f'{side}_{number:02d}.png', getattr(pair, side))
    write_image(Path(args.output) / NEXT, shown)
    print(capture.account(), flush=True)
    if not capture.done:
        print(f'Next: {capture.words()} ({args.output}/{NEXT})', flush=True)
    return True


def finish(args, board, shots, reopened):
    """Calibrate, write and tell."""
    from ...calibration.geometry import calibrate, CALIBRATION, REPORT
    from ...calibration.report import report_page
    from ...patience import patience
    with patience('adjusting'):
        geometry = calibrate(
            board, shots, model=args.model, reopened=reopened,
            distance=args.distance_mm and args.distance_mm / 1e3,
            baseline=args.baseline_mm and args.baseline_mm / 1e3)
        geometry.write(args.output, report_page(geometry))
    print('\n'.join(geometry.summary()))
    print(f'Written to {args.output}: {", ".join([*CALIBRATION, REPORT])}')

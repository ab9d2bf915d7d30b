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
"""`color_stereo view`: look at pairs and at what is measured from them, in the browser."""

from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

SUMMARY = 'look at a recording, image files or a live sensor in the browser, pixel by pixel'
NEEDS = '[view]; recordings [tools]; with `--live` [ros]'

CALIBRATION = 'left.yaml', 'right.yaml'
"""Where a folder of images has its calibration."""


def add_arguments(parser):
    """Declare the arguments."""
    from ..parameters.groups import RangeNodeSettings
    from .arguments import add_settings_arguments
    from .recorded import add_topic_arguments
    parser.add_argument('source', nargs='?', help='a recording (rosbag2 folder, .mcap, .db3 or '
                        'ROS 1 bag), or a folder of image pairs (left_1.png, right_1.png ..) '
                        'with its calibration')
    parser.add_argument('--sample', action='store_true', help='look at the pair that comes with '
                        'the package')
    parser.add_argument('--live', action='store_true', help='look at what a running range_node '
                        'publishes; nothing is measured again')
    parser.add_argument('--calibration', nargs=2, metavar=('LEFT', 'RIGHT'),
                        help='the camera_info YAML files of a folder of images (default: '
                        f'{" and ".join(CALIBRATION)} in it)')
    parser.add_argument('--host', default='127.0.0.1', metavar='ADDRESS', help='address of the '
                        'page; 0.0.0.0 lets other machines in (default 127.0.0.1: this machine '
                        'alone)')
    parser.add_argument('--port', type=int, default=8080, metavar='N', help='port of the page; '
                        'the next free one is taken; 0 = any (default 8080)')
    parser.add_argument('--html', metavar='FILE', help='write one HTML file instead, which needs '
                        'no server and no network: the scene and a time bar, without clicks')
    parser.add_argument('--overwrite', action='store_true', help='with --html: replace FILE')
    parser.add_argument('--frames', default='0', metavar='LIST', help='with --html: the pairs '
                        'in it, indices from 0 and slices as in Python, such as 0,10:20:2 '
                        '(default 0)')
    add_topic_arguments(parser)
    add_settings_arguments(parser, settings=RangeNodeSettings())


def run(args):
    """Show what the command line names."""
    check(args)
    import_module('viser')  # before anything is measured
    if args.live:
        watch(args)
        return
    with opened(args) as frames:
        if args.html:
            write_html(Path(args.html), frames, args.frames)
        else:
            serve(args.host, args.port, frames)


def check(args):
    """Refuse a command line that names no source, or two."""
    from ..core import SettingsError
    from ..files.atomic import check_free
    named = [name for name, given in (('a recording or folder', args.source),
                                      ('--sample', args.sample), ('--live', args.live)) if given]
    if len(named) != 1:
        raise SettingsError('name one of a recording or folder, --sample and --live'
                            + (f'; not {" and ".join(named)}' if named else ''))
    if args.live and args.html:
        raise SettingsError('--html needs a recording or image files; record the topics first')
    if args.html and not args.overwrite:
        check_free(Path(args.html))
    if not 0 <= args.port <= 65535:
        raise SettingsError(f'--port = {args.port} is outside 0 .. 65535')


@contextmanager
def opened(args):
    """Yield the MeasuredFrames of a command line."""
    from ..parameters.groups import RangeNodeSettings
    from .arguments import settings_from
    from .process import SAMPLE
    if args.sample:
        args.source, args.config = str(SAMPLE), args.config or str(SAMPLE / 'settings.yaml')
    settings, source = settings_from(args, RangeNodeSettings()), Path(args.source)
    if source.is_dir() and not (source / 'metadata.yaml').exists():
        yield files_of(source, args.calibration, settings)
        return
    from ..recordings.reading import open_readable
    from .main import warn
    from .recorded import topics_of
    with open_readable(source, warn) as recording:
        yield recorded(recording, topics_of(args, recording, settings), settings)


def recorded(recording, topics, settings):
    """Return the frames of a recording; its pairs are found first, with a progress bar."""
    from ..viewer.sources import RecordedFrames
    from .progress import Progress
    with Progress.pairing(recording, topics) as (say, tick):
        return RecordedFrames(recording, topics, settings, say, tick)


def files_of(folder, calibration, settings):
    """Return the frames of a folder of images."""
    from ..core import CalibrationError, StereoCalibration
    from ..viewer.sources import FileFrames
    files = [Path(name) for name in calibration or (folder / name for name in CALIBRATION)]
    if not calibration and not all(file.is_file() for file in files):
        raise CalibrationError(f'{folder}: is no recording, and as a folder of images it lacks '
                               f'{" and ".join(CALIBRATION)}; --calibration LEFT RIGHT names the '
                               'files of the calibration')
    return FileFrames.of_folder(folder, StereoCalibration.from_yaml(*files), settings)


def write_html(path, frames, text):
    """Write the frames that a text names into one file, and tell its size."""
    from ..files.atomic import write_text
    from ..recordings.exporting import chosen_frames
    from ..viewer.mailed import mailed
    from .progress import Progress
    chosen = chosen_frames(text, len(frames))
    with Progress(chosen, unit='pair') as progress:
        made = mailed(map(frames.frame, progress))
    write_text(path, made.text)
    print(f'{path}: {made.megabytes:.1f} MB, {len(chosen)} of {len(frames)} pairs, points as '
          f'{made.precision}' + (f', every {made.step}. pixel of every {made.step}. row'
                                 if made.step > 1 else ''))


def serve(host, port, frames):
    """Serve frames until somebody interrupts."""
    from ..viewer.page import ViewPage
    with served(ViewPage(host, port, frames.frame(0), frames)) as page:
        page.run()


@contextmanager
def served(page):
    """Tell where a page is; Ctrl-C ends the block as it should."""
    try:
        print(f'Open {page.address} in a browser; Ctrl-C ends.', flush=True)
        yield page
    except KeyboardInterrupt:
        print()
    finally:
        page.close()


def watch(args):
    """Serve what a running range_node publishes until somebody interrupts."""
    from ..parameters.groups import RangeNodeSettings
    from ..viewer.live import live_frames
    from ..viewer.page import ViewPage
    from .arguments import settings_from
    from .main import warn
    from .recorded import named_topics
    settings = settings_from(args, RangeNodeSettings())
    with live_frames(args.namespace or '', named_topics(args).names, settings) as source:
        print(f'Waiting for {", ".join(source.names)}; Ctrl-C ends.', flush=True)
        try:
            first = source.first(warn)
        except KeyboardInterrupt:
            print()
            return
        with served(ViewPage(args.host, args.port, first)) as page:
            source.feed(page)

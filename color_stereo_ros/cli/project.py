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
"""`color_stereo project`: the pattern on the display that is the projector."""

SUMMARY = 'show the pattern full-screen, pixel by pixel, from a file or from pattern/image'
NEEDS = '[project]; without FILE and --level [ros]'

PERIOD = 0.05  # s between two looks at file, topic and keyboard


def add_arguments(parser):
    """Declare the arguments."""
    parser.add_argument('file', nargs='?', help='image to show; shown again when it changes. '
                        'Without it the topic pattern/image of pattern_node is followed')
    parser.add_argument('--level', type=int, metavar='N', help='show even gray N, 0 .. 255, as '
                        '`calibrate projector` needs it; no gamma is corrected')
    parser.add_argument('--display', type=int, default=0, metavar='N',
                        help='number of the display (default 0)')
    parser.add_argument('--response', metavar='FILE', help='file of `calibrate projector`: the '
                        'image is linear light and is corrected for the gamma of the projector')
    parser.add_argument('--gamma', type=float, metavar='G',
                        help='gamma of all channels, instead of a file')
    parser.add_argument('--namespace', default='', metavar='NAME',
                        help='namespace of the topic pattern/image')
    parser.add_argument('--seconds', type=float, metavar='S',
                        help='end after so long; default: at Escape, q or Ctrl-C')


def run(args):
    """Show what there is until the end."""
    from contextlib import ExitStack

    from .screen import Screen
    check_arguments(args)
    response = response_of(args)
    with ExitStack() as stack:
        source = stack.enter_context(source_of(args))
        newest = None if args.file is None and args.level is None else source.newest()
        screen = stack.enter_context(Screen(args.display))
        try:
            show_until_the_end(screen, source, newest, response, args.seconds)
        except KeyboardInterrupt:
            pass  # a good end


def show_until_the_end(screen, source, newest, response, seconds=None):
    """
    Show what is newest until nobody wants it.

    Parameters
    ----------
    screen : Screen
        The display that is the projector.
    source : FileSource, LevelSource or PatternListener
        Gives the image to be shown.
    newest : numpy.ndarray or None
        The first image.
    response : ProjectorResponse
        Of the projector: how light depends on the number that is sent.
    seconds : float, optional
        Time until the end.

    """
    import time
    end = float('inf') if seconds is None else time.monotonic() + seconds
    while screen.is_wanted() and time.monotonic() < end:
        if newest is not None:
            screen.show(response.corrected(newest))
            tell(newest, screen.size)
        newest = source.newest(PERIOD)


def tell(image, size):
    """Print what is shown; warn if not all pixels of the display show the image."""
    from .main import warn
    width, height = image.shape[1::-1]
    if (width, height) == (1, 1):
        print(f'showing level {image[0, 0, 0]}', flush=True)
        return
    print(f'showing {width} x {height} px', flush=True)
    if (width, height) != size:
        warn(f'the display has {size[0]} x {size[1]} px; the image is not scaled: '
             f'pattern.width = {size[0]} and pattern.height = {size[1]} fill it')


def check_arguments(args):
    """Raise SettingsError where arguments contradict each other or are out of range."""
    from ..errors import SettingsError
    if args.file is not None and args.level is not None:
        raise SettingsError('FILE and --level exclude each other')
    if args.level is not None and not 0 <= args.level <= 255:
        raise SettingsError(f'--level = {args.level} is outside 0 .. 255')
    if args.response is not None and args.gamma is not None:
        raise SettingsError('--response and --gamma exclude each other')
    if args.level is not None and (args.response or args.gamma) is not None:
        raise SettingsError('--level shows numbers as they are: no --response and no --gamma')
    if args.gamma is not None and not 0.2 <= args.gamma <= 5.0:
        raise SettingsError(f'--gamma = {args.gamma} is outside 0.2 .. 5.0')


def response_of(args):
    """Return the ProjectorResponse of the command line."""
    from ..calibration.projector import ProjectorResponse
    if args.response is not None:
        return ProjectorResponse.read(args.response)
    return ProjectorResponse((args.gamma or 1.0,) * 3)


def source_of(args):
    """Return a context whose value has `newest(seconds)`: an image, or None for nothing new."""
    from contextlib import nullcontext
    if args.level is not None:
        return nullcontext(LevelSource(args.level))
    if args.file is not None:
        return nullcontext(FileSource(args.file))
    from ..nodes.projecting import pattern_listener
    return pattern_listener(args.namespace)


class LevelSource:
    """Even gray of one level."""

    def __init__(self, level):
        """Keep the level."""
        self._level = level

    def newest(self, seconds=0.0):
        """Return one pixel the first time, uint8 (1, 1, 3), which fills the screen; later None."""
        import time

        import numpy as np
        if self._level is None:
            time.sleep(seconds)
            return None
        level, self._level = self._level, None
        return np.full((1, 1, 3), level, np.uint8)


class FileSource:
    """An image file, read again when it has changed."""

    def __init__(self, path):
        """Keep the path."""
        self._path, self._stamp = path, None

    def newest(self, seconds=0.0):
        """
        Return the image if it is new, else None after so many seconds.

        Raises
        ------
        RecordingError, ImageError
            If the file cannot be read the first time; later the old image stays.

        """
        import os
        import time

        from ..errors import ColorStereoError
        from ..files.image import read_image
        time.sleep(seconds)
        try:
            status = os.stat(self._path)
            stamp = status.st_mtime_ns, status.st_size, status.st_ino
        except OSError:
            stamp = None
        if self._stamp is not None and stamp in (None, self._stamp):
            return None
        try:
            image = read_image(self._path)
        except ColorStereoError:
            if self._stamp is None:
                raise
            return None  # half written: it is read again when it has changed
        self._stamp = stamp
        return image

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
"""`color_stereo calibrate color`: the colors of both cameras, from images of a white card."""

SUMMARY = 'measure the colors of both cameras from images of a white card under frames of light'
NEEDS = 'with a recording or `--report` [tools]; with `--live` [ros]'


def add_arguments(parser):
    """Declare the arguments."""
    parser.add_argument('source', nargs='?', help='a folder of images left_NAME.png and '
                        'right_NAME.png of a white card; NAME is a frame of pattern_node: white, '
                        'black, red, green, blue, mask, complement, and perhaps dark with the '
                        'lens covered; NAME_1, NAME_2 ... are averaged; or a recording with '
                        'pattern/info')
    parser.add_argument('--live', action='store_true', help='show the frames by pattern_node and '
                        'take the images from live topics instead')
    parser.add_argument('-o', '--output', default='color_calibration.yaml', metavar='FILE',
                        help='file for color.calibration (default color_calibration.yaml)')
    parser.add_argument('--calibration', nargs=2, metavar=('LEFT', 'RIGHT'),
                        help='camera_info files of the cameras, whose focal lengths are kept, so '
                        'that other cameras are refused; default: left.yaml and right.yaml of '
                        'the folder if they are there')
    parser.add_argument('--report', metavar='FILE', help='write a page with pictures, too: '
                        'response, gain over the image, crosstalk, what it gains (extra [tools])')
    parser.add_argument('--overwrite', action='store_true', help='replace files of these names')
    section = parser.add_argument_group('topics, live or of a recording')
    section.add_argument('--namespace', metavar='NAME', help='namespace of the cameras')
    for side in ('left', 'right'):
        section.add_argument(f'--{side}-image', metavar='TOPIC', help='topic of the images of the '
                             f'{side} camera (default {side}/image_raw)')
    section.add_argument('--compressed', action='store_true', help='the images are JPEG or PNG')
    section.add_argument('--pattern-node', default='/pattern_node', metavar='NAME', help='name of '
                         'the pattern_node with its namespace (default /pattern_node)')
    section.add_argument('--settle', type=float, default=0.5, metavar='S', help='so long after a '
                         'change of the frame images do not count (default 0.5)')


def run(args):
    """Measure, print what was found and what it gains, and write the file."""
    from pathlib import Path

    from ...calibration.color import calibrate_color
    from ...files.atomic import check_free, write_text
    check(args)
    if not args.overwrite:
        for path in filter(None, (args.output, args.report)):
            check_free(path)
    left, right = frames_from(args)
    calibration = read_calibration(Path(args.source or '.'), args.calibration)
    focal = ((), ())
    if calibration is not None:
        focal = tuple((camera.K[0, 0], camera.K[1, 1]) if camera.K[0, 0] > 0 else ()
                      for camera in (calibration.left, calibration.right))
    findings = calibrate_color(left, right, focal)
    if calibration is not None:
        findings.calibration.check(calibration)
    text, page = report(findings), None
    if args.report:
        from ...calibration.color_report import color_page
        page = color_page(findings, text, f'{args.source or "live cameras"}: a white card')
    findings.calibration.write(args.output, replace=args.overwrite)
    if page is not None:
        write_text(args.report, page, replace=args.overwrite)
    print(text)
    print(f'{args.output}: written; use it by color.calibration')


def check(args):
    """Refuse two sources, none, and a time that is none."""
    from ...errors import SettingsError
    if args.live and args.source:
        raise SettingsError(f'--live takes its images from topics; leave out {args.source}')
    if not args.live and not args.source:
        raise SettingsError('name a folder or a recording, or use --live')
    if not 0 <= args.settle <= 60:
        raise SettingsError(f'--settle = {args.settle} s is outside 0 .. 60 s')


def frames_from(args):
    """Return the frames of left and right camera, two dicts of float64 (H, W, 3)."""
    from pathlib import Path

    from ...calibration.frame_files import read_frames
    from ...calibration.frame_stream import FrameStream
    if args.live:
        from ...nodes.live_frames import take_frames
        from .geometry import topics_of
        stream = FrameStream(args.settle)
        take_frames(stream, args.pattern_node, topics_of(args), args.compressed,
                    lambda text: print(text, flush=True))
        return stream.images()
    source = Path(args.source)
    if source.is_file() or (source / 'metadata.yaml').exists():
        return recorded_frames(args, FrameStream(args.settle))
    return tuple(read_frames(source, side) for side in ('left', 'right'))


def recorded_frames(args, stream):
    """Return the frames of a recording, see `frames_from`."""
    from ...recordings.frames import INFO, read_recorded_frames
    from ...recordings.reading import Recording
    from ...recordings.topics import image_topics, StereoTopics
    from ..main import warn
    with Recording(args.source) as recording:
        left, right = image_topics(recording, args.namespace, StereoTopics(
            args.left_image, args.right_image, None, None), args.compressed)
        namespace = args.pattern_node.rpartition('/')[0]
        read_recorded_frames(recording, stream, left, right, f'{namespace}/{INFO}', warn)
    return stream.images()


def read_calibration(folder, paths):
    """Return the StereoCalibration of the files named, or of those in the folder, or None."""
    from ...core import StereoCalibration
    paths = paths or [folder / 'left.yaml', folder / 'right.yaml']
    if not all(path.exists() for path in map(type(folder), paths)):
        return None if paths[0] == folder / 'left.yaml' else StereoCalibration.from_yaml(*paths)
    return StereoCalibration.from_yaml(*paths)


def report(findings):
    """Return what was found, and what it gains, as text of some lines."""
    import numpy as np
    lines = []
    for side in ('left', 'right'):
        camera = getattr(findings.calibration, side)
        found = getattr(findings, side)
        shift = camera.corner_shift()
        mixed = 1 - np.diag(camera.crosstalk)
        lines += [
            f'{side}:',
            f'  dark level     {_triple(camera.dark_level, 1)} DN',
            f'  response       gamma {camera.gamma:.3f}, offset {camera.offset:.3f}; light adds '
            f'up within {100 * found.response.error:.1f} % (as if linear: '
            f'{100 * found.response.linear_error:.1f} %)',
            f'  white          {_triple(100 * camera.white, 1)} % of full scale',
            f'  field          channels differ by up to {100 * (found.uneven - 1):.1f} % over the '
            'image',
            f'  crosstalk      {_triple(100 * mixed, 1)} % of red, green, blue from other light',
            f'  aberration     red {shift[0]:+.2f} px, blue {shift[1]:+.2f} px in the corner',
        ]
        if found.excess.max() > 0.05:
            lines.append(f'  projector      white is {100 * found.excess.max():.0f} % brighter '
                         'than red, green and blue together: switch off its white boost')
    rows = np.round(findings.calibration.right_to_left, 3)
    lines += ['right to left, linear colors:', *(f'  {row[0]:7.3f} {row[1]:7.3f} {row[2]:7.3f}'
                                                 for row in rows)]
    lines += ['difference of the cameras, share of brightness (before, after):']
    lines += [f'  {name:7} {100 * before:6.2f} % {100 * findings.after[name]:6.2f} %'
              for name, before in findings.before.items()]
    return '\n'.join(lines)


def _triple(values, decimals):
    return ', '.join(f'{value:.{decimals}f}' for value in values)

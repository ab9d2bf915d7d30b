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
"""`color_stereo plan`: what a rig will measure, before it is built."""

SUMMARY = 'tell what a rig will measure before it is built, and how to set it up'
NEEDS = 'with `--output` [tools]'

COLUMNS = (('depth m', '{:9.3f}'), ('disparity px', '{:14.1f}'), ('matching mm', '{:13.3f}'),
           ('calibration mm', '{:16.3f}'), ('both mm', '{:9.3f}'), ('both see, m', '{:>15}'))
ROWS = 7


def add_arguments(parser):
    """Declare the arguments."""
    from .board_arguments import add_board_arguments
    rig = parser.add_argument_group('rig')
    rig.add_argument('--baseline', type=float, required=True, metavar='M',
                     help='distance of the cameras, m')
    lens = rig.add_mutually_exclusive_group(required=True)
    lens.add_argument('--focal', type=float, metavar='PX', help='focal length, px')
    lens.add_argument('--fov', type=float, metavar='DEG',
                      help='horizontal field of view, degrees, instead of --focal')
    rig.add_argument('--size', type=int, nargs=2, default=(640, 480), metavar=('WIDTH', 'HEIGHT'),
                     help='of the images, px (default 640 480)')
    rig.add_argument('--near', type=float, required=True, metavar='M', help='nearest depth, m')
    rig.add_argument('--far', type=float, required=True, metavar='M', help='farthest depth, m')
    rig.add_argument('--aim', type=float, default=0.0, metavar='M', help='depth at which the axes '
                     'of the cameras cross, m (default 0: parallel cameras)')
    projector = parser.add_argument_group('projector')
    projector.add_argument('--projector-columns', type=int, default=1280, metavar='PX',
                           help='columns of the projector (default 1280)')
    projector.add_argument('--projector-fov', type=float, default=46.0, metavar='DEG',
                           help='its horizontal field of view, degrees (default 46)')
    measured = parser.add_argument_group('measurement')
    measured.add_argument('--disparity-std', type=float, default=0.05, metavar='PX',
                          help='standard deviation of the disparity, px (default 0.05)')
    measured.add_argument('--views', type=int, default=15, metavar='N',
                          help='guided views of the calibration board (default 15)')
    measured.add_argument('--corner-sigma', type=float, default=0.05, metavar='PX',
                          help='standard deviation of a corner of the board, px (default 0.05)')
    add_board_arguments(parser)
    parser.add_argument('--output', metavar='FILE', help='also plot: a file of the format that '
                        'its suffix says, for example plan.svg')
    parser.add_argument('--overwrite', action='store_true', help='replace a file of that name')


def run(args):
    """Print the plan, and plot it."""
    from ..calibration.guidance import Detectable
    from ..calibration.planning import plan
    from ..files.atomic import check_free
    from .board_arguments import board_from
    check_arguments(args)
    if args.output and not args.overwrite:
        check_free(args.output)
    board = board_from(args)
    found = plan(rig_of(args), board.corners, args.views, args.disparity_std, args.corner_sigma,
                 Detectable(whole=board.kind != 'charuco'))
    print('\n'.join(lines_of(found, args)))
    if args.output:
        from ..calibration.plan_plot import write_plot
        write_plot(found, args.output)
        print(f'{args.output} written')


def check_arguments(args):
    """Refuse values that no rig has."""
    from ..errors import SettingsError
    legal = (('--fov', args.fov, 1, 170, 'degrees'), ('--size', args.size[0], 8, 32766, 'px'),
             ('--size', args.size[1], 8, 32766, 'px'),
             ('--projector-columns', args.projector_columns, 8, 8192, 'px'),
             ('--projector-fov', args.projector_fov, 1, 170, 'degrees'),
             ('--disparity-std', args.disparity_std, 1e-4, 10, 'px'),
             ('--views', args.views, 3, 1000, ''),
             ('--corner-sigma', args.corner_sigma, 1e-4, 10, 'px'))
    for name, value, low, high, unit in legal:
        if value is not None and not low <= value <= high:
            raise SettingsError(f'{name} = {value}, expected {low} .. {high} {unit}'.rstrip())


def rig_of(args):
    """Return the Rig of the command line."""
    import math

    from ..calibration.planning import Rig
    width = args.size[0]
    focal = args.focal if args.fov is None else width / 2 / math.tan(math.radians(args.fov) / 2)
    return Rig(args.baseline, focal, tuple(args.size), args.near, args.far, args.aim)


def lines_of(found, args):
    """Return the plan as lines for people."""
    import numpy as np

    from ..calibration.planning import feature_size, ROWS_LIMIT
    rig, total = found.rig, 1e3 * found.total_std
    axes = (f'turned toward each other by {np.degrees(rig.convergence):.1f} degrees'
            if rig.aim else 'parallel')
    lines = [f'rig: baseline {rig.baseline:g} m, focal length {rig.focal:.0f} px, '
             f'{rig.size[0]} x {rig.size[1]} px, cameras {axes}',
             f'calibration: {found.views} guided views, corners of {args.corner_sigma:g} px; '
             f'rows then agree to {found.rows_std:.3f} px', '',
             'standard deviations of the depth, 1 sigma:',
             ''.join(f'{title:>{len(form.format(0))}}' for title, form in COLUMNS)]
    for index in np.linspace(0, found.depth.size - 1, ROWS).astype(int):
        size = f'{found.common_width[index]:.2f} x {found.common_height[index]:.2f}'
        values = (found.depth[index], found.disparity[index], 1e3 * found.matching_std[index],
                  1e3 * found.calibration_std[index], total[index], size)
        lines.append(''.join(form.format(value) for (_, form), value in zip(COLUMNS, values)))
    low, high = sorted((found.disparity[0], found.disparity[-1]))
    lines += ['', f'disparities {low:.0f} .. {high:.0f} px: {high - low:.0f} columns are searched '
              f'(range.min_depth {rig.near:g}, range.max_depth {rig.far:g})']
    return lines + advice_of(found, feature_size(rig.focal, args.projector_columns,
                                                 args.projector_fov), ROWS_LIMIT)


def advice_of(found, feature, rows_limit):
    """Return which pattern to use, and what to change, as lines."""
    kind = 'hue_field' if found.rows_std < rows_limit else 'sweep'
    lines = [f'pattern: pattern.type {kind}, pattern.feature_size {feature:.1f} on range_node and '
             'pattern_node']
    if kind == 'sweep':
        lines.append(f'rows agree to {found.rows_std:.2f} px only: a pattern in two dimensions '
                     f'needs {rows_limit} px; calibrate with more views')
    if feature < 3:
        lines.append('the projector is too coarse: below 3 of its pixels no structure is sharp; '
                     'take more columns, or a narrower field of view')
    nothing = found.depth[found.common_share <= 0]
    if nothing.size:
        lines.append(f'the cameras see nothing in common at {nothing.min():.3f} .. '
                     f'{nothing.max():.3f} m: turn them toward each other (--aim), or move '
                     'them together')
    return lines

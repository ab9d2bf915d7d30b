# SPDX-License-Identifier: Apache-2.0
"""`color_stereo process`: one pair of image files in, depth and points out, without ROS."""

SUMMARY = 'measure one pair of image files: depth, points and pictures into a folder'


def add_arguments(parser):
    """Declare the arguments."""
    from .arguments import add_settings_arguments
    parser.add_argument('left', help='raw image of the left camera')
    parser.add_argument('right', help='raw image of the right camera')
    parser.add_argument('--calibration', nargs=2, required=True, metavar=('LEFT', 'RIGHT'),
                        help='the camera_info YAML files of both cameras')
    parser.add_argument('--output', default='process_output', metavar='FOLDER',
                        help='folder to fill (default process_output)')
    parser.add_argument('--rectified', action='store_true', help='the images are rectified '
                        'already')
    add_settings_arguments(parser)


def run(args):
    """Measure the pair of the command line."""
    from pathlib import Path

    from ..core import ColorStereo, StereoCalibration
    from ..evaluation.datasets import read_image
    from .arguments import settings_from
    settings = settings_from(args)
    calibration = StereoCalibration.from_yaml(*args.calibration)
    left, right = read_image(args.left), read_image(args.right)
    stereo = ColorStereo(calibration, settings, rectified_input=args.rectified)
    result = stereo.process(left, right)
    output = Path(args.output)
    write_result(output, result, settings.range)
    print(f'{100 * result.density:.1f} % of the pixels have a range. Written to {output}:')
    for path in sorted(output.iterdir()):
        print(f'  {path.name:18}{CONTENT.get(path.name, "")}')


CONTENT = {
    'depth_mm.png': '16 bit, millimeters, 0 = unknown',
    'depth.tiff': '32 bit float, meters, NaN = unknown',
    'depth_std.tiff': '32 bit float, standard deviation of the depth in meters',
    'confidence.png': '8 bit, 255 = 1',
    'status.png': '8 bit, 0 = valid, otherwise the reason (docs)',
    'range_image.png': 'false colors, near = purple, far = orange',
    'points.ply': 'colored points in meters, rectified left camera',
}


def write_result(folder, result, limits):
    """
    Write a result into a folder, the files of `CONTENT`.

    Parameters
    ----------
    folder : Path
    result : RangeResult
    limits : RangeSettings
        Limits of the false colors.

    """
    import numpy as np

    from ..core.false_color import false_color
    from ..nodes.cloud_files import save_cloud
    from ..nodes.messages import millimeters
    from .files import write_image
    images = {
        'depth_mm.png': millimeters(result.depth),
        'depth.tiff': result.depth,
        'depth_std.tiff': result.depth_std,
        'confidence.png': np.rint(255 * result.confidence).astype(np.uint8),
        'status.png': result.status,
        'range_image.png': false_color(result.depth, limits.min_depth, limits.max_depth)}
    for name, image in images.items():
        write_image(folder / name, image)
    save_cloud(folder / 'points.ply', result.points(), result.image)

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
"""`color_stereo render`: what the two cameras of a simulated rig see, and the truth."""

SUMMARY = 'render a scene as the simulated rig sees it, with its truth'
NEEDS = '[sim]; with `--bag` [tools]'

PERIOD_NS = 100_000_000   # between two frames of a sequence in a recording
STEPS = 3                 # of the progress bar per frame: left, right, truth


def add_arguments(parser):
    """Declare the arguments."""
    from .arguments import add_settings_arguments
    parser.add_argument('scene', nargs='?', help='name of a scene (see --list) or a YAML file')
    parser.add_argument('output', nargs='?',
                        help='folder to make: left.png right.png left.yaml right.yaml truth.npz '
                        'pattern.png settings.yaml, one subfolder per frame of a sequence '
                        '(default render_output/SCENE)')
    parser.add_argument('--list', action='store_true', help='list scenes and rigs, render nothing')
    parser.add_argument('--bag', action='store_true',
                        help='make OUTPUT a rosbag2 recording (MCAP) of images, camera_info and '
                        'pattern instead')
    parser.add_argument('--pattern', metavar='FILE', help='image that the projector throws; '
                        'default: the pattern of the settings below')
    parser.add_argument('--rig', metavar='RIG',
                        help="name or YAML file, instead of the scene's own")
    parser.add_argument('--ambient', type=float, metavar='X',
                        help='radiance of the surroundings; a white card in the light of the '
                        'projector has about 2 at 0.35 m')
    parser.add_argument('--direct-only', action='store_true',
                        help='leave out light that bounces between objects')
    parser.add_argument('--seed', type=int, default=0, metavar='N',
                        help='of the camera noise; the same seed gives the same bytes (default 0)')
    parser.add_argument('--samples', type=int, default=4, metavar='N',
                        help='samples per pixel along either axis (default 4: 16 per pixel)')
    parser.add_argument('--cache', metavar='FOLDER', help='keep here what does not depend on the '
                        'pattern, so that the next pattern renders within seconds')
    parser.add_argument('--overwrite', action='store_true', help='replace an earlier result')
    add_settings_arguments(parser, groups=('pattern',))


def run(args):
    """Render the scene, frame by frame."""
    from pathlib import Path

    from ..core import SettingsError
    if args.list:
        print(listing())
        return
    if args.scene is None:
        raise SettingsError('no scene is named: `color_stereo render --list` shows what there is')
    for name, value, low, high in (('samples', args.samples, 1, 16),
                                   ('seed', args.seed, 0, 2**31 - 1)):
        if not low <= value <= high:
            raise SettingsError(f'--{name} = {value} is outside {low} .. {high}')
    scene = _scene(args)
    pattern, values = _pattern(args)
    output = Path(args.output or Path('render_output') / Path(args.scene).stem)
    write = write_bag if args.bag else write_folder
    write(output, _frames(args, scene, pattern), scene, pattern, values, args.overwrite)
    frames = f', {scene.frames} frames' if scene.frames > 1 else ''
    print(f'{output}: {scene.name} on the rig {scene.rig.name}{frames}')


def listing():
    """Return the shipped scenes and rigs as text."""
    from ..sim import load_scene, rig_names, scene_names
    lines = ['scenes:']
    for name in scene_names():
        scene = load_scene(name)
        moving = f' ({scene.frames} frames)' if scene.frames > 1 else ''
        lines.append(f'  {name:26} {scene.rig.name:10} {scene.description}{moving}')
    return '\n'.join([*lines, f'rigs: {", ".join(rig_names())}'])


def _scene(args):
    from ..sim import load_scene
    overrides = {} if args.ambient is None else {'ambient': args.ambient}
    return load_scene(args.scene, rig=args.rig, **overrides)


def _pattern(args):
    """Return the pattern, uint8 (H, W, 3), and the flat settings by which a matcher knows it."""
    from ..core import make_pattern
    from ..files.image import read_image
    from .arguments import given_settings, settings_from
    if args.pattern is None:
        return make_pattern(settings_from(args).pattern), given_settings(args)
    return read_image(args.pattern), {'pattern.type': 'unknown', **given_settings(args)}


def _frames(args, scene, pattern):
    """Yield the Rendering of every frame, with a progress bar."""
    from ..sim import Renderer
    from ..sim.variant import load_mitsuba
    load_mitsuba()  # says what is to be installed, before the progress bar asks for less
    from .progress import Progress
    with Progress(total=STEPS * scene.frames, unit='step', leave=False) as bar:
        for frame in range(scene.frames):
            renderer = Renderer(scene, samples=args.samples, cache=args.cache, frame=frame,
                                indirect=False if args.direct_only else None)
            for camera in (scene.rig.left, scene.rig.right):
                bar.set_description(f'frame {frame + 1}/{scene.frames}, {camera.name}')
                renderer.prepare(camera, pattern)
                bar.update()
            bar.set_description(f'frame {frame + 1}/{scene.frames}, truth')
            yield renderer.render(pattern, seed=args.seed + frame)
            bar.update()


def write_folder(output, renderings, scene, pattern, values, overwrite=False):
    """
    Write renderings as folders that `color_stereo process` and `evaluate` read.

    Parameters
    ----------
    output : Path
        A folder; it appears when all is written.
    renderings : iterable of Rendering
        One: written into OUTPUT. Several: into OUTPUT/0000, OUTPUT/0001 ...
    scene : Scene
        What was rendered.
    pattern : numpy.ndarray, uint8, shape (H, W, 3)
        The image that the projector shows, RGB.
    values : dict
        Flat settings that belong to the pattern.
    overwrite : bool
        Replace what is there.

    Raises
    ------
    RecordingError
        If OUTPUT exists and is not to be replaced, or is no earlier rendering.

    """
    from ..files.atomic import folder_written_whole
    _check_replaceable(output, overwrite)
    with folder_written_whole(output, replace=overwrite) as unfinished:
        for frame, rendering in enumerate(renderings):
            folder = unfinished / f'{frame:04d}' if scene.frames > 1 else unfinished
            folder.mkdir(parents=True)
            _write_rendering(folder, rendering, scene, pattern, values)


def _check_replaceable(output, overwrite):
    from ..core import RecordingError
    if not output.exists():
        return
    if not overwrite:
        raise RecordingError(f'{output}: exists already; --overwrite replaces it')
    if not list(output.glob('truth.npz')) + list(output.glob('0000/truth.npz')):
        raise RecordingError(f'{output}: is no rendering, so it is not overwritten')


def _write_rendering(folder, rendering, scene, pattern, values):
    import numpy as np

    from ..files.image import write_image
    from ..parameters.files import settings_text
    for side in ('left', 'right'):
        camera = getattr(scene.rig, side)
        write_image(folder / f'{side}.png', _full_scale(getattr(rendering, f'{side}_rgb'), camera))
    rendering.calibration.to_yaml(folder / 'left.yaml', folder / 'right.yaml')
    truth = rendering.truth
    np.savez_compressed(
        folder / 'truth.npz', depth=truth.depth, visible=truth.visible, disparity=truth.disparity,
        lit=truth.lit, seen_by_both=truth.seen_by_both, seen_by_left_only=truth.seen_by_left_only,
        clear=truth.clear, edge=truth.edge)
    write_image(folder / 'pattern.png', pattern)
    near, far = scene.rig.depth_limits
    values = {**values, 'range.min_depth': near, 'range.max_depth': far}
    (folder / 'settings.yaml').write_text(settings_text(values), encoding='utf-8')


def _full_scale(image, camera):
    """Shift numbers of 9 to 15 bits up, so that white is white in a 16 bit file."""
    return image << (16 - camera.bits) if camera.bits > 8 else image


def write_bag(output, renderings, scene, pattern, values, overwrite=False):
    """
    Write renderings as a rosbag2 recording; the arguments are those of `write_folder`.

    A recording holds no settings: values are not read.

    """
    from ..recordings.writing import write_recording
    from .sample import START_NS
    with write_recording(output, overwrite=overwrite) as writer:
        writer.write_pattern(START_NS, pattern)
        for frame, rendering in enumerate(renderings):
            left, right = (_eight_bits(getattr(rendering, f'{side}_rgb'), getattr(scene.rig, side))
                           for side in ('left', 'right'))
            writer.write_pair(START_NS + frame * PERIOD_NS, left, right, rendering.calibration)


def _eight_bits(image, camera):
    """Return an image as a recording holds it: uint8 (H, W, 3)."""
    from ..core import ImageError
    if image.ndim != 3:
        raise ImageError(f'{camera.name} demosaicing = {camera.demosaicing!r}: a recording holds '
                         'demosaiced images only')
    return (image >> (camera.bits - 8)).astype('uint8') if camera.bits > 8 else image

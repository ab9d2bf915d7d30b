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
"""
Pairs with truth: folders of left.png, right.png, left.yaml, right.yaml and truth.npz.

A folder may carry a `settings.yaml` with the settings in which its pair was taken, a parameter
file as in `config/*.yaml` or its groups alone (`range: {min_depth: 0.22, max_depth: 0.62}`), and a
`noise.yaml` with the noise of its cameras (`left: {floor: [..], slope: [..], ...}`, `right: ..`).

"""

from dataclasses import asdict, dataclass
import math
from pathlib import Path

import numpy as np
import yaml

from .metrics import Truth
from .noise_limit import CameraNoise
from ..core import ColorStereoError, ImageError, RecordingError, Settings, StereoCalibration
from ..files.atomic import folder_written_whole
from ..files.image import read_image, write_image
from ..files.yaml import load_yaml, UnreadableError
from ..parameters.files import read_settings, settings_text


@dataclass(frozen=True, eq=False)
class Scene:
    """One pair of images, its calibration and its truth."""

    name: str
    left: np.ndarray
    """uint8 (H, W, 3), raw RGB."""
    right: np.ndarray
    """uint8 (H, W, 3), raw RGB."""
    calibration: StereoCalibration
    truth: Truth
    settings: dict
    """Flat settings that belong to the pair; the depth limits are always among them."""
    limits_source: str
    """Where the depth limits come from, for people."""
    noise: tuple = ()
    """Known CameraNoise of left and right; empty = to be measured."""


def load_folder(path, values=None):
    """
    Load a pair with its truth.

    Parameters
    ----------
    path : path-like
        Of the file.
    values : dict, optional
        Flat settings that override those of the folder, for example `{'range.min_depth': 0.3}`.

    Returns
    -------
    scene : Scene
        Its depth limits come from `values`, the folder's settings.yaml, or else from the rig.

    Raises
    ------
    RecordingError
        If a file is missing or cannot be read.
    CalibrationError, ImageError, SettingsError
        If a file has impossible contents.

    """
    path = Path(path)
    calibration = StereoCalibration.from_yaml(path / 'left.yaml', path / 'right.yaml')
    truth = load_truth(path / 'truth.npz')
    settings, source = with_depth_limits({**folder_settings(path), **(values or {})},
                                         calibration, truth)
    Settings().updated(settings)
    return Scene(path.name, read_image(path / 'left.png'), read_image(path / 'right.png'),
                 calibration, truth, settings, source, _folder_noise(path / 'noise.yaml'))


def load_truth(path):
    """
    Read the truth of one pair.

    Parameters
    ----------
    path : path-like
        An .npz file with `depth` (m, along Z of the rectified left camera) and `visible`.

    Returns
    -------
    truth : Truth

    Raises
    ------
    RecordingError
        If the file is missing or has no such arrays.

    """
    try:
        with np.load(path) as arrays:
            depth, visible = arrays['depth'], arrays['visible']
    except OSError as error:
        raise RecordingError(f'{path}: {error.strerror or "damaged"}') from error
    except Exception as error:  # numpy lets nearly anything out of a damaged file
        raise RecordingError(f'{path}: damaged, or no .npz file with depth and visible') from error
    if depth.ndim != 2 or depth.shape != visible.shape:
        raise ImageError(f'{path}: depth {depth.shape} and visible {visible.shape} must be two '
                         'images of one size')
    depth = np.where(depth > 0, depth, np.nan).astype(np.float32)
    return Truth(depth, visible.astype(bool) & np.isfinite(depth))


def folder_settings(path):
    """Return the flat settings of the settings.yaml of a scene folder, {} if there is none."""
    path = Path(path) / 'settings.yaml'
    return read_settings(path) if path.exists() else {}


def _folder_noise(path):
    """Return the CameraNoise of left and right of a noise.yaml, () if there is none."""
    if not path.exists():
        return ()
    try:
        cameras = load_yaml(path)
        return tuple(CameraNoise(**cameras[side]) for side in ('left', 'right'))
    except UnreadableError as error:
        raise RecordingError(f'{path}: {error}') from error
    except (TypeError, KeyError) as error:
        raise RecordingError(f'{path}: does not describe the noise of two cameras, expected '
                             'left and right with floor, slope and the like') from error


def save_folder(scene, path):
    """
    Write a scene in the layout of `load_folder`.

    Parameters
    ----------
    scene : Scene
        A pair with its truth.
    path : path-like
        Folder; appears only when it is complete.

    """
    with folder_written_whole(path) as folder:
        folder.mkdir()
        for side in ('left', 'right'):
            write_image(folder / f'{side}.png', getattr(scene, side))
        scene.calibration.to_yaml(folder / 'left.yaml', folder / 'right.yaml')
        np.savez_compressed(folder / 'truth.npz', depth=scene.truth.depth,
                            visible=scene.truth.visible)
        (folder / 'settings.yaml').write_text(settings_text(scene.settings))
        if scene.noise:
            cameras = {side: _plain(noise)
                       for side, noise in zip(('left', 'right'), scene.noise)}
            (folder / 'noise.yaml').write_text(yaml.safe_dump(cameras))


def _plain(noise):
    return {name: list(value) if isinstance(value, tuple) else value
            for name, value in asdict(noise).items()}


def with_depth_limits(settings, calibration, truth):
    """
    Complete the depth limits of flat settings from the rig.

    Parameters
    ----------
    settings : dict
        Flat names to values.
    calibration : color_stereo_ros.core.StereoCalibration
        Of the two cameras.
    truth : Truth
        The limits are widened until they hold every visible true depth with 5 % to spare.

    Returns
    -------
    settings : dict
    source : str
        Where the limits come from, for people.

    """
    names = ('range.min_depth', 'range.max_depth')
    if all(name in settings for name in names):
        return settings, 'given'
    near, far = depth_limits_of_rig(calibration)
    source = 'from the rig'
    visible = truth.depth[truth.visible]
    if visible.size and (visible.min() < near or visible.max() > far):
        near, far = min(near, 0.95 * visible.min()), max(far, 1.05 * visible.max())
        source = 'from the rig, widened to the truth'
    limits = dict(zip(names, (round(float(near), 3), round(float(far), 3))))
    return {**limits, **settings}, source


def depth_limits_of_rig(calibration):
    """
    Return the depths that a rig was probably built for.

    Parameters
    ----------
    calibration : color_stereo_ros.core.StereoCalibration
        Of the two cameras.

    Returns
    -------
    near, far : float
        m. For converging cameras 0.6 and 1.65 times the distance at which their axes cross, for
        parallel ones the depths whose disparities are 16 % and 7.5 % of the image width.

    """
    geometry = calibration.geometry
    rotation, _ = calibration.right_from_left
    # The left optical axis in the right camera leans to +x where the axes meet in front.
    convergence = math.atan2(rotation[0, 2], rotation[2, 2])
    if convergence > math.radians(2):
        crossing = geometry.baseline / 2 / math.tan(convergence / 2)
        return 0.6 * crossing, 1.65 * crossing
    return (geometry.focal_baseline / (0.16 * geometry.width),
            geometry.focal_baseline / (0.075 * geometry.width))


def find_scenes(paths):
    """
    Return every folder with a truth.npz below some paths, sorted within each of them.

    Parameters
    ----------
    paths : sequence of path-like
        Scene folders or folders of them.

    Returns
    -------
    folders : list of pathlib.Path

    Raises
    ------
    ColorStereoError
        If a path holds no scene.

    """
    folders = []
    for path in map(Path, paths):
        found = sorted(truth.parent for truth in path.rglob('truth.npz'))
        if not found:
            raise ColorStereoError(f'{path} holds no scene: no truth.npz in it or below')
        folders += found
    return folders

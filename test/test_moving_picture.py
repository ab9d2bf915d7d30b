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
"""The moving picture of README is that of its command: what was measured, from several sides."""

import io
from pathlib import Path

from color_stereo_ros.core import ColorStereo, Settings
from color_stereo_ros.core.false_color import false_color
from color_stereo_ros.evaluation import moving_picture
from color_stereo_ros.evaluation.datasets import load_folder

import numpy as np
from PIL import Image
import pytest

ROOT = Path(__file__).resolve().parents[1]
LIMITS = 0.3, 0.4  # m


@pytest.fixture(scope='module')
def measured():
    scene = load_folder(ROOT / 'test/data/scenes/flat_350_hue1',
                        {'range.min_depth': 0.22, 'range.max_depth': 0.62})
    settings = Settings().updated({**scene.settings, 'pattern.type': 'sweep'})
    result = ColorStereo(scene.calibration, settings).process(scene.left, scene.right)
    return (scene.left, scene.right), result


@pytest.fixture(scope='module')
def frames(measured):
    return list(moving_picture.pictures(*measured, LIMITS, count=4))


def test_pair_and_depth_stand_still_while_the_cloud_turns(frames):
    assert len({frame.shape for frame in frames}) == 1
    changed = (frames[0] != frames[1]).any(axis=(0, 2))
    first = np.flatnonzero(changed)[0]
    assert first > frames[0].shape[1] / 2 and changed[first:].mean() > 0.5


def test_seen_from_the_camera_the_cloud_covers_the_known_pixels(measured):
    _, result = measured
    height = result.geometry.height
    drawn = moving_picture.Cloud(result, false_color(result.depth, *LIMITS)).seen(0, 0, height)
    known = np.isfinite(result.depth) & np.isfinite(result.normals()).all(axis=-1)
    assert drawn.shape == (*known.shape, 3)
    assert np.mean(drawn.any(axis=-1) == known) > 0.98


def test_near_points_hide_far_ones():
    picture = moving_picture.splat(
        np.array([4, 4]), np.array([4, 4]), np.array([1.0, 2.0]),
        np.array([[9, 9, 9], [200, 200, 200]]), (9, 9))
    assert set(np.unique(picture)) == {0, 9}


def test_points_outside_of_the_picture_are_left_out():
    far = np.array([-50, 400])
    assert not moving_picture.splat(far, far, np.ones(2), np.full((2, 3), 255), (9, 9)).any()


def test_the_picture_moves_and_never_ends(frames):
    picture = Image.open(io.BytesIO(moving_picture.as_webp(frames)))
    assert picture.n_frames == len(frames) and picture.info['loop'] == 0
    assert picture.size == frames[0].shape[1::-1]


def test_the_picture_of_the_readme_moves():
    assert 'docs/result.webp' in (ROOT / 'README.md').read_text()
    assert Image.open(ROOT / 'docs/result.webp').n_frames == moving_picture.FRAMES

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
"""The pictures of the pages about the surface method are those that their command makes."""

from dataclasses import replace
from pathlib import Path
import re

from color_stereo_ros.evaluation import method_pictures
from color_stereo_ros.evaluation.datasets import load_folder

import cv2

import pytest

ROOT = Path(__file__).resolve().parents[1]
LARGEST = 150_000  # bytes


class OnePair:
    """Stands where `Renders` does: one pair, whatever is asked for."""

    def __init__(self):
        self._scene = load_folder(ROOT / 'test/data/scenes/flat_350_hue1',
                                  {'range.min_depth': 0.22, 'range.max_depth': 0.62})

    def pair(self, name, pattern):
        """Return the pair; its one sweep counts as repeating where sines are asked for."""
        kind = 'unknown' if pattern == method_pictures.REPEATING else 'sweep'
        return replace(self._scene, settings={**self._scene.settings, 'pattern.type': kind})


@pytest.fixture(scope='module')
def figures():
    return method_pictures.pictures(OnePair())


def test_every_picture_of_the_pages_is_made(figures):
    page = ''.join((ROOT / f'docs/{name}.md').read_text()
                   for name in ('surface_method', 'third_view'))
    assert sorted(figures) == sorted(re.findall(r'\(steps/(\w+)\.png\)', page))


def test_pictures_are_small_files(figures, tmp_path):
    for name, figure in figures.items():
        path = tmp_path / f'{name}.png'
        method_pictures.save(figure, path)
        assert path.stat().st_size < LARGEST and cv2.imread(str(path)) is not None


def test_the_pictures_of_the_page_are_small_files():
    files = list((ROOT / 'docs/steps').glob('*.png'))
    assert files and all(path.stat().st_size < LARGEST for path in files)


def test_scales_name_their_units(figures):
    labels = [axes.get_xlabel() for figure in figures.values() for axes in figure.axes]
    assert {'px', 'DN', 'px per node', 'ln(p / (1 - p))', 'status code'} <= set(labels)

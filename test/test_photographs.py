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
"""Pairs with truth that are not simulated: what is read, what is told."""

import json

from color_stereo_ros.evaluation import photographs
import numpy as np
import pytest
from surface_pairs import plane, plane_pair

WIDTH, HEIGHT = 192, 128


def written(path, **changes):
    """Write a pair of a leaning plane under the default pattern; return its path."""
    left, right = plane_pair(WIDTH, HEIGHT, 20.0, 0.02)
    arrays = {'left': left, 'right': right, 'truth': plane(WIDTH, HEIGHT, 20.0, 0.02),
              'limits': (10, 30), 'pattern': json.dumps({'pattern.type': 'hue_field'}), **changes}
    np.savez(path, **{name: value for name, value in arrays.items() if value is not None})
    return path


def test_a_pair_is_measured_as_named_as_unknown_and_by_others(tmp_path):
    truth = plane(WIDTH, HEIGHT, 20.0, 0.02)
    truth[:, :32] = np.nan  # the right camera does not see it
    rows = photographs.measured(written(tmp_path / 'plane.npz', truth=truth), ['sgbm'])
    assert set(rows) == {'named', 'unknown', 'sgbm'}
    assert rows['named']['right'] > 0.97 and rows['unknown']['right'] > 0.9
    assert rows['named']['hi'] < 0.001 and rows['named']['median_px'] < 0.02
    assert rows['sgbm']['hi'] is None and rows['sgbm']['z68'] is None


def test_figures_are_shares_of_what_is_known():
    class Result:
        disparity = np.array([[5.0, 7.0, np.nan, 9.0]])
        confidence = np.array([[0.95, 0.95, 0.0, 0.5]])
        disparity_std = np.array([[0.5, 1.0, np.nan, 0.1]])
    found = photographs.figures(Result, np.array([[5.5, 5.0, 6.0, np.nan]]))
    assert found == {'right': 1 / 3, 'density': 2 / 3, 'wrong': 0.5, 'hi': 0.5, 'median_px': 1.25,
                     'z68': pytest.approx(1 + 0.68)}


def test_gray_images_are_measured_and_a_table_is_printed(tmp_path, capsys):
    left, right = (image[..., 1] for image in plane_pair(WIDTH, HEIGHT, 20.0, 0.02))
    written(tmp_path / 'gray.npz', left=left, right=right,
            pattern=json.dumps({'pattern.type': 'unknown'}))
    out = tmp_path / 'figures.json'
    assert photographs.main([str(tmp_path), '--matchers', '', '--output', str(out)]) == 0
    assert json.loads(out.read_text())['gray']['named']['right'] > 0.75
    assert 'mean of 1 pairs, named: right' in capsys.readouterr().out


def test_a_file_that_lacks_an_array_is_named(tmp_path):
    path = written(tmp_path / 'x.npz', truth=None)
    with pytest.raises(ValueError, match='x.npz lacks truth'):
        photographs.measured(path, [])

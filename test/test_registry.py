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
"""A registry keeps its order, refuses what is wrong, and says what it knows."""

import doctest

from color_stereo_ros.core import ColorStereoError, registry
from color_stereo_ros.core.registry import Registry
import pytest


@pytest.fixture
def shapes():
    """Return a registry of numbers of corners."""
    return Registry('shape', int, {'triangle': 3, 'square': 4})


def test_names_and_entries_keep_the_order_of_registration(shapes):
    shapes.register('point', 1)
    assert shapes.names == tuple(shapes) == ('triangle', 'square', 'point')
    assert shapes.items() == (('triangle', 3), ('square', 4), ('point', 1))
    assert len(shapes) == 3 and shapes['square'] == 4
    assert 'point' in shapes and 'circle' not in shapes


def test_a_decorator_registers_what_it_decorates():
    areas = Registry('area')

    @areas.register('square')
    def square(side):
        return side * side

    assert areas['square'] is square and square(3) == 9


@pytest.mark.parametrize('name', ['', 'Circle', '2d', 'a b', 'a/', '/a', 'a-b', None, 3])
def test_a_malformed_name_is_refused(shapes, name):
    with pytest.raises(ColorStereoError, match='^shape .* is no name, expected lower-case'):
        shapes.register(name, 1)


def test_names_may_have_levels(shapes):
    assert shapes.register('flat/circle_2', 0) == 0
    assert 'flat/circle_2' in shapes


def test_a_name_is_given_once(shapes):
    with pytest.raises(ColorStereoError, match="shape 'square' is registered already"):
        shapes.register('square', 5)
    assert shapes['square'] == 4


def test_an_entry_of_another_class_is_refused(shapes):
    with pytest.raises(ColorStereoError, match="shape 'circle' is a str, expected int"):
        shapes.register('circle', 'round')


def test_an_unknown_name_is_answered_with_the_nearest_and_all(shapes):
    with pytest.raises(ColorStereoError, match="unknown shape 'sqare'; did you mean 'square'.; "
                                               'known are triangle, square$'):
        shapes['sqare']
    with pytest.raises(ColorStereoError, match='unknown shape 7; known are triangle, square$'):
        shapes[7]


def test_names_may_be_added_while_they_are_read(shapes):
    for name in shapes:
        shapes.register(f'flat_{name}', 0)
    assert shapes.names == ('triangle', 'square', 'flat_triangle', 'flat_square')


def test_what_is_registered_temporarily_is_forgotten_even_after_an_error(shapes):
    with pytest.raises(ZeroDivisionError), shapes.temporarily():
        shapes.register('circle', 0)
        assert 'circle' in shapes
        1 / 0
    assert shapes.names == ('triangle', 'square')


def test_the_example_of_the_docstring_is_true():
    result = doctest.testmod(registry)
    assert result.attempted == 3 and result.failed == 0

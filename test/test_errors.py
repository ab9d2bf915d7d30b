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
"""What errors, logs and diagnostics show of values that came from elsewhere."""

from color_stereo_ros.errors import bounded, brief

import pytest


@pytest.mark.parametrize('value', ['', 'base_link', "it's", 7, None, [0.5, 1.0], 'x' * 78])
def test_a_short_value_is_shown_as_python_writes_it(value):
    assert brief(value) == repr(value)


@pytest.mark.parametrize('value, length', [
    ('x' * 79, 79), ('x' * 100_000, 100_000), ('\n' * 100_000, 100_000), ('\U0001f600' * 99, 99),
    (list(range(1000)), 4890)])
def test_a_long_value_is_shown_by_its_ends_and_its_length(value, length):
    text = brief(value)
    assert len(text) < 100 and '\n' not in text
    assert f'... ({length} characters) ...' in text
    assert text.startswith(repr(value)[:40]) and text.endswith(repr(value)[-20:])


def test_a_text_for_the_log_is_cut_at_its_end():
    assert bounded('x' * 1500) == 'x' * 1500
    assert bounded('x' * 1501) == 'x' * 1500 + '... (1501 characters)'
    assert bounded('abc', 2) == 'ab... (3 characters)'

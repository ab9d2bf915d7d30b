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
"""Whoever waits is told why; whoever does not wait is told nothing."""

import threading

from color_stereo_ros.patience import patience


def test_a_long_wait_is_explained_and_its_end_is_told(capsys):
    with patience('counting the stars', after=0.02):
        threading.Event().wait(0.3)
    said = capsys.readouterr()
    assert said.out == ''
    assert said.err.startswith('color_stereo: counting the stars .')
    assert said.err.endswith(' done\n')


def test_a_short_wait_is_silent(capsys):
    with patience('counting the stars', after=60):
        pass
    assert capsys.readouterr().err == ''


def test_an_error_passes_through(capsys):
    try:
        with patience('counting the stars', after=60):
            raise KeyError('Sirius')
    except KeyError as error:
        assert error.args == ('Sirius',)
    assert capsys.readouterr().err == ''

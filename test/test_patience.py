# SPDX-License-Identifier: Apache-2.0
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

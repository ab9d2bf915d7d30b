# SPDX-License-Identifier: Apache-2.0
"""Tests can be run in the background: the processes that they start obey signals all the same."""

from pathlib import Path
import signal
import subprocess
import sys

import pytest

FOLDER = Path(__file__).parent
PARENT = """
import os, signal, subprocess, sys
import conftest
conftest.give_children_their_signals()
os.kill(os.getpid(), {number})
child = 'import signal; print(signal.getsignal({number}) is not signal.SIG_IGN)'
subprocess.run([sys.executable, '-c', child], check=True)
"""


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGHUP])
def test_children_obey_signals_that_the_tests_ignore(number):
    ran = subprocess.run([sys.executable, '-c', PARENT.format(number=int(number))], cwd=FOLDER,
                         preexec_fn=lambda: signal.signal(number, signal.SIG_IGN),
                         capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout == 'True\n'

# SPDX-License-Identifier: Apache-2.0
"""Tests can be run in the background: the processes that they start obey SIGINT all the same."""

from pathlib import Path
import signal
import subprocess
import sys

FOLDER = Path(__file__).parent
CHILD = 'import signal; print(signal.getsignal(signal.SIGINT) is signal.default_int_handler)'
PARENT = f'''
import os, signal, subprocess, sys
import conftest
conftest.give_children_an_interrupt()
os.kill(os.getpid(), signal.SIGINT)
subprocess.run([sys.executable, '-c', {CHILD!r}], check=True)
'''


def deaf():
    """Ignore SIGINT, as a shell does for what ends in &."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def test_children_obey_an_interrupt_that_the_tests_ignore():
    ran = subprocess.run([sys.executable, '-c', PARENT], cwd=FOLDER, preexec_fn=deaf,
                         capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout == 'True\n'

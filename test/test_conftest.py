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

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
"""How the pairs of a run fared, whichever process has measured them."""

import re

from .refusals import TOLD


class Tally:
    """How the pairs of a run fared."""

    def __init__(self):
        self.measured = 0
        """Pairs that gave a result."""
        self.failed = 0
        """Pairs that were refused."""
        self.first_failure = None
        """Which pair was refused first, and why, as text."""

    def add(self, account):
        """Add the account of a task, see `working.account_of`."""
        self.measured += account['measured']
        self.failed += account['failed']
        self.first_failure = self.first_failure or account['first_failure']

    def reason(self):
        """Return why no pair could be measured, as text."""
        return (f'no pair could be measured: all {self.failed} pairs were refused; the first: '
                f'{self.first_failure}')


class Teller:
    """
    Passes on what tasks say: of many sentences that differ in numbers only, the first ones.

    Parameters
    ----------
    say : callable
        Takes a sentence.

    """

    def __init__(self, say):
        self._say, self._counts = say, {}

    def tell(self, text):
        """Say a sentence, unless its like was said often enough."""
        kind = re.sub(r'\d[\d.]*', '#', text)
        self._counts[kind] = self._counts.get(kind, 0) + 1
        if self._counts[kind] <= TOLD:
            self._say(text)

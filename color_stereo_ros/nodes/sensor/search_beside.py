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
"""A search in a thread of its own, while pairs go on."""

import threading


class SearchBeside:
    """Runs one search at a time."""

    NAME = 'search'
    """Of the thread."""

    def __init__(self):
        self._thread = None

    def begin(self, search, *arguments):
        """Call search(*arguments) in a thread of its own; call it only where nothing is `busy`."""
        self._thread = threading.Thread(target=search, args=arguments, name=self.NAME, daemon=True)
        self._thread.start()

    @property
    def busy(self):
        """Return whether a search is under way."""
        return self._thread is not None and self._thread.is_alive()

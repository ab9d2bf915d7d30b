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
"""Notice that kernels are compiled, which takes long, instead of loaded, which does not."""

from contextlib import contextmanager

from numba.core import event


class _FirstOnly(event.Listener):
    """Calls a function when the first compilation starts."""

    def __init__(self, tell):
        self._tell = tell

    def on_start(self, event):
        """Tell, once."""
        tell, self._tell = self._tell, None
        if tell is not None:
            tell()

    def on_end(self, event):
        """Nothing: the next one follows."""


@contextmanager
def listening(tell):
    """Call `tell` once if something is compiled during the block, when that begins."""
    with event.install_listener('numba:compile', _FirstOnly(tell)):
        yield

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
"""Forget what functions that call a kernel would need of it, where none does."""

from numba.core.compiler_lock import global_compiler_lock


@global_compiler_lock
def unlinked(dispatchers):
    """
    Free the intermediate code that numba keeps of compiled functions, to link them.

    What came from the cache cannot be linked afterwards: numba says "library unfit for linking".

    """
    for dispatcher in dispatchers:
        for compiled in dispatcher.overloads.values():
            compiled.library._shared_module = None

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
"""Which numba this package needs, and what to do where there is another one or none."""

from ...errors import InstallationError

REQUIREMENT = 'numba>=0.58,<0.69'
"""What pip may install; setup.py says the same."""

TESTED = 0, 68
"""Newest release whose private parts are known to be as `internals` expects them."""

try:
    import numba
except Exception as error:  # not there, or it refuses this Python or this NumPy
    missing = isinstance(error, ModuleNotFoundError) and error.name == 'numba'
    raise InstallationError(
        ('numba is not installed, but it compiles the kernels' if missing else
         f'numba cannot be imported ({" ".join(str(error).split())})')
        + f": pip install '{REQUIREMENT}' installs one that fits, beside Ubuntu's packages in a "
        'virtual environment (README, Extras)') from error


def is_tested():
    """Return whether the private parts of the installed numba are known."""
    words = numba.__version__.split('.')[:2]
    return all(word.isdigit() for word in words) and tuple(map(int, words)) <= TESTED

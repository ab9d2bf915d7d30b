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
"""What a node process asks of Fast DDS and of the C library, where the user has not decided."""

import ctypes
import os
from pathlib import Path
import threading

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8  # malloc.h

PROFILE = Path(__file__).with_name('fast_dds.xml')
LOCAL_PROFILE = Path(__file__).with_name('fast_dds_localhost.xml')

_TRANSPORT_CHOICES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE',
                      'FASTDDS_BUILTIN_TRANSPORTS')
_MEMORY_CHOICES = ('MALLOC_MMAP_THRESHOLD_', 'MALLOC_TRIM_THRESHOLD_', 'MALLOC_ARENA_MAX',
                   'GLIBC_TUNABLES')
_FOUND_PROFILE = 'DEFAULT_FASTRTPS_PROFILES.xml'  # Fast DDS reads it from the working directory
_RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'


def defaults(environ, middleware, reads_profiles=True):
    """
    Return the variables to set in an environment.

    Parameters
    ----------
    environ : dict
        The environment; what it decides stays so.
    middleware : str
        The name of the RMW implementation.
    reads_profiles : bool
        It is known to understand the profiles of this package, see `fast_dds_is_known`.

    Returns
    -------
    variables : dict

    """
    if not middleware.startswith('rmw_fastrtps'):
        return {}
    found = {}
    if 'RMW_FASTRTPS_PUBLICATION_MODE' not in environ:
        # Fast DDS sends a cloud in a thread of its own, while publish() would hold the interpreter
        found['RMW_FASTRTPS_PUBLICATION_MODE'] = 'ASYNCHRONOUS'
    if reads_profiles and not any(name in environ for name in _TRANSPORT_CHOICES) and not Path(
            _FOUND_PROFILE).exists():
        if _is_local(environ):
            # The profile keeps to this host; rmw_fastrtps would double the transports. Without
            # the profile the range would be all of the network: hence `reads_profiles`.
            found |= {_RANGE: 'SYSTEM_DEFAULT',
                      'FASTRTPS_DEFAULT_PROFILES_FILE': str(LOCAL_PROFILE)}
        else:
            found['FASTRTPS_DEFAULT_PROFILES_FILE'] = str(PROFILE)
    return found


def _is_local(environ):
    """Return whether all that is asked of discovery is to stay on this host."""
    return (environ.get(_RANGE) == 'LOCALHOST' and not environ.get('ROS_STATIC_PEERS')
            and environ.get('ROS_LOCALHOST_ONLY') != '1')  # which would set the range again


def fast_dds_is_known(maps='/proc/self/maps'):
    """
    Return whether the Fast DDS of this process is one that the profiles were written for.

    Version 3 has other tags and other variables; whoever does not understand a profile goes on
    without it.

    """
    try:
        loaded = Path(maps).read_text(encoding='utf-8', errors='replace')
    except OSError:
        return False
    return 'libfastrtps.so.2' in loaded and PROFILE.is_file() and LOCAL_PROFILE.is_file()


def prepare():
    """Set what the user has not set; call it before rclpy has a context and NumPy is there."""
    keep_freed_memory()
    # NumPy marks the places of large arrays: where small ones come later, each touched page would
    # be one of 2 MB
    os.environ.setdefault('NUMPY_MADVISE_HUGEPAGE', '0')
    from rclpy.utilities import get_rmw_implementation_identifier
    middleware = get_rmw_implementation_identifier()  # loads it
    os.environ.update(defaults(os.environ, middleware, fast_dds_is_known()))


def name_thread(name):
    """Name this thread for `top -H` and the bench; threads that it starts get the same name."""
    try:
        Path(f'/proc/self/task/{threading.get_native_id()}/comm').write_text(name[:15])
    except OSError:
        pass


def keep_freed_memory():
    """
    Let the C library keep what is freed, up to 64 MB, for the next pair.

    A result has 6 MB. Given back to the system and taken anew for every pair, its pages cost as
    much as a stage of the measurement. All threads take from the same memory: otherwise each would
    keep what it has freed for itself. Where the library is not glibc, or the environment tunes it
    already, nothing happens.

    """
    if any(name in os.environ for name in _MEMORY_CHOICES):
        return
    try:
        library = ctypes.CDLL(None)
        for option, value in ((_M_MMAP_THRESHOLD, 32 << 20), (_M_TRIM_THRESHOLD, 64 << 20),
                              (_M_ARENA_MAX, 1)):
            library.mallopt(option, value)
    except (OSError, AttributeError):
        pass

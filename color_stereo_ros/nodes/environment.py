# SPDX-License-Identifier: Apache-2.0
"""What a node process asks of Fast DDS and of the C library, where the user has not decided."""

import ctypes
import os
from pathlib import Path

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3  # malloc.h

PROFILE = Path(__file__).with_name('fast_dds.xml')

_TRANSPORT_CHOICES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE',
                      'FASTDDS_BUILTIN_TRANSPORTS')
_MEMORY_CHOICES = 'MALLOC_MMAP_THRESHOLD_', 'MALLOC_TRIM_THRESHOLD_', 'GLIBC_TUNABLES'
_LOCAL_PROFILE = 'DEFAULT_FASTRTPS_PROFILES.xml'  # Fast DDS reads it from the working directory


def defaults(environ):
    """
    Return the variables to add to an environment.

    Parameters
    ----------
    environ : dict
        The environment; what it sets already stays.

    Returns
    -------
    variables : dict

    """
    # Fast DDS sends a cloud in a thread of its own, while publish() would hold the interpreter
    found = {'RMW_FASTRTPS_PUBLICATION_MODE': 'ASYNCHRONOUS'}
    if not any(name in environ for name in _TRANSPORT_CHOICES) and not Path(
            _LOCAL_PROFILE).exists():
        found['FASTRTPS_DEFAULT_PROFILES_FILE'] = str(PROFILE)
    return {name: value for name, value in found.items() if name not in environ}


def prepare():
    """Set what the user has not set; call it before rclpy loads."""
    os.environ.update(defaults(os.environ))
    keep_freed_memory()


def keep_freed_memory():
    """
    Let the C library keep what is freed, up to 64 MB, for the next pair.

    A result has 6 MB. Given back to the system and taken anew for every pair, its pages cost as
    much as a stage of the measurement. Where the library is not glibc, or the environment tunes
    it already, nothing happens.

    """
    if any(name in os.environ for name in _MEMORY_CHOICES):
        return
    try:
        library = ctypes.CDLL(None)
        for option, size in ((_M_MMAP_THRESHOLD, 32 << 20), (_M_TRIM_THRESHOLD, 64 << 20)):
            library.mallopt(option, size)
    except (OSError, AttributeError):
        pass

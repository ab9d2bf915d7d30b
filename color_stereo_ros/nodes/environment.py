# SPDX-License-Identifier: Apache-2.0
"""What a node process asks of Fast DDS and of OpenMP, where the user has not decided."""

import ctypes
import os
from pathlib import Path

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3  # malloc.h

PROFILE = Path(__file__).with_name('fast_dds.xml')

_TRANSPORT_CHOICES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE',
                      'FASTDDS_BUILTIN_TRANSPORTS')
_LOCAL_PROFILE = 'DEFAULT_FASTRTPS_PROFILES.xml'  # Fast DDS reads it from the working directory
_THREAD_CHOICES = 'OMP_PROC_BIND', 'OMP_PLACES', 'GOMP_CPU_AFFINITY'


def defaults(environ, processors, process):
    """
    Return the variables to add to an environment.

    Parameters
    ----------
    environ : dict
        The environment; what it sets already stays.
    processors : iterable of int
        On which the process may run.
    process : int
        Its number.

    Returns
    -------
    variables : dict

    """
    # Fast DDS sends a cloud in a thread of its own, while publish() would hold the interpreter
    found = {'RMW_FASTRTPS_PUBLICATION_MODE': 'ASYNCHRONOUS'}
    if not any(name in environ for name in _TRANSPORT_CHOICES) and not Path(
            _LOCAL_PROFILE).exists():
        found['FASTRTPS_DEFAULT_PROFILES_FILE'] = str(PROFILE)
    if not any(name in environ for name in _THREAD_CHOICES):
        # The kernels run for fractions of a millisecond. Woken that often, both threads may end
        # up on one processor while another one idles; bound, they do not. Each process begins
        # with another processor, so that two nodes do not share their busiest one.
        ordered = sorted(processors)
        first = process % len(ordered)
        found['OMP_PLACES'] = ','.join(f'{{{n}}}' for n in ordered[first:] + ordered[:first])
        found['OMP_PROC_BIND'] = 'true'
    return {name: value for name, value in found.items() if name not in environ}


def prepare():
    """Set what the user has not set; call it before rclpy and the kernels load."""
    os.environ.update(defaults(os.environ, os.sched_getaffinity(0), os.getpid()))
    keep_freed_memory()


def keep_freed_memory():
    """
    Let the C library keep what is freed, up to 64 MB, for the next pair.

    A result has 6 MB. Given back to the system and taken anew for every pair, its pages cost as
    much as a stage of the measurement. Where the library is not glibc, nothing happens.

    """
    try:
        library = ctypes.CDLL(None)
        for option, size in ((_M_MMAP_THRESHOLD, 32 << 20), (_M_TRIM_THRESHOLD, 64 << 20)):
            library.mallopt(option, size)
    except (OSError, AttributeError):
        pass

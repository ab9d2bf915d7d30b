# SPDX-License-Identifier: Apache-2.0
"""Finds Mitsuba 3 and the fastest of its variants that this machine can run."""

import ctypes.util
from functools import lru_cache
import glob
import os
import re

from .errors import SimulatorMissingError

LLVM_PLACES = (
    '/usr/lib/*/libLLVM.so.*', '/usr/lib/*/libLLVM-*.so*', '/usr/lib/libLLVM*.so*',
    '/usr/lib64/libLLVM*.so*', '/usr/lib/llvm-*/lib/libLLVM*.so*', '/usr/local/lib/libLLVM*.so*',
    '/opt/homebrew/opt/llvm*/lib/libLLVM*.dylib')
OLDEST_LLVM = 14  # Dr.Jit vectorizes well from here on


def find_llvm():
    """Return the path of the newest LLVM library in the usual places, or None."""
    if os.environ.get('DRJIT_LIBLLVM_PATH'):
        return os.environ['DRJIT_LIBLLVM_PATH']
    found = [(_version(path), path) for place in LLVM_PLACES for path in glob.glob(place)]
    found = [entry for entry in found if entry[0] >= OLDEST_LLVM]
    return max(found)[1] if found else ctypes.util.find_library('LLVM')


def _version(path):
    """Return the major version in the name of an LLVM library, 0 = unknown."""
    match = re.search(r'libLLVM(?:-|\.so\.)(\d+)', path)
    return int(match.group(1)) if match else 0


@lru_cache(maxsize=1)
def load_mitsuba():
    """
    Import Mitsuba and choose a variant: `llvm_ad_rgb` where LLVM is found, else `scalar_rgb`.

    The environment variable COLOR_STEREO_SIM_VARIANT overrides the choice.

    Returns
    -------
    mitsuba : module

    Raises
    ------
    SimulatorMissingError
        If Mitsuba is not installed.

    """
    llvm = find_llvm()
    if llvm:
        os.environ.setdefault('DRJIT_LIBLLVM_PATH', llvm)
    try:
        import mitsuba
    except ImportError as error:
        raise SimulatorMissingError(
            f'the simulated rig needs Mitsuba 3 ({error}): pip install mitsuba, or pip install '
            "'.[sim]' in the folder of the sources (README, Extras)") from error
    variant = os.environ.get('COLOR_STEREO_SIM_VARIANT') or (
        'llvm_ad_rgb' if llvm and _llvm_works(mitsuba) else 'scalar_rgb')
    mitsuba.set_variant(variant)
    mitsuba.set_log_level(mitsuba.LogLevel.Error)
    return mitsuba


def _llvm_works(mitsuba):
    """Compile something small: the library may be too old, too new, or built without a JIT."""
    try:
        mitsuba.set_variant('llvm_ad_rgb')
        return float((mitsuba.Float([1.0, 2.0]) + 1)[1]) == 3.0
    except Exception:  # Dr.Jit raises exceptions of many types
        return False


def is_vectorized(mitsuba):
    """Return whether the chosen variant traces arrays of rays."""
    return mitsuba.variant().startswith('llvm')

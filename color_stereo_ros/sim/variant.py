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
"""Finds Mitsuba 3 and the fastest of its variants that this machine can run."""

import ctypes.util
from functools import lru_cache
import glob
from importlib.util import find_spec
import logging
import os
import re
import subprocess
import sys

from .errors import SimulatorMissingError
from ..errors import pip_install

LLVM_PLACES = (
    '/usr/lib/*/libLLVM.so.*', '/usr/lib/*/libLLVM-*.so*', '/usr/lib/libLLVM*.so*',
    '/usr/lib64/libLLVM*.so*', '/usr/lib/llvm-*/lib/libLLVM*.so*', '/usr/local/lib/libLLVM*.so*',
    '/opt/homebrew/opt/llvm*/lib/libLLVM*.dylib')
OLDEST_LLVM = 15  # Dr.Jit takes no older one
TRIAL = """
import mitsuba
mitsuba.set_variant('llvm_ad_rgb')
import drjit
value = drjit.minimum(drjit.maximum(mitsuba.Float([1.0, 2.0]), 1.5), 1.75)
scene = mitsuba.load_dict({'type': 'scene', 'ball': {'type': 'sphere'}})
hit = scene.ray_intersect(mitsuba.Ray3f(mitsuba.Point3f([0.0, 0.0], [0.0, 5.0], [-3.0, -3.0]),
                                        mitsuba.Vector3f(0.0, 0.0, 1.0)))
assert (value[0], value[1], hit.t[0]) == (1.5, 1.75, 2.0)
"""
"""Ends with status 0 where Dr.Jit can compute with an LLVM library."""
TRIAL_SECONDS = 60.0


def find_llvm():
    """
    Return the path of the newest LLVM library with which Dr.Jit can compute, or None.

    Each library is tried in a process of its own: one that lacks an instruction ends its process.
    LLVM 15 and 16 do so on x86, because they have no `fmaximum`.

    """
    named = os.environ.get('DRJIT_LIBLLVM_PATH')
    found = [named] if named else llvm_libraries()
    for path in found:
        if _works(path):
            return path
    tried = f' ({", ".join(found)} cannot be used)' if found else ''
    logging.getLogger('color_stereo_ros').warning(
        'rendering takes several times as long, because no LLVM library works with Dr.Jit%s: '
        'install LLVM 17 or newer, or name its library in DRJIT_LIBLLVM_PATH', tried)
    return None


def llvm_libraries():
    """Return the paths of the LLVM libraries in the usual places, the newest one first."""
    paths = {os.path.realpath(path): path for place in LLVM_PLACES
             for path in sorted(glob.glob(place)) if _version(path) >= OLDEST_LLVM}
    usual = ctypes.util.find_library('LLVM')
    return (sorted(paths.values(), key=_version, reverse=True)
            or [usual] * (usual is not None))


def _version(path):
    """Return the major version in the name of an LLVM library, 0 = unknown."""
    match = re.search(r'libLLVM(?:-|\.so\.)(\d+)', path)
    return int(match.group(1)) if match else 0


def _works(path):
    try:
        return subprocess.run([sys.executable, '-c', TRIAL], timeout=TRIAL_SECONDS,
                              stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                              stderr=subprocess.DEVNULL,
                              env={**os.environ, 'DRJIT_LIBLLVM_PATH': path}).returncode == 0
    except subprocess.TimeoutExpired:
        return False


@lru_cache(maxsize=1)
def load_mitsuba():
    """
    Import Mitsuba and choose a variant: `llvm_ad_rgb` where LLVM works, else `scalar_rgb`.

    The environment variable COLOR_STEREO_SIM_VARIANT overrides the choice.

    Returns
    -------
    mitsuba : module

    Raises
    ------
    SimulatorMissingError
        If Mitsuba is not installed.

    """
    variant = _chosen_variant()
    try:
        import mitsuba
    except ImportError as error:
        raise SimulatorMissingError(
            f'the simulated rig needs Mitsuba 3 ({error}): {pip_install("sim")}') from error
    mitsuba.set_variant(variant)
    mitsuba.set_log_level(mitsuba.LogLevel.Error)
    return mitsuba


def _chosen_variant():
    """Return the name of the variant; the import of Mitsuba loads the library named here."""
    variant = os.environ.get('COLOR_STEREO_SIM_VARIANT') or 'llvm_ad_rgb'
    if not variant.startswith('llvm') or find_spec('mitsuba') is None:
        return variant
    llvm = find_llvm()
    if llvm is None:
        return 'scalar_rgb'
    os.environ['DRJIT_LIBLLVM_PATH'] = llvm
    return variant


def is_vectorized(mitsuba):
    """Return whether the chosen variant traces arrays of rays."""
    return mitsuba.variant().startswith('llvm')

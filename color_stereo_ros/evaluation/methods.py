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
"""Run any method on a scene: those of this package and OpenCV's, on the same rectified pair."""

from dataclasses import asdict, dataclass
import time

from . import opencv_matchers
from .metrics import measure
from .noise_limit import compare, measured_noise, noise_limit, Window
from .tuned import stereo_for
from ..core import RangeResult, RectifiedPair, Settings, SettingsError
from ..core.cameras.rectification import Rectifier
from ..core.methods import METHODS
from ..core.settings import suggestion
from ..core.surface.plane_kernels import WIDE_RADIUS


REPEATS = 3
"""A method faster than a second is run so often; the shortest time counts."""

VARIANTS = {'surface+third': ('surface', {'matching.third_view': 'automatic'}),
            'surface+two': ('surface', {'matching.third_view': 'off'})}
"""Names of methods with settings of their own: (method, flat settings)."""


@dataclass(frozen=True, eq=False)
class Run:
    """What one method made of one scene."""

    method: str
    settings: Settings
    pair: RectifiedPair
    result: RangeResult
    milliseconds: float
    """Wall time from the rectified pair (OpenCV) or the raw pair (own methods) to the depth."""


def known_methods():
    """Return every method that can be evaluated: own ones, their variants, then OpenCV's."""
    return *METHODS, *VARIANTS, *opencv_matchers.METHODS


def own_settings(name):
    """Return the flat settings that make the name of an own method or of a variant."""
    method, values = VARIANTS.get(name, (name, {}))
    return {**values, 'matching.method': method}


def checked_methods(names):
    """Return method names as a tuple, or raise SettingsError for an unknown one."""
    known = known_methods()
    for name in names:
        if name not in known:
            raise SettingsError(f'unknown method {name!r}{suggestion(name, known)}; known are '
                                + ', '.join(known))
    return tuple(names)


def run_method(scene, method, values=None, repeats=REPEATS):
    """
    Run one method on one scene.

    Parameters
    ----------
    scene : color_stereo_ros.evaluation.datasets.Scene
        A pair with its truth.
    method : str
        One of `known_methods()`.
    values : dict, optional
        Flat settings that override those of the scene; constants of the surface method, too.
    repeats : int
        A fast method is run so often; the shortest time counts.

    Returns
    -------
    run : Run

    Raises
    ------
    ColorStereoError
        If a name or a value is wrong.

    """
    checked_methods([method])
    flat = {**scene.settings, **(values or {})}
    if method in opencv_matchers.METHODS:
        settings = Settings().updated(flat)
        pair = Rectifier(scene.calibration).rectify(scene.left, scene.right)
        result, seconds = _timed(lambda: opencv_matchers.match(method, pair, settings.range),
                                 repeats)
    else:
        stereo = stereo_for(scene.calibration, Settings(), {**flat, **own_settings(method)})
        settings = stereo.settings
        pair = stereo.rectify(scene.left, scene.right)
        result, seconds = _timed(lambda: stereo.process(scene.left, scene.right), repeats)
    return Run(method, settings, pair, result, 1e3 * seconds)


def _timed(function, repeats):
    best = float('inf')
    for _ in range(max(repeats, 1)):
        start = time.perf_counter()
        result = function()
        best = min(best, time.perf_counter() - start)
        if best > 1:
            break
    return result, best


def evaluate(scene, method, values=None, repeats=REPEATS):
    """
    Run one method on one scene and measure the result.

    Parameters
    ----------
    scene, method, values, repeats
        As for `run_method`.

    Returns
    -------
    run : Run
    figures : dict
        Those of `metrics.measure`, `noise_limit` (of `compared_with_noise`) and `milliseconds`.

    """
    run = run_method(scene, method, values, repeats)
    figures = measure(run.result, scene.truth)
    figures['noise_limit'] = compared_with_noise(run, scene)
    figures['milliseconds'] = run.milliseconds
    return run, figures


def compared_with_noise(run, scene):
    """
    Return how far a run is from the noise limit.

    Parameters
    ----------
    run : Run
        The results of one method.
    scene : color_stereo_ros.evaluation.datasets.Scene
        A pair with its truth.

    Returns
    -------
    figures : dict
        `window`: the one that the method uses. `camera` and `pair`: those of
        `noise_limit.compare` over that window for the known noise of the cameras (None if it is
        not known) and for the noise measured in the pair, demosaicing included; `best`: the first
        of the two that is there. `common`: like `best` over a 9 x 9 plane, the same for all.

    """
    window = window_of(run.method, run.settings)
    measured = (measured_noise(run.pair, scene.truth),) * 2

    def over(window, noise):
        return compare(run.result, scene.truth,
                       noise_limit(run.pair, scene.truth, *noise, window)) if noise else None

    figures = {'window': asdict(window), 'camera': over(window, scene.noise),
               'pair': over(window, measured)}
    figures['best'] = figures['camera'] or figures['pair']
    figures['common'] = over(Window(), scene.noise or measured)
    return figures


def window_of(method, settings):
    """
    Return the window over which a method decides a disparity.

    The paper's smoothing widens its window by its standard deviation on either side; the surface
    method's wide window is counted in nodes of 2 x 2 pixels. StereoSGBM and 3WAY carry their
    decision beyond their 5 x 5 block, along paths; they are measured against a 9 x 9 plane.

    """
    if method == 'paper':
        wider = 2 * round(settings.color.smoothing)
        return Window(settings.matching.window_width + wider,
                      settings.matching.window_height + wider, 'constant')
    if settings.matching.method == 'surface':
        size = 2 * (2 * WIDE_RADIUS + 1) + 1
        return Window(size, size)
    return Window(15, 15, 'constant') if method == 'bm' else Window()

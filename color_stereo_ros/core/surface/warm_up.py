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
"""
Compile the kernels of the surface method, the last ones first.

`python -m color_stereo_ros.core.surface.warm_up` does that.

A process that needs all of them compiles them in the order of the pipeline, in one thread: the
compiler knows no other way. A second process that comes from the other end meets it half way;
what one has compiled the other finds in the cache. The kernel that takes longest comes first, so
that neither waits long for the other where they meet.

"""

import subprocess
import sys

import numpy as np

from ..cameras.calibration import StereoCalibration

SIZE = 64, 48  # px


def some_calibration():
    """Return a small rig for those who need any; its lenses differ, so that nothing is skipped."""
    width, height = SIZE
    camera = np.array([[60.0, 0.0, width / 2], [0.0, 60.0, height / 2], [0.0, 0.0, 1.0]])
    return StereoCalibration.from_arrays(SIZE, camera, np.array([-0.1, 0.0, 0.0, 0.0]), camera,
                                         np.array([0.1, 0.0, 0.0, 0.0]), np.eye(3),
                                         (-0.06, 0.0, 0.0))


def start_helper():
    """
    Return a process that compiles the last kernels; kill it when it is of no more use.

    None where the system allows no further process: then the kernels take longer, no more.

    """
    try:
        return subprocess.Popen([sys.executable, '-m', __name__], stdin=subprocess.DEVNULL,
                                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    except OSError:
        return None


def main():
    """Fit planes, then go through the other stages of the surface method, the last ones first."""
    from ..rows.alignment import Alignment
    from ..settings import Settings
    from ..triangulation import disparity_limits
    from .method import SurfaceMethod
    from .neighbors import propagate_planes
    from .pair_model import PairModel
    from .pixels import measured_pixels
    calibration, settings = some_calibration(), Settings()
    method = SurfaceMethod(settings, calibration,
                           disparity_limits(calibration.geometry, settings.range))
    views, planes, solver = method.views, method.planes, method.least_squares
    pair, tiles = PairModel.neutral(views), planes.tiles
    solver.fit(solver.linearized, views, planes, pair, tiles, 0)
    trust = method.trust
    verdict = trust.judge(views, planes, method.coarse.seeds, trust.usual_balance(views, planes))
    measured_pixels(planes, verdict, method.geometry, method.limits, trust.least_odds)
    method.rows.measure(views, planes, pair, Alignment.unknown(SIZE))
    propagate_planes(views, planes, pair, tiles, 1, method.tuning.neighbors, method.brightness)
    solver.linearize(views, planes, pair, tiles)
    planes.seed(method.coarse.search(views))


if __name__ == '__main__':
    sys.exit(main())

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
A process that takes times when asked: `python -m color_stereo_ros.bench.child JSON`.

Threads and processor features are chosen when a process starts. So each choice is a process of
its own, and the parent asks the processes in turn. A line with the index of a contender comes in,
a line of JSON with `seconds`, `cpu` and `stages` goes out. The first line that goes out, `first`,
says how long it took from `started` (s of time.monotonic) to the first result of the first
contender.

"""

import json
from pathlib import Path
import sys
import time

WARM_UP = 2  # calls of each contender that do not count


def main():
    """Take times until the input ends."""
    order = json.loads(sys.argv[1])
    # A pair on disk: drawing it takes longer than measuring it.
    contenders = [contender(**description) for description in order['contenders']]
    contenders[0]()
    print(json.dumps({'first': time.monotonic() - order['started']}), flush=True)
    for take in contenders:
        for _ in range(WARM_UP):
            take()
    for line in sys.stdin:
        take = contenders[int(line)]
        start, busy = time.perf_counter(), time.process_time()
        stages = take()
        print(json.dumps({'seconds': time.perf_counter() - start,
                          'cpu': time.process_time() - busy, 'stages': stages}), flush=True)


def contender(kind, folder, disparities, threads):
    """
    Return a function that measures one pair and returns the seconds of its stages.

    Parameters
    ----------
    kind : str
        'surface', 'third view', 'paper': ColorStereo.process of the raw pair; 'bm', 'sgbm':
        OpenCV's matcher alone, on the rectified pair.
    folder : str
        With pair.npy, left.yaml and right.yaml.
    disparities : int
        Of the search, px.
    threads : int
        Of OpenCV; numba's are in the environment.

    """
    import cv2
    import numpy as np

    from ..core import ColorStereo, StereoCalibration
    from .scene import bench_settings
    cv2.setNumThreads(threads)
    folder = Path(folder)
    calibration = StereoCalibration.from_yaml(folder / 'left.yaml', folder / 'right.yaml')
    left, right = np.load(folder / 'pair.npy')
    if kind == 'third view':
        stereo = ColorStereo(calibration, bench_settings(calibration, disparities,
                                                         third_view='automatic'))
        stereo.process(left, right)  # finds the projector
        return lambda: stereo.process(left, right).seconds
    if kind in ('surface', 'paper'):
        stereo = ColorStereo(calibration, bench_settings(calibration, disparities, kind))
        return lambda: stereo.process(left, right).seconds
    pair = ColorStereo(calibration).rectify(left, right)
    if kind == 'bm':
        gray = [cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) for image in (pair.left, pair.right)]
        matcher = cv2.StereoBM_create(disparities, 15)
        return lambda: matcher.compute(*gray) is None or {}
    matcher = cv2.StereoSGBM_create(
        numDisparities=disparities, blockSize=5, P1=8 * 3 * 25, P2=32 * 3 * 25, disp12MaxDiff=1,
        uniquenessRatio=5, speckleWindowSize=100, speckleRange=2, mode=cv2.StereoSGBM_MODE_SGBM)
    return lambda: matcher.compute(pair.left, pair.right) is None or {}


if __name__ == '__main__':
    sys.exit(main())

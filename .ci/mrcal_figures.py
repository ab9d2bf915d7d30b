# SPDX-License-Identifier: Apache-2.0
"""
Adjust simulated views with mrcal, the oracle of test/test_mrcal.py.

mrcal has wheels for CPython 3.12 alone, so that its figures are kept in a file. With a Python
where mrcal is installed:

    .venv/bin/python .ci/mrcal_figures.py views views.npz     (this package's Python)
    python3.12 .ci/mrcal_figures.py solve views.npz test/data/mrcal.json

"""

from importlib.metadata import version
import json
from pathlib import Path
import sys

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
ROWS, COLUMNS, SPACING = 8, 11, 0.02
SEEDS = 6


def write_views(path):
    """Write the corners of simulated views as an .npz file."""
    sys.path.insert(0, str(ROOT / 'test'))
    from board_views import mrcal_views
    observations, starts = zip(*(mrcal_views(seed) for seed in range(SEEDS)))
    np.savez(path, observations=observations, starts=starts)


def solve(path, output):
    """Write what mrcal makes of the views of a file."""
    import mrcal
    found = []
    with np.load(path) as data:
        for observations, start in zip(data['observations'], data['starts']):
            found.append(solved(mrcal, observations, start))
    Path(output).write_text(json.dumps({'mrcal': version('mrcal'), 'parameters': found},
                                       indent=1) + '\n')


def solved(mrcal, observations, start):
    """
    Return the parameters of one calibration, a list in the order of StereoParameters.

    observations: float64 (V, 2, ROWS, COLUMNS, 3), pixels and weights, < 0 where not seen.
    start: float64 (24 + 6 V,), the parameters and the poses, rotation vector and translation.

    """
    views = len(observations)
    intrinsics = np.ascontiguousarray(start[:18].reshape(2, 9))
    extrinsics = np.ascontiguousarray(start[18:24].reshape(1, 6))
    frames = np.ascontiguousarray(start[24:].reshape(views, 6))
    indices = np.array([[view, camera, camera - 1] for view in range(views)
                        for camera in range(2)], np.int32)
    mrcal.optimize(
        intrinsics=intrinsics, rt_cam_ref=extrinsics, rt_ref_frame=frames,
        observations_board=np.ascontiguousarray(
            observations.reshape(-1, ROWS, COLUMNS, 3)),
        indices_frame_camintrinsics_camextrinsics=indices, lensmodel='LENSMODEL_OPENCV5',
        imagersizes=np.array([[640, 480]] * 2, np.int32), calibration_object_spacing=SPACING,
        calobject_warp=np.zeros(2), do_optimize_calobject_warp=True,
        do_apply_outlier_rejection=False, do_apply_regularization=False)
    return np.concatenate([intrinsics.ravel(), extrinsics.ravel()]).tolist()


if __name__ == '__main__':
    if sys.argv[1] == 'views':
        write_views(sys.argv[2])
    else:
        solve(sys.argv[2], sys.argv[3])

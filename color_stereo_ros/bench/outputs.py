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
What each output costs: `python -m color_stereo_ros.bench.outputs FOLDER ROUNDS` prints JSON.

The content of each message is built again and again from a result of which nothing has been asked
before, all in turn. Publishing is not included: it costs about as much as copying the bytes.

"""

from dataclasses import replace
import json
from pathlib import Path
import subprocess
import sys
import time

import numpy as np

ALL_FIELDS = 'normal_x normal_y normal_z confidence depth_std'
VARIANTS = (
    ('points', {'compact_points': True}), ('points', {'point_fields': ALL_FIELDS}),
    ('points', {'region': '-0.1 0.1 -0.1 0.1 0 1'}), ('points', {'decimation': 2}),
    ('depth/image', {'region': '-0.1 0.1 -0.1 0.1 0 1'}), ('depth/image', {'decimation': 2}),
    ('depth/image/compressedDepth', {'depth_encoding': '16UC1'}))
"""Outputs with settings that change their cost."""


def measured(folder, rounds):
    """
    Return what each output costs, taken in a process of its own.

    Parameters
    ----------
    folder : str or Path
        With pair.npy, left.yaml and right.yaml, see `times.save_pair`.
    rounds : int
        How often it is done.

    Returns
    -------
    costs : dict
        Name to {'median': s, 'least': s, 'bytes': of the message's data}.

    """
    answer = subprocess.run([sys.executable, '-m', __name__, str(folder), str(rounds)],
                            stdout=subprocess.PIPE, check=True)
    return json.loads(answer.stdout)


def tasks(result, pair, calibration):
    """
    Return functions by name that build the content of a message, or read a pair of them.

    Parameters
    ----------
    result : RangeResult
        Of the pair.
    pair : tuple of numpy.ndarray
        The raw images of the result.
    calibration : StereoCalibration
        Of the two cameras.

    """
    from ..messages.contents import Header
    from ..messages.outputs import Context, OUTPUTS
    from ..messages.trimming import trimmed
    from ..parameters.groups import OutputSettings, RangeNodeSettings

    def task(topic, changes):
        context = Context.of(Header(), RangeNodeSettings(output=OutputSettings(**changes)),
                             calibration)
        return lambda: OUTPUTS[topic].content(trimmed(_fresh(result), context), context)

    found = {_name(topic, changes): task(topic, changes)
             for topic, changes in (*((topic, {}) for topic in OUTPUTS), *VARIANTS)}
    return found | {f'input: a pair as {suffix[1:].upper()}': _reading(pair, suffix)
                    for suffix in ('.jpg', '.png')}


def _fresh(result):
    """Return a result of which nothing has been computed yet that is made when asked."""
    source = result.image_source
    remade = source.__wrapped__ if hasattr(source, '__wrapped__') else source
    return replace(result, image_source=remade)


def _name(topic, changes):
    return ', '.join([topic, *(f'output.{name} {value}' for name, value in changes.items())])


def _reading(pair, suffix):
    """Return a function that decompresses a pair."""
    import cv2

    from ..messages.contents import CompressedImage, Header
    from ..messages.decompressing import decompressed
    messages = [CompressedImage(Header(), 'bgr8; x compressed bgr8', cv2.imencode(
        suffix, image[..., ::-1])[1].tobytes()) for image in pair]
    return lambda: [decompressed(message) for message in messages]


def _size(content):
    """Return the number of bytes of the field data, 0 if there is none."""
    return len(getattr(getattr(content, 'image', content), 'data', ()))


def main():
    """Measure and print."""
    from ..core import ColorStereo, StereoCalibration
    from .scene import bench_settings
    folder, rounds = Path(sys.argv[1]), int(sys.argv[2])
    calibration = StereoCalibration.from_yaml(folder / 'left.yaml', folder / 'right.yaml')
    pair = np.load(folder / 'pair.npy')
    result = ColorStereo(calibration, bench_settings(calibration, 128)).process(*pair)
    found = tasks(result, pair, calibration)
    sizes = {name: _size(task()) for name, task in found.items()}  # and get warm
    seconds = {name: [] for name in found}
    for _ in range(rounds):
        for name, task in found.items():
            start = time.perf_counter()
            task()
            seconds[name].append(time.perf_counter() - start)
    print(json.dumps({name: {'median': float(np.median(taken)), 'least': min(taken),
                             'bytes': sizes[name]} for name, taken in seconds.items()}))


if __name__ == '__main__':
    sys.exit(main())

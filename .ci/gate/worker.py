# SPDX-License-Identifier: Apache-2.0
"""
A process that measures with the package of one tree: `python -P -m gate.worker TREE`.

A line of JSON with a request comes in, a line of JSON with the answer goes out. `do` names the
request, see REQUESTS; the other values are the arguments of the function. Only names that the
package promises to keep are used: those of `color_stereo_ros.core`.

"""

from dataclasses import asdict
import hashlib
import json
import os
from pathlib import Path
import re
import sys
import time
import traceback

RESULT_ARRAYS = ('disparity', 'depth', 'confidence', 'status', 'disparity_std', 'depth_std',
                 'image')
PAIR_ARRAYS = 'left', 'right', 'left_inside', 'right_inside'
SENSORS = []
"""What `prepare` made: (ColorStereo, left, right)."""


def main():
    """Answer requests until the input ends."""
    # What libraries print must not get between the answers.
    answers = os.fdopen(os.dup(1), 'w')
    os.dup2(2, 1)
    import cv2
    cv2.setNumThreads(int(os.environ['NUMBA_NUM_THREADS']))
    for line in sys.stdin:
        request = json.loads(line)
        try:
            answer = REQUESTS[request.pop('do')](**request)
            check_origin()
        except Exception:
            answer = {'failure': traceback.format_exc()}
        answers.write(json.dumps(answer) + '\n')
        answers.flush()


def check_origin():
    """Raise ImportError if the package, or any part of it, is not that of the tree."""
    import color_stereo_ros.core  # noqa: F401
    tree = Path(sys.argv[1]).resolve()
    for name, module in list(sys.modules.items()):
        if name.split('.')[0] == 'color_stereo_ros':
            places = [module.__file__] if module.__file__ else list(module.__path__)
            for place in places:
                if not Path(place).resolve().is_relative_to(tree):
                    raise ImportError(f'{name} was imported from {place}, expected {tree}')


def where():
    """Return where the package was imported from."""
    import color_stereo_ros.core
    return {'file': color_stereo_ros.core.__file__}


def pattern(settings, path):
    """Make a pattern and save it; return its hash."""
    import numpy as np

    from color_stereo_ros.core import make_pattern, Settings
    image = make_pattern(Settings().updated(settings).pattern)
    np.save(path, image)
    return {'hash': digest(image)}


def measure(calibration, settings, rectified, steps, keep=None):
    """
    Measure a sequence of pairs with one ColorStereo.

    Parameters
    ----------
    calibration : dict
        See `stereo_calibration`.
    settings : dict
        Flat names to values.
    rectified : bool
        The pairs are rectified already.
    steps : list of [str, str]
        Name and file, uint8 (2, H, W, 3), of each pair.
    keep : str, optional
        Folder for all output arrays.

    Returns
    -------
    answer : dict
        'outputs': name of each output to its hash; 'error': what ended the sequence, or ''.

    """
    outputs, text = Outputs(keep), ''
    check_origin()
    try:
        measure_all(calibration, settings, rectified, steps, outputs)
    except Exception as error:  # an error is a result, too: both trees must have the same
        text = error_text(error)
        outputs.add('error', text)
    return {'outputs': outputs.hashes, 'error': text}


def error_text(error):
    """Return type and text of an error and of its causes, without addresses."""
    parts = []
    while error:
        parts.append(re.sub(r' at 0x[0-9a-f]+', '', f'{type(error).__name__}: {error}'))
        error = error.__cause__
    return ', from '.join(parts)


def measure_all(calibration, settings, rectified, steps, outputs):
    """Add all outputs of a sequence of pairs; see `measure`."""
    import numpy as np
    stereo = color_stereo(calibration, settings, rectified)
    for side in ('left', 'right'):
        camera = getattr(stereo.calibration, side)
        for name in ('D', 'K', 'R', 'P'):
            outputs.add(f'calibration/{side} {name}', getattr(camera, name))
    for name, part in zip('Rt', stereo.calibration.right_from_left):
        outputs.add(f'calibration/right_from_left {name}', np.array(part))
    results = []
    for number, (name, path) in enumerate(steps, 1):
        left, right = np.load(path)
        add_pair(outputs, f'{number} {name}/rectify', stereo.rectify(left, right))
        result = stereo.process(left, right)
        add_result(outputs, f'{number} {name}', result)
        results.append((f'{number} {name}', result))
    for name, result in results[:-1]:  # later pairs must not write into earlier results
        changed = [attribute for attribute in RESULT_ARRAYS if
                   digest(getattr(result, attribute)) != outputs.hashes[f'{name}/{attribute}']]
        outputs.add(f'{name}/overwritten later', changed)


def color_stereo(calibration, settings, rectified):
    """Return the ColorStereo of a description."""
    from color_stereo_ros.core import ColorStereo, Settings
    return ColorStereo(stereo_calibration(calibration), Settings().updated(settings),
                       rectified_input=rectified)


def stereo_calibration(description):
    """
    Return the StereoCalibration of a description.

    Parameters
    ----------
    description : dict
        One key: 'files': two paths; 'arrays': arguments of StereoCalibration.from_arrays; or
        'cameras': twice the arguments of CameraModel.

    """
    from color_stereo_ros.core import CameraModel, StereoCalibration
    kind, value = next(iter(description.items()))
    if kind == 'files':
        return StereoCalibration.from_yaml(*value)
    if kind == 'arrays':
        return StereoCalibration.from_arrays(**value)
    return StereoCalibration(*(CameraModel(**camera) for camera in value))


def add_pair(outputs, name, pair):
    """Add the outputs of `rectify`."""
    add_arrays(outputs, name, pair, PAIR_ARRAYS)
    outputs.add(f'{name}/geometry', asdict(pair.geometry))


def add_result(outputs, name, result):
    """Add the outputs of `process`."""
    add_arrays(outputs, name, result, RESULT_ARRAYS)
    outputs.add(f'{name}/points', result.points())
    outputs.add(f'{name}/density', result.density)
    outputs.add(f'{name}/disparity_limits', list(result.disparity_limits))
    outputs.add(f'{name}/geometry', asdict(result.geometry))
    outputs.add(f'{name}/seconds', list(result.seconds))  # the durations differ, the names not


def add_arrays(outputs, name, owner, attributes):
    """Add some attributes, arrays, of an object."""
    for attribute in attributes:
        outputs.add(f'{name}/{attribute}', getattr(owner, attribute))


class Outputs:
    """Hashes of what was measured, and its arrays if they are to be kept."""

    def __init__(self, folder=None):
        """Keep arrays if there is a folder for them."""
        self.hashes = {}
        self._folder = folder

    def add(self, name, value):
        """Add an array, or a value that JSON can hold."""
        import numpy as np
        self.hashes[name] = digest(value)
        if self._folder is None:
            return
        place = Path(self._folder) / name.replace('/', '__')
        if isinstance(value, np.ndarray):
            np.save(f'{place}.npy', value)
        else:
            Path(f'{place}.json').write_text(json.dumps(value), encoding='utf-8')


def digest(value):
    """Return the SHA-256 of type, shape and bytes of an array, or of the JSON of a value."""
    import numpy as np
    if not isinstance(value, np.ndarray):
        return hashlib.sha256(json.dumps(value).encode()).hexdigest()
    found = hashlib.sha256(f'{value.dtype.str} {value.shape} '.encode())
    found.update(np.ascontiguousarray(value))
    return found.hexdigest()


def prepare(calibration, settings, rectified, path):
    """Make a ColorStereo for `take`; return its index and how long it took, s."""
    import numpy as np
    start = time.perf_counter()
    stereo = color_stereo(calibration, settings, rectified)
    seconds = time.perf_counter() - start
    SENSORS.append((stereo, *(np.load(path) if path else (None, None))))
    return {'index': len(SENSORS) - 1, 'seconds': seconds}


def take(index, uncounted, times):
    """
    Measure a pair some times, the first ones uncounted.

    Returns
    -------
    answer : dict
        'time', 'processor time': the least ones of a pair, s. What else the machine does adds to
        times, never takes from them.

    """
    stereo, left, right = SENSORS[index]
    for _ in range(uncounted):
        stereo.process(left, right)
    clocks = {'time': time.perf_counter, 'processor time': time.process_time}
    taken = {name: [] for name in clocks}
    for _ in range(times):
        starts = {name: clock() for name, clock in clocks.items()}
        stereo.process(left, right)
        for name, clock in clocks.items():
            taken[name].append(clock() - starts[name])
    return {name: min(each) for name, each in taken.items()}


REQUESTS = {'where': where, 'pattern': pattern, 'measure': measure, 'prepare': prepare,
            'take': take}

if __name__ == '__main__':
    sys.exit(main())

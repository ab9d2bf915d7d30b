# SPDX-License-Identifier: Apache-2.0
"""Files with the pairs of a combination, made by `scenes` or taken from path-traced scenes."""

from itertools import count
from pathlib import Path

import cv2
import numpy as np

from . import scenes


class Inputs:
    """
    The inputs of combinations.

    Parameters
    ----------
    folder : pathlib.Path
        For files that this makes; must exist.
    data : pathlib.Path
        Folder of path-traced scenes.

    """

    def __init__(self, folder, data):
        """Keep the folders."""
        self._folder = folder
        self._data = data
        self._numbers = count()

    def prepare(self, combination):
        """
        Make the files of a combination.

        Returns
        -------
        request : dict
            Arguments of `gate.worker.measure`.

        """
        if not combination.size:
            calibration = {'files': [str(self._data / combination.rig / f'{side}.yaml')
                                     for side in ('left', 'right')]}
        else:
            calibration = scenes.calibration_of(combination.rig, combination.size)
        return {'calibration': calibration, 'settings': dict(combination.settings),
                'rectified': combination.rectified, 'steps': self._steps(combination)}

    def _steps(self, combination):
        """Write each pair of the sequence once; return names and files."""
        files = {}
        for name in combination.sequence:
            if name not in files:
                path = self._folder / f'pair_{next(self._numbers)}.npy'
                np.save(path, self.pair(combination, name))
                files[name] = str(path)
        return [(name, files[name]) for name in combination.sequence]

    def pair(self, combination, name):
        """Return a raw pair, uint8 (2, H, W, 3); a name is a scene and perhaps a variant."""
        if not combination.size:
            return self._real_pair(name)
        scene, variant = split_name(name)
        pattern = np.load(self.pattern_file(combination))
        pair = scenes.plain(scene, combination.size, combination.rig, pattern)
        return np.ascontiguousarray(scenes.VARIANTS[variant](pair) if variant else pair)

    def _real_pair(self, name):
        """Return a path-traced pair."""
        images = [cv2.imread(str(self._data / name / f'{side}.png'))
                  for side in ('left', 'right')]
        return np.stack(images)[..., ::-1]

    def pattern_file(self, combination):
        """Return where the pattern of a combination is, or is to be."""
        values = pattern_settings(combination)
        name = '_'.join(str(value) for _, value in sorted(values.items()))
        return self._folder / f'pattern_{name}.npy'

    @staticmethod
    def forget(request):
        """Delete the files of a request that `prepare` has returned."""
        for _, path in request['steps']:
            Path(path).unlink(missing_ok=True)


def pattern_settings(combination):
    """Return the flat settings of what the projector shows; {} for a path-traced scene."""
    if not combination.size:
        return {}
    width, height = scenes.pattern_size(combination.size)
    changed = {name: value for name, value in combination.settings
               if name.startswith('pattern.')}
    return {**changed, 'pattern.type': combination.pattern, 'pattern.width': width,
            'pattern.height': height}


def split_name(name):
    """Return scene and variant ('' = none) of the name of a pair."""
    for variant in scenes.VARIANTS:
        if name.endswith(f' {variant}'):
            return name.removesuffix(f' {variant}'), variant
    return name, ''

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
"""What a process does that measures tasks of an export: files of the chosen pairs."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .measuring import PairSensor
from .products import PRODUCTS, Shot
from .tasks import Task
from .working import account_of
from ..messages.contents import Header
from ..messages.outputs import Context
from ..messages.trimming import trimmed


@dataclass(frozen=True, eq=False)
class ChosenTask(Task):
    """A task of which some pairs are exported; the others are measured for what they carry on."""

    names: dict
    """Places of the chosen pairs in the task to what the names of their files begin with."""


def film_picture(folder, name, item):
    """Return the file in which a picture waits until the film of a Product takes it."""
    return Path(folder) / f'{name}_{item.ending}.npy'


@dataclass(frozen=True)
class Exporting:
    """The job of `export`: files of each chosen pair, whole or not at all."""

    folder: str
    """Takes the files."""
    products: tuple
    """Names of PRODUCTS."""
    depth_scale: float

    def measure(self, worker, task, tick):
        """Measure a ChosenTask; return its account, with the `names` of what was written."""
        said, names = [], []
        sensor = PairSensor(worker.topics, worker.settings, said.append)
        silent = PairSensor(worker.topics, worker.settings, lambda text: None)
        for place, (stereo, pair) in enumerate(worker.pairs(task)):
            name = task.names.get(place)
            result = (silent if name is None else sensor).measure(stereo, pair)
            if name is not None and result is not None:
                self._write(worker, name, self._shot(worker, result, pair))
                names.append(name)
            tick()
        return {**account_of(task, sensor, said), 'names': names}

    def _write(self, worker, name, shot):
        for item in (PRODUCTS[product] for product in self.products):
            if item.film:
                np.save(film_picture(worker.folder, name, item), item.write(shot))
            else:
                item.write(Path(self.folder) / f'{name}_{item.ending}', shot)

    def _shot(self, worker, result, pair):
        context = Context.of(Header.of(pair.left.header), worker.settings, pair.calibration)
        return Shot(trimmed(result, context), context, pair.stamp, self.depth_scale)

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
"""Pictures as an MP4 film, whole or not at all."""

from contextlib import contextmanager

import numpy as np

from .atomic import written_whole
from ..errors import ImageError, RecordingError

CODEC = 'mp4v'
"""MPEG-4 part 2, which every build of OpenCV can write."""


@contextmanager
def film(path, rate):
    """
    Write a film that appears when the block ends well.

    Parameters
    ----------
    path : str or Path
        Ends in .mp4. An existing file is replaced as a whole.
    rate : float
        Pictures a second.

    Yields
    ------
    add : callable
        Appends a picture, uint8 (H, W, 3), RGB. All have one size; odd ones get a black row or
        column, because the codec needs even sizes.

    Raises
    ------
    ImageError
        If a picture has another size than the first one.
    RecordingError
        If there is no picture, or the film cannot be written.

    """
    with written_whole(path) as partial:
        reel = _Reel(path, partial, rate)
        try:
            yield reel.add
        finally:
            reel.release()
        reel.check()


class _Reel:
    """The pictures of a film that is not complete yet."""

    def __init__(self, path, partial, rate):
        self._path, self._partial, self._rate = path, partial, rate
        self._writer = self._shape = None
        self._count = 0

    def add(self, picture):
        """Append a picture."""
        import cv2
        if self._writer is None:
            self._begin(picture.shape)
        if picture.shape != self._shape:
            raise ImageError(f'{self._path}: a picture of {_size(picture.shape)} does not fit '
                             f'behind those of {_size(self._shape)}')
        even = np.pad(picture, [(0, picture.shape[0] % 2), (0, picture.shape[1] % 2), (0, 0)])
        self._writer.write(cv2.cvtColor(even, cv2.COLOR_RGB2BGR))
        self._count += 1

    def _begin(self, shape):
        import cv2
        height, width = (length + length % 2 for length in shape[:2])
        self._writer = cv2.VideoWriter(str(self._partial), cv2.VideoWriter_fourcc(*CODEC),
                                       self._rate, (width, height))
        self._shape = shape
        if not self._writer.isOpened():
            raise RecordingError(f'{self._path}: this OpenCV writes no MP4 of {_size(shape)}')

    def release(self):
        """Close the file."""
        if self._writer is not None:
            self._writer.release()

    def check(self):
        """Raise RecordingError unless all pictures are in the file: the writer tells nothing."""
        import cv2
        if self._writer is None:
            raise RecordingError(f'{self._path}: there is no picture for it')
        reader = cv2.VideoCapture(str(self._partial))
        found = int(reader.get(cv2.CAP_PROP_FRAME_COUNT)) if reader.isOpened() else 0
        reader.release()
        if found != self._count:
            raise RecordingError(f'{self._path}: {found} of {self._count} pictures could be '
                                 'written; is the disk full?')


def _size(shape):
    return f'{shape[1]} x {shape[0]} px'

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
"""Image files: a damaged one is refused as a whole, with the reason; none is half written."""

from contextlib import contextmanager
import os
from pathlib import Path
import struct
import sys
import tempfile

import numpy as np

from .atomic import write_bytes
from ..errors import ImageError, RecordingError

HALF_READ = ('premature', 'corrupt')
"""Words by which a decoder tells that it has filled up what the file does not hold."""
WITH_OTHER_SAMPLES = (b'II*\0', b'MM\0*', b'II+\0', b'MM\0+', b'#?', b'PF', b'Pf')
"""First bytes of formats (TIFF, Radiance, PFM) that may hold floating-point numbers."""
ORIENTATION = 274  # the tag of TIFF and EXIF
MOST_TAGS = 10000


def read_image(path):
    """
    Read an image file; tags that say how the camera was held are ignored.

    Parameters
    ----------
    path : path-like
        Of the file.

    Returns
    -------
    image : numpy.ndarray, uint8, shape (H, W, 3)
        RGB, the pixels as they are stored, because a calibration belongs to these. A gray file
        has three equal channels, of 16 bits the upper 8 count.

    Raises
    ------
    RecordingError
        If the file cannot be read.
    ImageError
        If it is no image, a damaged one, or one of other samples than 8 or 16 bits.

    """
    import cv2
    data = _content(path)
    if data.startswith(WITH_OTHER_SAMPLES):
        _refuse_other_samples(path, data)
    return cv2.cvtColor(_decoded(path, data, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)


def read_image_as_is(path, flags=-1):
    """
    Return an image file as OpenCV decodes it, BGR; errors as for `read_image`.

    Parameters
    ----------
    path : path-like
        Of the file.
    flags : int
        Of cv2.imdecode; the default is cv2.IMREAD_UNCHANGED. Tags that say how the camera was
        held are ignored in any case.

    Returns
    -------
    image : numpy.ndarray

    """
    return _decoded(path, _content(path), flags)


def _content(path):
    """Return the bytes of an image file."""
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise RecordingError(f'{path}: {error.strerror}') from error
    if not data:
        raise ImageError(f'{path}: the file is empty')
    return data


def _decoded(path, data, flags):
    """Return the image in the bytes of a file."""
    image, complaints = _tried(data, flags)
    if image is None:
        raise ImageError(f'{path}: damaged, or no image of a known format')
    if is_cut_off_jpeg(data) or any(word in complaints.lower() for word in HALF_READ):
        raise ImageError(f'{path}: damaged or only half written')
    return image


def _tried(data, flags):
    """Return the image in bytes, or None, and what the decoder complains of."""
    import cv2
    if flags != cv2.IMREAD_UNCHANGED:
        flags |= cv2.IMREAD_IGNORE_ORIENTATION  # without it OpenCV obeys EXIF
    with _captured_complaints() as complaints:
        try:
            image = cv2.imdecode(np.frombuffer(_not_turned(data), np.uint8), flags)
        except cv2.error:  # an image of a size that nothing can hold
            image = None
    return image, complaints[0]


def _refuse_other_samples(path, data):
    """Refuse floating-point and 32-bit images by name: the decoder clips them, or fails."""
    import cv2
    image, _ = _tried(data, cv2.IMREAD_UNCHANGED)
    if image is None or image.dtype in (np.uint8, np.uint16):
        return
    kind = 'float' if image.dtype.kind == 'f' else 'signed integer'
    raise ImageError(f'{path}: {8 * image.dtype.itemsize}-bit {kind}: 8 or 16 bits are expected')


def _not_turned(data):
    """
    Return the bytes of an image without the orientation that a TIFF may have.

    OpenCV obeys the tag of a TIFF whatever the flags say.

    """
    kinds = {b'*': ('I', 4, 'H', 12, 8), b'+': ('Q', 8, 'Q', 20, 12)}  # TIFF, BigTIFF
    order = {b'II': '<', b'MM': '>'}.get(data[:2])
    version = data[2:4].strip(b'\0')
    if order is None or version not in kinds:
        return data
    offset, place, count, size, value = kinds[version]
    try:
        first, = struct.unpack_from(order + offset, data, place)
        entries, = struct.unpack_from(order + count, data, first)
        first += struct.calcsize(order + count)
        for entry in range(first, first + size * min(entries, MOST_TAGS), size):
            if struct.unpack_from(order + 'H', data, entry)[0] == ORIENTATION:
                changed = bytearray(data)
                struct.pack_into(order + 'H', changed, entry + value, 1)
                return bytes(changed)
    except struct.error:  # cut off: the decoder says so
        pass
    return data


def write_image(path, image, **options):
    """
    Write an image file of the format that its suffix says.

    Parameters
    ----------
    path : str or Path
        Of the file or folder.
    image : numpy.ndarray, shape (H, W) or (H, W, 3)
        Colors in RGB.
    options
        Those of `written_whole`.

    Raises
    ------
    ImageError
        If OpenCV knows no format of that suffix, or the format cannot hold such an image.

    """
    import cv2
    suffix = Path(path).suffix
    pixels = cv2.cvtColor(image, cv2.COLOR_RGB2BGR) if image.ndim == 3 else image
    try:
        written, encoded = cv2.imencode(suffix, pixels)
    except cv2.error:
        written = False
    if not written:
        raise ImageError(f'{path}: cannot be written as {suffix or "a file without suffix"}; '
                         '.png always works')
    write_bytes(path, encoded.tobytes(), **options)


def is_cut_off_jpeg(data):
    """Tell whether a JPEG has no end after its last scan: old versions of OpenCV do not."""
    last_scan = data.rfind(b'\xff\xda')
    return data.startswith(b'\xff\xd8') and data.find(b'\xff\xd9', max(last_scan, 0)) < 0


@contextmanager
def _captured_complaints():
    """
    Keep what decoders write to standard error from the user.

    The libraries behind OpenCV write there without asking, and some tell in no other way that
    half of the image is missing.

    Yields
    ------
    complaints : list
        Holds the text when the block has ended.

    """
    complaints = []
    sys.stderr.flush()
    kept = os.dup(2)
    try:
        with tempfile.TemporaryFile() as file:
            os.dup2(file.fileno(), 2)
            try:
                yield complaints
            finally:
                os.dup2(kept, 2)
                file.seek(0)
                complaints.append(file.read().decode(errors='replace'))
    finally:
        os.close(kept)

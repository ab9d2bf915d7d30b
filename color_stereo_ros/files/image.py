# SPDX-License-Identifier: Apache-2.0
"""Read image files; a damaged one is refused as a whole, with the reason."""

from contextlib import contextmanager
import os
from pathlib import Path
import sys
import tempfile

import cv2
import numpy as np

from ..errors import ImageError, RecordingError

HALF_READ = ('premature', 'corrupt')
"""Words by which a decoder tells that it has filled up what the file does not hold."""


def read_image(path):
    """
    Read an image file.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    image : numpy.ndarray, uint8, shape (H, W, 3)
        RGB; a gray file has three equal channels, of 16 bits the upper 8 count.

    Raises
    ------
    RecordingError
        If the file cannot be read.
    ImageError
        If it is no image, or a damaged one.

    """
    return cv2.cvtColor(read_image_as_is(path, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)


def read_image_as_is(path, flags=cv2.IMREAD_UNCHANGED):
    """Return an image file as OpenCV decodes it, BGR; errors as for `read_image`."""
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise RecordingError(f'{path}: {error.strerror}') from error
    if not data:
        raise ImageError(f'{path}: the file is empty')
    with _captured_complaints() as complaints:
        try:
            image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
        except cv2.error:  # an image of a size that nothing can hold
            image = None
    if image is None:
        raise ImageError(f'{path}: damaged, or no image of a known format')
    if _is_cut_off_jpeg(data) or any(word in complaints[0].lower() for word in HALF_READ):
        raise ImageError(f'{path}: damaged or only half written')
    return image


def _is_cut_off_jpeg(data):
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

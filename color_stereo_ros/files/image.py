# SPDX-License-Identifier: Apache-2.0
"""Image files: a damaged one is refused as a whole, with the reason; none is half written."""

from contextlib import contextmanager
import os
from pathlib import Path
import sys
import tempfile

import numpy as np

from ..errors import ImageError, RecordingError
from .atomic import write_bytes

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
    import cv2
    return cv2.cvtColor(read_image_as_is(path, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)


def read_image_as_is(path, flags=-1):
    """
    Return an image file as OpenCV decodes it, BGR; errors as for `read_image`.

    Parameters
    ----------
    path : path-like
    flags : int
        Of cv2.imdecode; the default is cv2.IMREAD_UNCHANGED.

    Returns
    -------
    image : numpy.ndarray

    """
    import cv2
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


def write_image(path, image, **options):
    """
    Write an image file of the format that its suffix says.

    Parameters
    ----------
    path : str or Path
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

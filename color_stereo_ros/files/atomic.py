# SPDX-License-Identifier: Apache-2.0
"""Result files: each is written beside its name first, then renamed, so none is half written."""

from contextlib import contextmanager
import os
from pathlib import Path
import tempfile


@contextmanager
def written_whole(path):
    """
    Yield a temporary path beside a file; the file gets its name when the block ends well.

    Parameters
    ----------
    path : str or Path
        Its folder is made if it is not there; a file of that name is replaced.

    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f'.{path.name}.', dir=path.parent) as temporary:
        partial = Path(temporary) / path.name  # same suffix: some writers choose a format by it
        yield partial
        os.replace(partial, path)


def write_text(path, text):
    """Write a text file."""
    with written_whole(path) as partial:
        partial.write_text(text, encoding='utf-8')


def write_bytes(path, data):
    """Write a binary file."""
    with written_whole(path) as partial:
        partial.write_bytes(data)


def write_image(path, image):
    """
    Write an image file of the format that its suffix says.

    Parameters
    ----------
    path : str or Path
    image : numpy.ndarray, shape (H, W) or (H, W, 3)
        Colors in RGB.

    Raises
    ------
    ImageError
        If OpenCV knows no format of that suffix, or the format cannot hold such an image.

    """
    import cv2

    from ..errors import ImageError
    suffix = Path(path).suffix
    pixels = cv2.cvtColor(image, cv2.COLOR_RGB2BGR) if image.ndim == 3 else image
    try:
        written, encoded = cv2.imencode(suffix, pixels)
    except cv2.error:
        written = False
    if not written:
        raise ImageError(f'{path}: cannot be written as {suffix or "a file without suffix"}; '
                         '.png always works')
    write_bytes(path, encoded.tobytes())

# SPDX-License-Identifier: Apache-2.0
"""
The page of a live calibration in the browser: the cameras with the outline of the next pose.

Needs the library `viser` (extra [view]), which serves the page and sends what changes.

"""

from contextlib import redirect_stdout
import io

import cv2
import numpy as np

TITLE = 'color_stereo calibrate geometry'
QUALITY = 80  # of the JPEGs
WIDEST = 1600  # px of the picture; the rest only costs time


class LivePage:
    """
    Serves the page until it is closed.

    Parameters
    ----------
    host : str
        Address to listen at; 127.0.0.1 = this machine alone.
    port : int
        0 = any free one.

    Raises
    ------
    ModuleNotFoundError
        If viser is not installed.
    OSError
        If the address cannot be used.

    """

    def __init__(self, host, port):
        import viser
        with redirect_stdout(io.StringIO()):  # viser's own words; ours name the address
            self._server = viser.ViserServer(host=host, port=port, label=TITLE, verbose=False)
        self._server.gui.configure_theme(control_layout='fixed', control_width='large',
                                         show_logo=False, show_share_button=False)
        self.text = self._server.gui.add_markdown('Waiting for images.')
        """The handle of the words."""

    @property
    def address(self):
        """Return the address for the browser."""
        return f'http://{self._server.get_host()}:{self._server.get_port()}'

    def show(self, picture, words):
        """
        Show both images and what to do.

        Parameters
        ----------
        picture : numpy.ndarray, uint8, shape (H, W, 3)
            RGB.
        words : str
            Markdown.

        """
        step = -(-picture.shape[1] // WIDEST)
        picture = picture[::step, ::step]
        for client in self._server.get_clients().values():
            client.scene.set_background_image(padded(picture, client.camera.aspect),
                                              format='jpeg', jpeg_quality=QUALITY)
        self.text.content = words

    def close(self):
        """End the server."""
        with redirect_stdout(io.StringIO()):
            self._server.stop()


def padded(picture, aspect):
    """
    Return a picture with black margins: a browser stretches it to the shape of its window.

    Parameters
    ----------
    picture : numpy.ndarray, uint8, shape (H, W, 3)
    aspect : float
        Width over height of the window.

    Returns
    -------
    padded : numpy.ndarray, uint8, shape (H', W', 3)
        In its middle the picture.

    """
    height, width = picture.shape[:2]
    tall = max(0, round(width / aspect) - height)
    wide = max(0, round(height * aspect) - width)
    return cv2.copyMakeBorder(np.ascontiguousarray(picture), tall // 2, tall - tall // 2,
                              wide // 2, wide - wide // 2, cv2.BORDER_CONSTANT)

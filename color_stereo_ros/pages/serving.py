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
A page in the browser that a process serves and changes while it is looked at.

Needs the library `viser` (extra [view]). The browser gets all that it needs from this server.

"""

from contextlib import redirect_stdout
import io

import cv2
import numpy as np

QUALITY = 80
"""Of the JPEGs; chosen: edges of status colors stay clean."""
WIDTH = 400
"""px, of the panel; chosen: a table of two columns fits."""


class ServedPage:
    """
    Serves a page until it is closed.

    Parameters
    ----------
    host : str
        Address to listen at; 127.0.0.1 = this machine alone.
    port : int
        0 = any free one.
    title : str
    dark : bool
        Bright words on a dark page.

    Raises
    ------
    ModuleNotFoundError
        If viser is not installed.
    OSError
        If the address cannot be used.

    """

    def __init__(self, host, port, title, dark=False):
        import viser
        with redirect_stdout(io.StringIO()):  # viser's own words; ours name the address
            self.server = viser.ViserServer(host=host, port=port, label=title, verbose=False)
        self.server.gui.configure_theme(dark_mode=dark, show_logo=False, show_share_button=False)
        self.server.gui.main_panel.dock_right()
        self.server.gui.main_panel.set_width(WIDTH)

    @property
    def address(self):
        """Return the address for the browser."""
        return f'http://{self.server.get_host()}:{self.server.get_port()}'

    def close(self):
        """End the server."""
        with redirect_stdout(io.StringIO()):
            self.server.stop()


def padded(picture, aspect):
    """
    Return a picture with black margins: a browser stretches it to the shape of its window.

    Parameters
    ----------
    picture : numpy.ndarray, uint8, shape (H, W, 3)
        RGB.
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

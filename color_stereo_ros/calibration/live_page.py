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
"""The page of a live calibration in the browser: the cameras with the outline of the next pose."""

from ..pages.serving import padded, QUALITY, ServedPage

TITLE = 'color_stereo calibrate geometry'
WIDEST = 1600  # px of the picture; the rest only costs time


class LivePage(ServedPage):
    """
    Serves the page until it is closed.

    Parameters
    ----------
    host, port : str, int
        As for `ServedPage`.

    """

    def __init__(self, host, port):
        super().__init__(host, port, TITLE)
        self.text = self.server.gui.add_markdown('Waiting for images.')
        """The handle of the words."""

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
        for client in self.server.get_clients().values():
            client.scene.set_background_image(padded(picture, client.camera.aspect),
                                              format='jpeg', jpeg_quality=QUALITY)
        self.text.content = words

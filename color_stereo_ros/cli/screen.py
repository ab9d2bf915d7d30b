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
"""A display that shows an image pixel by pixel, by SDL through pygame (extra [project])."""

import os

import numpy as np

from ..errors import brief, ColorStereoError


class ScreenError(ColorStereoError):
    """There is no such display, or it cannot be used."""


class Screen:
    """
    A window without a frame that fills one display; use it in a `with` block.

    Parameters
    ----------
    display : int
        Number of the display, from 0.

    Raises
    ------
    ScreenError
        If there is no display server, or no display of this number.

    Attributes
    ----------
    size : (int, int)
        Width and height of the display, px.

    """

    def __init__(self, display=0):
        """Open the window."""
        os.environ.setdefault('PYGAME_HIDE_SUPPORT_PROMPT', '1')
        # the desktop keeps its resolution and its other windows when another one gets the focus
        os.environ.setdefault('SDL_VIDEO_MINIMIZE_ON_FOCUS_LOSS', '0')
        import pygame
        self._pygame = pygame
        try:
            pygame.display.init()
            sizes = pygame.display.get_desktop_sizes()
        except pygame.error as error:
            raise ScreenError(f'no display can be used: {error}; is DISPLAY or WAYLAND_DISPLAY '
                              'set?') from error
        if not 0 <= display < len(sizes):
            self.close()
            listed = ', '.join(f'{number} ({width} x {height} px)'
                               for number, (width, height) in enumerate(sizes))
            raise ScreenError(f'--display {display}: there are the displays {listed}')
        try:
            self._surface = pygame.display.set_mode(sizes[display], pygame.FULLSCREEN,
                                                    display=display, vsync=0)
        except pygame.error as error:
            self.close()
            raise ScreenError(f'display {display} cannot be used: {brief(str(error))}') from error
        self.size = self._surface.get_size()
        pygame.mouse.set_visible(False)
        pygame.display.set_caption('color_stereo project')

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def show(self, image):
        """
        Show an image, one pixel of it on each pixel of the display.

        Parameters
        ----------
        image : numpy.ndarray, uint8, shape (H, W, 3)
            RGB. A smaller one is shown in the middle on black; of a larger one the middle. One
            of a single pixel fills the display.

        """
        pygame = self._pygame
        image = np.ascontiguousarray(image)
        height, width = image.shape[:2]
        drawn = pygame.image.frombuffer(image.data, (width, height), 'RGB')
        even = (height, width) == (1, 1)
        self._surface.fill(tuple(map(int, image[0, 0])) if even else (0, 0, 0))
        self._surface.blit(drawn, ((self.size[0] - width) // 2, (self.size[1] - height) // 2))
        pygame.display.flip()

    def is_wanted(self):
        """Return False once the user has closed the window or pressed Escape or q."""
        pygame = self._pygame
        for event in pygame.event.get():
            if event.type == pygame.QUIT:
                return False
            if event.type == pygame.KEYDOWN and event.key in (pygame.K_ESCAPE, pygame.K_q):
                return False
            if event.type in (pygame.WINDOWEXPOSED, pygame.WINDOWRESTORED):
                pygame.display.flip()
        return True

    def close(self):
        """Close the window; may be called again."""
        self._pygame.display.quit()

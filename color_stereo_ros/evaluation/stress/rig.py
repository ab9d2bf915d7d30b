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
"""What a disturbance may change: pattern, light, mounting, lenses and electronics of the rig."""

from dataclasses import dataclass, field

from .mounting import Mounting

CAMERA = {'exposure': 0.0, 'sensitivity': (1.0, 1.0, 0.5), 'crosstalk': 0.0, 'vignetting': 0.0,
          'lens_blur': 0.0, 'bayer': 'RGGB', 'demosaicing': 'none', 'full_well': 20000.0,
          'read_noise': 12.0, 'speckle': 0.01, 'dark_level': 2.0, 'response': 'linear', 'bits': 8}
"""Fields of `sim.rig.Camera`: an industrial camera of today. Demosaicing comes later."""


@dataclass
class View:
    """What one camera differs in."""

    blur: float = 0.0
    """Standard deviation of the point spread beside that of the lens, px."""
    uneven_blur: object = None
    """A function of (y, x), -1..1, arrays (H, 1) and (1, W), to such a deviation (H, W), px."""
    motion: tuple = (0, 0)
    """Path of the image during the exposure, px."""
    chromatic: float = 0.0
    """How far red and blue lie apart in the corner, px."""
    gains: list = field(default_factory=list)
    """Functions of (y, x), -1..1, arrays (H, 1, 1) and (1, W, 1), to gains (H, W, 3 or 1)."""
    camera: dict = field(default_factory=dict)
    """Changes of CAMERA."""
    exposure: float = 1.0
    """Factor of the automatic exposure."""
    hot: float = 0.0
    """Share of hot pixels."""
    demosaicing: str = 'bilinear'
    """bilinear, edge_aware or vng."""
    unsharp: float = 0.0
    """Strength of an unsharp mask of 1 px."""
    gray: bool = False
    """A mono camera: three equal channels."""
    jpeg: int = 0
    """Quality of a JPEG 4:2:0, 0 = none."""


@dataclass
class StressRig:
    """The undisturbed rig; a disturbance changes some of it."""

    pattern: str = 'default'
    """A key of `patterns.shown`."""
    settings: dict = field(default_factory=dict)
    """Flat settings of `ColorStereo`, for example the type of the pattern."""
    printed: float = 0.0
    """Contrast of a print on every surface."""
    object_color: tuple = None
    """Factor of the color of what lies in the middle, RGB."""
    ambient: tuple = (0.0, 0.0, 0.0)
    """Light of the surroundings, share of the mean light of the pattern, RGB."""
    black: float = 0.0
    """Light of a black pixel of the projector, share of white."""
    projector_gains: tuple = (1.0, 1.0, 1.0)
    mounting: Mounting = Mounting()
    """Of the right camera."""
    left: View = field(default_factory=View)
    right: View = field(default_factory=View)
    swap: object = None
    """Function (left, right, right of another scene) -> pair without truth."""

    @property
    def views(self):
        """Return both views, left first."""
        return self.left, self.right

    @property
    def plain_light(self):
        """Tell whether the light is that of the render."""
        return not (self.printed or self.object_color or any(self.ambient) or self.black
                    or self.projector_gains != (1.0, 1.0, 1.0))

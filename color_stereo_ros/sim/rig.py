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
"""Two cameras and a projector on a common body: descriptions and calibration."""

from dataclasses import dataclass
from functools import cached_property

from color_stereo_ros.core.cameras.calibration import StereoCalibration
from color_stereo_ros.core.cameras.lenses import LENSES

import numpy as np

from .errors import SceneError
from .geometry import Pose
from .shapes import read_path, read_pose

BAYER_LAYOUTS = ('RGGB', 'BGGR', 'GRBG', 'GBRG', 'none')
DEMOSAICING = ('bilinear', 'edge_aware', 'none')


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera: optics, place on the rig, and what turns light into numbers."""

    name: str
    width: int
    """px."""
    height: int
    """px."""
    K: np.ndarray
    """float64 (3, 3), px."""
    distortion_model: str
    D: np.ndarray
    """float64 (n,)."""
    pose: Pose
    """Rig frame from camera frame (x right, y down, z forward)."""
    exposure: float
    """Share of full scale that a radiance of 1 reaches; 0 = automatic."""
    sensitivity: tuple
    """Relative sensitivity of the R, G and B pixels."""
    crosstalk: float
    """Share of each channel that comes from each of the two other colors of light."""
    vignetting: float
    """Share of cos^4 falloff, 0..1."""
    lens_blur: float
    """Standard deviation of the point spread, px."""
    bayer: str
    demosaicing: str
    full_well: float
    """Electrons at full scale."""
    read_noise: float
    """Standard deviation, electrons."""
    speckle: float
    """Standard deviation of a relative error of each pixel's light."""
    dark_level: float
    """DN of 8 bit without light."""
    response: object
    """`linear`, `srgb`, or a gamma (output = input ** (1 / gamma))."""
    bits: int

    @property
    def shape(self):
        """Return (height, width)."""
        return self.height, self.width

    @property
    def lens(self):
        """Return the Lens of the distortion model."""
        return LENSES[self.distortion_model]

    def pixels(self, distorted):
        """Return column and row of distorted coordinates (N, 2), float64 (N,) each, px."""
        column = distorted[:, 0] * self.K[0, 0]
        if self.K[0, 1]:
            column = column + distorted[:, 1] * self.K[0, 1]
        return column + self.K[0, 2], distorted[:, 1] * self.K[1, 1] + self.K[1, 2]


@dataclass(frozen=True, eq=False)
class Projector:
    """A projector: optics and light. Its resolution is that of the pattern it is given."""

    pose: Pose
    """Rig frame from projector frame (x right, y down, z forward)."""
    field_of_view: float
    """Horizontal, degrees."""
    power: float
    """Irradiance of a white pattern on a plane 1 m away."""
    gamma: float
    """Light = value ** gamma."""
    black_level: float
    """Light of a black pixel, share of white."""
    blur: float
    """Standard deviation of the point spread in focus, px of the projector."""
    aperture: float
    """Diameter of the exit pupil, m; 0 = sharp at every distance."""
    focus: float
    """Distance of sharpest focus, m."""
    offset: float
    """Vertical lens shift, share of the height: 0.5 = the axis meets the lower edge."""

    def focal_length(self, width):
        """Return the focal length in px of a pattern so many columns wide."""
        return width / 2 / np.tan(np.radians(self.field_of_view) / 2)

    def blur_at(self, depth, width):
        """Return the standard deviation of the point spread, px, at depths in m."""
        # Thin lens: a disk of diameter f A |1/z - 1/z_focus|, standard deviation a quarter of it.
        disk = self.focal_length(width) * self.aperture * np.abs(1 / depth - 1 / self.focus)
        return np.hypot(self.blur, disk / 4)


@dataclass(frozen=True, eq=False)
class Rig:
    """Cameras, projector, working range, and the path of the rig through a sequence."""

    name: str
    left: Camera
    right: Camera
    projector: Projector
    depth_limits: tuple
    """Nearest and farthest Z of the rectified left camera for which the rig is made, m."""
    path: tuple = ()
    """Scene frame from rig frame, one Pose per frame; empty = the identity."""

    def pose_at(self, frame):
        """Return scene-from-rig in one frame of a sequence; the last pose stays."""
        if not self.path:
            return Pose(np.eye(3), np.zeros(3))
        return self.path[min(frame, len(self.path) - 1)]

    @cached_property
    def calibration(self):
        """Return the exact StereoCalibration of the two cameras."""
        rotation = self.right.pose.rotation.T @ self.left.pose.rotation
        translation = self.right.pose.to_child(self.left.pose.position)
        return StereoCalibration.from_arrays(
            (self.left.width, self.left.height), self.left.K, self.left.D, self.right.K,
            self.right.D, rotation, translation, self.left.distortion_model)


def read_rig(node):
    """Return the Rig of a complete mapping: name, cameras, projector and depth limits."""
    node.only('name', 'depth_limits', 'cameras', 'left', 'right', 'projector', 'path')
    cameras = node.get('cameras', {}).value
    left, right = (read_camera(name, _overlaid(node.get(name), cameras))
                   for name in ('left', 'right'))
    for field in ('width', 'height', 'distortion_model'):
        if getattr(left, field) != getattr(right, field):
            raise SceneError(f'{node.path}.right.{field} = {getattr(right, field)!r}, expected '
                             f'that of the left camera, {getattr(left, field)!r}')
    limits = node.get('depth_limits').vector(2, 0.001, 1000.0)
    if limits[0] >= limits[1]:
        node.get('depth_limits').fail('the nearer limit first')
    return Rig(node.get('name', 'custom').text(), left, right,
               read_projector(node.get('projector', {})), limits, read_path(node))


def _overlaid(node, defaults):
    """Return a Reader of the mapping with defaults for missing fields."""
    return type(node)({**defaults, **(node.value or {})}, node.path, node.folder)


def read_camera(name, node):
    """Return the Camera of a mapping; see docs/simulation.md for the fields."""
    node.only('width', 'height', 'focal', 'center', 'skew', 'distortion_model', 'distortion',
              'position', 'rotation', 'exposure', 'sensitivity', 'crosstalk', 'vignetting',
              'lens_blur', 'bayer', 'demosaicing', 'full_well', 'read_noise', 'speckle',
              'dark_level', 'response', 'bits')
    width, height = (node.get(field).integer(8, 8192) for field in ('width', 'height'))
    focal = node.get('focal').pair(1.0, 1e5)
    center = node.get('center', [(width - 1) / 2, (height - 1) / 2]).vector(2)
    skew = node.get('skew', 0.0).number(-1e4, 1e4)
    model = node.get('distortion_model', 'plumb_bob').choice(LENSES)
    distortion = [item.number() for item in node.get('distortion', []).items()]
    lengths = LENSES[model].lengths
    if len(distortion) not in lengths:
        node.get('distortion').fail(f'{" or ".join(map(str, lengths))} numbers for {model}')
    if not distortion:
        distortion = [0.0] * lengths[-1]
    return Camera(
        name=name, width=width, height=height,
        K=np.array([[focal[0], skew, center[0]], [0, focal[1], center[1]], [0, 0, 1]]),
        distortion_model=model, D=np.array(distortion, np.float64), pose=read_pose(node),
        **_read_electronics(node))


def _read_electronics(node):
    return {
        'exposure': _read_exposure(node),
        'sensitivity': node.get('sensitivity', [1.0, 1.0, 0.5]).vector(3, 0.0, 10.0),
        'crosstalk': node.get('crosstalk', 0.0).number(0.0, 0.5),
        'vignetting': node.get('vignetting', 0.0).number(0.0, 1.0),
        'lens_blur': node.get('lens_blur', 0.0).number(0.0, 20.0),
        'bayer': node.get('bayer', 'RGGB').choice(BAYER_LAYOUTS),
        'demosaicing': node.get('demosaicing', 'bilinear').choice(DEMOSAICING),
        'full_well': node.get('full_well', 50000.0).number(10.0, 1e7),
        'read_noise': node.get('read_noise', 30.0).number(0.0, 1e5),
        'speckle': node.get('speckle', 0.0).number(0.0, 1.0),
        'dark_level': node.get('dark_level', 2.0).number(0.0, 128.0),
        'response': _read_response(node.get('response', 'linear')),
        'bits': node.get('bits', 8).integer(1, 16)}


def _read_exposure(node):
    if node.get('exposure', 'auto').value == 'auto':
        return 0.0
    return node.get('exposure').number(1e-6, 1e6)


def _read_response(node):
    if isinstance(node.value, str):
        return node.choice(('linear', 'srgb'))
    return node.number(0.1, 10.0)


def read_projector(node):
    """Return the Projector of a mapping; see docs/simulation.md for the fields."""
    node.only('position', 'rotation', 'field_of_view', 'power', 'gamma', 'black_level', 'blur',
              'aperture', 'focus', 'offset')
    return Projector(
        pose=read_pose(node),
        field_of_view=node.get('field_of_view', 46.0).number(1.0, 150.0),
        power=node.get('power', 1.0).number(0.0, 1e6),
        gamma=node.get('gamma', 1.0).number(0.1, 10.0),
        black_level=node.get('black_level', 0.0).number(0.0, 1.0),
        blur=node.get('blur', 0.4).number(0.0, 100.0),
        aperture=node.get('aperture', 0.0).number(0.0, 1.0),
        focus=node.get('focus', 0.4).number(0.001, 1000.0),
        offset=node.get('offset', 0.0).number(-2.0, 2.0))

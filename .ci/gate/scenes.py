# SPDX-License-Identifier: Apache-2.0
"""
Raw pairs of synthetic scenes, made without the package.

Each pixel of each raw camera is a ray. The ray ends on a strip or on the surface behind it, and
the point there has the color that the projector throws on it, times the albedo of the surface. A
point that the strip hides from the projector lies in shadow.

Coordinates are meters in a frame midway between the cameras: x right, y down, z forward.

"""

from dataclasses import dataclass
from functools import lru_cache
import zlib

import cv2
import numpy as np

BASELINE = 0.06          # m
FOCAL = 0.94             # of the image width
DISTANCE = 0.5           # m, of the middle of most scenes
PATTERN_SCALE = 0.75     # pattern widths per unit of the tangent: all that cameras see is lit
PATTERN_SAMPLES = 1.6    # pattern columns per image column: a feature is a little smaller there
PROJECTOR = np.array([0.005, -0.03, 0.0])  # m
TURNS = 8                # of the search for the end of a ray


@dataclass(frozen=True)
class Strip:
    """A vertical strip that stands before the surface."""

    first: float
    """Left edge, m."""
    last: float
    """Right edge, m."""
    z: float
    """m."""


@dataclass(frozen=True)
class Scene:
    """What the cameras look at, and how they see it."""

    slope_x: float = 0.0
    """Of the surface, m per m."""
    slope_y: float = 0.0
    """Of the surface, m per m."""
    wave: float = 0.0
    """Amplitude of waves on the surface, m."""
    ball: float = 0.0
    """Radius of a ball that is half sunk into the surface, m."""
    strips: tuple = ()
    print: float = 0.0  # noqa: A003
    """Contrast of what is printed on the surface, 0..1."""
    signal: float = 150.0
    """Of white under full light, DN."""
    ambient: float = 5.0
    """DN."""
    noise: float = 0.25
    """Variance per signal, DN."""
    dark_corner: bool = False
    bright_spot: bool = False
    gains: tuple = (1.0, 1.0, 1.0)
    """Channel gains of the right camera; the left one has 1."""


SCENES = {
    'plane': Scene(),
    'slanted': Scene(slope_x=0.55, slope_y=-0.3, print=0.4),
    'strip': Scene(slope_y=0.2, strips=(Strip(-0.07, 0.03, 0.4),)),
    'fence': Scene(strips=(Strip(-0.16, -0.13, 0.41), Strip(-0.05, -0.04, 0.44),
                           Strip(0.08, 0.17, 0.39)), print=0.3),
    'wave': Scene(wave=0.012, slope_x=-0.1),
    'ball': Scene(ball=0.11, slope_y=0.15, print=0.2),
    'noisy': Scene(slope_x=0.2, signal=60.0, noise=2.5, strips=(Strip(-0.02, 0.09, 0.42),)),
    'dark corner': Scene(wave=0.006, dark_corner=True, ambient=1.0),
    'bright spot': Scene(ball=0.08, bright_spot=True, signal=230.0, ambient=14.0),
    'bright room': Scene(slope_x=-0.2, ambient=60.0, signal=120.0, print=0.3),
    'unlike cameras': Scene(slope_y=-0.25, strips=(Strip(0.0, 0.08, 0.43),),
                            gains=(1.25, 0.9, 0.7)),
}
NONSENSE = 'black', 'noise', 'white'
"""Images of nothing."""


def plain(scene, size, rig, pattern):
    """Return the raw pair of a scene of SCENES or NONSENSE, uint8 (2, H, W, 3), RGB."""
    width, height = size
    rng = np.random.default_rng(zlib.crc32(f'{scene} {size} {rig}'.encode()))
    if scene == 'noise':
        return rng.integers(0, 256, (2, height, width, 3), np.uint8)
    if scene in NONSENSE:
        return np.full((2, height, width, 3), 255 if scene == 'white' else 0, np.uint8)
    return np.stack([photograph(SCENES[scene], rays(rig, size, side), side, pattern, rng)
                     for side in (0, 1)])


VARIANTS = {
    'swapped': lambda pair: pair[::-1],
    'dimmed': lambda pair: pair // 3,
    'upside down': lambda pair: pair[:, ::-1],
    'gray': lambda pair: np.repeat(pair[..., 1:2], 3, axis=-1),
}
"""Name to what is done to the pair before, uint8 (2, H, W, 3)."""


def calibration_of(rig, size):
    """
    Return the description of a calibration, see `gate.worker.stereo_calibration`.

    Parameters
    ----------
    rig : str
        A name of RIGS.
    size : (int, int)
        Width and height, px.

    """
    if RIGS[rig].seen:
        return {'cameras': [_camera_model(rig, side, size) for side in (0, 1)]}
    K_left, K_right = (_camera_matrix(rig, size, side) for side in (0, 1))
    rotation, translation = right_from_left(rig)
    D_left, D_right = RIGS[rig].distortion
    return {'arrays': {
        'size': size, 'K_left': K_left.tolist(), 'D_left': D_left, 'K_right': K_right.tolist(),
        'D_right': D_right, 'R': rotation.tolist(), 't': translation.tolist(),
        'distortion_model': RIGS[rig].model}}


@dataclass(frozen=True)
class Rig:
    """Two cameras."""

    turned: tuple = (0.0, 0.0, 0.0)
    """Rotation vector of the right camera against the left one, rad."""
    model: str = 'plumb_bob'
    distortion: tuple = ((), ())
    """Coefficients of left and right."""
    moved: tuple = (0.0, 0.0)
    """Of the principal points of left and right, image widths."""
    seen: float = 0.0
    """Focal length of the rectified images, image widths; 0 = as StereoCalibration chooses."""
    tilt: float = 0.0
    """Rotation of the rectified cameras about the baseline, rad; only with `seen`."""


RIGS = {
    'parallel': Rig(),
    'usual': Rig((0.004, -0.006, 0.003), 'plumb_bob', ((-0.09, 0.06, 0.0004, -0.0003, 0.0),
                                                       (-0.10, 0.07, -0.0003, 0.0004, 0.0))),
    'verged': Rig((0.01, -0.17, -0.006), 'plumb_bob', ((-0.16, 0.03, 0.001, -0.001, 0.0),
                                                       (-0.14, 0.02, 0.0, 0.001, 0.0))),
    'rational': Rig((-0.003, 0.02, 0.004), 'rational_polynomial',
                    ((0.3, 0.05, 0.0003, -0.0002, 0.01, 0.42, 0.08, 0.02),
                     (0.28, 0.06, -0.0003, 0.0002, 0.01, 0.4, 0.09, 0.02))),
    'fisheye': Rig((0.005, -0.04, 0.002), 'equidistant', ((-0.02, 0.004, -0.001, 0.0),
                                                          (-0.018, 0.003, -0.001, 0.0))),
    'rectified': Rig(moved=(0.021, -0.021), seen=FOCAL),
    'wide': Rig(distortion=((-0.35, 0.0, 0.0, 0.0, 0.0), (-0.34, 0.0, 0.0, 0.0, 0.0)), seen=0.28,
                tilt=0.7),
}
"""
'rectified': the raw images are rectified ones, whose principal points differ. 'wide': rectified
images see so much that the distortion folds there, and that some rays come from behind.
"""


def right_from_left(rig):
    """Return rotation and translation: X_right = R X_left + t, t in m."""
    left, right = pose(rig, 0), pose(rig, 1)
    rotation = right[0] @ left[0].T
    return rotation, right[0] @ (left[1] - right[1])


def pose(rig, side):
    """Return rotation (from the middle frame into the camera) and center, m, of a camera."""
    sign = (-0.5, 0.5)[side]
    rotation = cv2.Rodrigues(sign * np.array(RIGS[rig].turned))[0]
    return rotation, np.array([sign * BASELINE, 0.0, 0.0])


def _camera_matrix(rig, size, side):
    width, height = size
    moved = RIGS[rig].moved[side] * width
    return np.array([[FOCAL * width, 0, (width - 1) / 2 + moved],
                     [0, FOCAL * width, (height - 1) / 2], [0, 0, 1.0]])


def _camera_model(rig, side, size):
    """Return the arguments of a CameraModel; the raw cameras of the rig must be parallel."""
    K, focal = _camera_matrix(rig, size, side), RIGS[rig].seen * size[0]
    P = np.column_stack([K, [-focal * BASELINE * side, 0, 0]])
    P[0, 0] = P[1, 1] = focal
    R = cv2.Rodrigues(np.array([RIGS[rig].tilt, 0, 0]))[0]
    return {'name': ('left', 'right')[side], 'width': size[0], 'height': size[1],
            'distortion_model': RIGS[rig].model, 'D': RIGS[rig].distortion[side] or [0.0] * 5,
            'K': K.ravel().tolist(), 'R': R.ravel().tolist(), 'P': P.ravel().tolist()}


@lru_cache(maxsize=16)
def rays(rig, size, side):
    """Return center (3,), m, and directions (H, W, 3), middle frame, of a camera's pixels."""
    width, height = size
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1)
    pixels = pixels.reshape(-1, 1, 2).astype(np.float64)
    K, D = _camera_matrix(rig, size, side), np.array(RIGS[rig].distortion[side])
    undistort = cv2.fisheye.undistortPoints if RIGS[rig].model == 'equidistant' else (
        cv2.undistortPoints)
    flat = undistort(pixels, K, D if D.size else np.zeros(4)).reshape(height, width, 2)
    rotation, center = pose(rig, side)
    directions = np.concatenate([flat, np.ones((height, width, 1))], axis=-1) @ rotation
    return center, directions / directions[..., 2:]


def photograph(scene, camera_rays, side, pattern, rng):
    """Return the raw image of a scene, uint8 (H, W, 3); pattern: uint8 (H', W', 3)."""
    points, front = hit(scene, *camera_rays)
    light = projected(pattern, points) * ~shadowed(scene, points, front)[..., None]
    albedo = albedo_of(scene, points, front)
    signal = scene.signal * (albedo[..., None] * light)
    if scene.bright_spot:
        signal += 400 * _bump(points, 0.05, 0.02, 0.03)[..., None]
    if scene.dark_corner:
        signal *= np.clip(1.6 - 6 * np.hypot(points[..., 0] + 0.1, points[..., 1] + 0.08),
                          0, 1)[..., None]
    image = scene.ambient + signal
    if side:
        image = image * np.array(scene.gains)
    image = cv2.GaussianBlur(image, (0, 0), 0.6)
    image += np.sqrt(1 + scene.noise * image) * rng.standard_normal(image.shape, np.float32)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def hit(scene, center, directions):
    """Return where rays end, (H, W, 3), m, and whether that is on a strip, bool (H, W)."""
    depth = np.full(directions.shape[:2], DISTANCE)
    for _ in range(TURNS):
        points = center + depth[..., None] * directions
        depth = surface_depth(scene, points[..., 0], points[..., 1])
    front = np.zeros(depth.shape, bool)
    for strip in scene.strips:
        x = center[0] + strip.z * directions[..., 0]
        on = (x >= strip.first) & (x < strip.last) & (strip.z < depth)
        depth, front = np.where(on, strip.z, depth), front | on
    return center + depth[..., None] * directions, front


def surface_depth(scene, x, y):
    """Return z of the surface, m."""
    z = DISTANCE + scene.slope_x * x + scene.slope_y * y
    if scene.wave:
        z = z + scene.wave * np.sin(42 * x + 9 * y) * np.cos(23 * y)
    if scene.ball:
        z = z - np.sqrt(np.maximum(scene.ball ** 2 - x ** 2 - (y - 0.02) ** 2, 0)) / 2
    return z


def projected(pattern, points):
    """Return the light of the projector at points, (H, W, 3), 0..1."""
    height, width = pattern.shape[:2]
    ray = points - PROJECTOR
    x, y = (count / 2 - 0.5 + PATTERN_SCALE * width * ray[..., axis] / ray[..., 2]
            for axis, count in ((0, width), (1, height)))
    return cv2.remap(pattern, x.astype(np.float32), y.astype(np.float32),
                     cv2.INTER_LINEAR).astype(np.float32) / 255


def shadowed(scene, points, front):
    """Return which points a strip hides from the projector, bool (H, W)."""
    hidden = np.zeros(front.shape, bool)
    for strip in scene.strips:
        share = (strip.z - PROJECTOR[2]) / (points[..., 2] - PROJECTOR[2])
        x = PROJECTOR[0] + share * (points[..., 0] - PROJECTOR[0])
        hidden |= (x >= strip.first) & (x < strip.last) & (share < 1 - 1e-9)
    return hidden & ~front


def albedo_of(scene, points, front):
    """Return the albedo of the surface at points, (H, W)."""
    x, y = points[..., 0], points[..., 1]
    print_ = scene.print * np.sign(np.sin(70 * x) * np.sin(55 * y + 1)) / 2
    return np.where(front, 0.55, 0.8 + 0.05 * np.sin(90 * y + 6 * np.sin(30 * x)) - print_)


def _bump(points, x, y, radius):
    """Return a Gaussian around a place, (H, W)."""
    square = (points[..., 0] - x) ** 2 + (points[..., 1] - y) ** 2
    return np.exp(-square / (2 * radius ** 2))


def pattern_size(size):
    """Return width and height of the pattern for images of a size, px."""
    width, height = (max(32, round(PATTERN_SAMPLES * count)) for count in size)
    return width, height

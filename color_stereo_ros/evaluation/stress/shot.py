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
"""From the light of a scene to the pair that a disturbed rig takes of it."""

from dataclasses import replace

import cv2
import numpy as np

from .rig import CAMERA
from .warp_kernels import bicubic
from ...core import ImageError

LENS_BLUR = 0.5   # px, standard deviation of every lens
BLUR_STEP = 0.25  # px, between the images of which uneven blur is made
INK = np.float32([1.0, 0.85, 0.7])  # share of red, green and blue that full print takes
SIDES = ('left', 'right')


class Shots:
    """
    Takes pairs of scenes; what disturbances share is made once.

    Parameters
    ----------
    scene : color_stereo_ros.evaluation.stress.light.LightScene
    seed : int
        Of the noise.

    """

    def __init__(self, scene, seed=1):
        self.scene = scene
        self.seed = seed
        self._kept = {}

    def kept(self, key, make):
        """Return what was made for a key, or make it; the oldest are forgotten."""
        if key not in self._kept:
            while len(self._kept) > 8:
                self._kept.pop(next(iter(self._kept)))
            self._kept[key] = make()
        return self._kept[key]

    def truth(self, mounting):
        """Return the Truth under a mounting of the right camera."""
        return self.kept(('truth', mounting), lambda: self.scene.truth(mounting))

    def pair(self, rig, number=1, gains=(1.0, 1.0, 1.0)):
        """
        Take a pair.

        Parameters
        ----------
        rig : StressRig
            The disturbed cameras.
        number : int
            Of the pair: another number is other noise.
        gains : tuple of 3 floats
            Of the right camera in this pair.

        Returns
        -------
        left, right : numpy.ndarray, uint8, shape (H, W, 3)
            Raw, RGB.

        """
        from ...sim.electronics import expose
        exposure = self._exposure(rig)
        images = []
        for index, (side, view) in enumerate(zip(SIDES, rig.views)):
            light = self._gained(self._view(rig, side), view).astype(np.float64)
            if side == 'right':
                light = light * np.asarray(gains)
            mosaic = expose(light, self._camera(side, view), exposure * view.exposure,
                            np.random.SeedSequence([self.seed, number, index]))
            images.append(finished(mosaic, view, np.random.default_rng([self.seed, index])))
        return tuple(images)

    def _camera(self, side, view=None):
        """Return the simulated camera of one side."""
        from ...sim.geometry import Pose
        from ...sim.rig import Camera
        model = getattr(self.scene.calibration, side)
        return Camera(name=side, width=model.width, height=model.height, K=model.K,
                      distortion_model=model.distortion_model, D=model.D,
                      pose=Pose(np.eye(3), np.zeros(3)),
                      **{**CAMERA, **(view.camera if view else {})})

    def _exposure(self, rig):
        """Return the automatic exposure, the same for both cameras."""
        def measured():
            from ...sim.electronics import exposures_for
            light = [self.scene.cropped(light_of(self.scene, rig, side)) for side in SIDES]
            return exposures_for(light, [self._camera(side) for side in SIDES])[0]
        if rig.plain_light:
            return self.kept(('exposure', rig.pattern), measured)
        return measured()

    def _view(self, rig, side):
        """Return the light on the chip of one camera, float32 (H, W, 3)."""
        view = getattr(rig, side)
        model, scene = getattr(self.scene.calibration, side), self.scene
        mounting = rig.mounting if side == 'right' else type(rig.mounting)()

        def fine():
            return through_lens(light_of(scene, rig, side), view, scene)

        def seen(light):
            return mounting.view(light, model, scene.scale, scene.margin)

        sharp = not (view.blur or view.uneven_blur or any(view.motion) or view.chromatic)
        if not (rig.plain_light and sharp):
            return seen(fine())
        if mounting.exact:
            return self.kept(('view', side, rig.pattern), lambda: seen(fine()))
        return seen(self.kept(('fine', side, rig.pattern), fine))

    @staticmethod
    def _gained(light, view):
        """Return light with gains that vary over the image."""
        height, width = light.shape[:2]
        y = np.linspace(-1, 1, height)[:, None, None]
        x = np.linspace(-1, 1, width)[None, :, None]
        for gains in view.gains:
            light = light * gains(y, x)
        return light


def light_of(scene, rig, side):
    """Return the light of a scene under the rig's projector and surroundings, fine."""
    light = scene.light(side, rig.pattern)
    if rig.black:
        light = rig.black * scene.light(side, 'white') + (1 - rig.black) * light
    light = light * np.float32(rig.projector_gains)
    if any(rig.ambient):
        share = scene.light('left', rig.pattern).mean() / max(
            scene.light('left', 'ambient').mean(), 1e-9)
        light = light + scene.light(side, 'ambient') * np.float32(rig.ambient) * share
    if rig.printed:
        light = light * (1 - rig.printed * scene.mask(side, 'ink') * INK)
    if rig.object_color:
        light = light * (1 - scene.mask(side, 'object') * (1 - np.float32(rig.object_color)))
    return light


def through_lens(light, view, scene):
    """Return fine light behind a lens that is out of focus, moves, or scatters colors."""
    if view.uneven_blur:
        light = unevenly_blurred(light, view, scene.scale)
    else:
        light = out_of_focus(light, view.blur, scene.scale)
    if any(view.motion):
        light = cv2.filter2D(light, -1, streak(*(scene.scale * step for step in view.motion)),
                             borderType=cv2.BORDER_REPLICATE)
    if view.chromatic:
        light = _scattered(light, view.chromatic, scene)
    return light


def out_of_focus(light, sigma, scale):
    """Return fine light behind a lens; sigma: of its blur beside LENS_BLUR, px."""
    return cv2.GaussianBlur(light, (0, 0), scale * float(np.hypot(LENS_BLUR, sigma)))


def unevenly_blurred(light, view, scale):
    """Return fine light behind a lens whose blur varies, see `View.uneven_blur`."""
    height, width = light.shape[:2]
    sigma = np.broadcast_to(view.uneven_blur(np.linspace(-1, 1, height)[:, None],
                                             np.linspace(-1, 1, width)[None]), (height, width))
    steps = np.arange(int(np.ceil(sigma.max() / BLUR_STEP)) + 1)
    blurred = np.zeros_like(light)
    for step in steps:  # each place lies between two of them
        share = np.clip(1 - np.abs(sigma / BLUR_STEP - step), 0, 1).astype(np.float32)
        here = float(np.hypot(view.blur, BLUR_STEP * step))
        blurred += share[..., None] * out_of_focus(light, here, scale)
    return blurred


def streak(along, down):
    """Return the kernel of a motion by so many pixels along and down, float32, sum 1."""
    size = 2 * int(np.ceil(max(abs(along), abs(down)) / 2)) + 1
    kernel = np.zeros((size, size), np.float32)
    for share in np.linspace(-0.5, 0.5, 101):
        kernel[int(round(size // 2 + share * down)), int(round(size // 2 + share * along))] += 1
    return kernel / kernel.sum()


def _scattered(light, distance, scene):
    """Scale red and blue about the middle so that they lie so many px apart in the corners."""
    height, width = light.shape[:2]
    corner = np.hypot(*(size / scene.scale - 2 * scene.margin for size in (width, height))) / 2
    row, column = np.indices((height, width), np.float64)
    light = light.copy()
    for channel, share in ((0, -0.5), (2, 0.5)):
        factor = 1 + share * distance / corner
        places = [np.clip((place - (size - 1) / 2) * factor + (size - 1) / 2, 1, size - 3)
                  for place, size in ((column, width), (row, height))]
        single = np.ascontiguousarray(light[..., channel:channel + 1])
        scaled = bicubic(single, *(each.ravel() for each in places),
                         np.empty((single.size, 1), np.float32))
        light[..., channel] = scaled.reshape(height, width)
    return light


def finished(mosaic, view, generator):
    """Return the image that leaves the camera, uint8 (H, W, 3), from the numbers of its chip."""
    if view.hot:
        mosaic = with_hot_pixels(mosaic, view.hot, generator)
    image = mosaic if mosaic.ndim == 3 else demosaiced(mosaic, view.demosaicing)
    if view.unsharp:
        smooth = cv2.GaussianBlur(image.astype(np.float32), (0, 0), 1.0)
        image = image + view.unsharp * (image - smooth)
        image = np.clip(np.round(image), 0, 255).astype(np.uint8)
    if view.gray:
        image = np.repeat(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)[..., None], 3, axis=2)
    return compressed(image, view.jpeg) if view.jpeg else image


def with_hot_pixels(mosaic, share, generator):
    """Return a mosaic in which a share of the pixels is bright."""
    mosaic = mosaic.copy()
    count = round(share * mosaic.size)
    places = generator.choice(mosaic.size, count, replace=False)
    mosaic.ravel()[places] = generator.integers(120, 256, count)
    return mosaic


def demosaiced(mosaic, kind):
    """Return the RGB image of an RGGB mosaic."""
    # OpenCV names a layout by the second row, second and third pixel.
    suffix = {'bilinear': '', 'edge_aware': '_EA', 'vng': '_VNG'}[kind]
    return cv2.cvtColor(mosaic, getattr(cv2, f'COLOR_BayerBG2RGB{suffix}'))


def compressed(image, quality):
    """Return an image after JPEG 4:2:0."""
    done, code = cv2.imencode('.jpg', image[..., ::-1], [
        cv2.IMWRITE_JPEG_QUALITY, int(quality),
        cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420])
    if not done:
        raise ImageError(f'JPEG of quality {quality} was not made')
    return np.ascontiguousarray(cv2.imdecode(code, cv2.IMREAD_COLOR)[..., ::-1])


def moved(rig, **changes):
    """Return a rig with another mounting."""
    return replace(rig, mounting=replace(rig.mounting, **changes))

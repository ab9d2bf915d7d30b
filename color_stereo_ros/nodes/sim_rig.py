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
The simulated rig as a node: pattern/image in, the raw images of both cameras out.

A thread renders what the pattern makes of the scene; a timer publishes it at the rate of the
cameras, each time with new noise, so the node answers while it renders.

"""

from dataclasses import dataclass
import threading
import time

import numpy as np

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions

from sensor_msgs.msg import CameraInfo, Image

from .filling import message_of
from .parameters import NodeParameters, Reloadable
from .pattern_source import latched
from ..errors import brief, ColorStereoError, SettingsError
from ..messages.contents import camera_info, Header, image
from ..messages.reading import image_to_rgb
from ..messages.synchronizer import LatestSlot
from ..parameters.groups import SimRigSettings
from ..sim import load_scene, Renderer
from ..sim.electronics import expose, exposures_for

PATIENCE = 2.0  # s that the end of the node waits for the renderer


@dataclass(frozen=True, eq=False)
class _View:
    """The light of one frame of the scene's sequence."""

    radiance: tuple
    exposures: tuple


@dataclass(frozen=True, eq=False)
class _Film:
    """All frames of a scene under one pattern."""

    scene: object
    views: list


class SimRigNode(Reloadable, Node):
    """Publishes left|right/image_raw and camera_info of a scene under pattern/image."""

    def __init__(self):
        super().__init__('sim_rig_node', automatically_declare_parameters_from_overrides=True)
        self._scene = None
        self._film = None
        self._pattern = None
        self._job = None
        self._count = 0
        self._timer = None
        self._slot = LatestSlot()
        parameters = NodeParameters(self, SimRigSettings(), check=self._check,
                                    on_change=self._changed)
        parameters.warn_of_unknown()
        self._settings = parameters.settings.sim
        self._scene = _load(self._settings)
        self._outputs = self._make_publishers()
        self.create_subscription(
            Image, 'pattern/image', self._show, latched(),
            qos_overriding_options=QoSOverridingOptions.with_default_policies())
        self._start_timer()
        self._thread = threading.Thread(target=self._work, name='sim_rig', daemon=True)
        self._thread.start()
        self.get_logger().info(f'scene {self._scene.name} on the rig {self._scene.rig.name}: '
                               f'waiting for {self.resolve_topic_name("pattern/image")}')

    def destroy_node(self):
        """End the renderer's thread, then the node."""
        self._slot.close()
        self._thread.join(PATIENCE)
        super().destroy_node()

    def _make_publishers(self):
        options = QoSOverridingOptions.with_default_policies()
        return {(side, kind): self.create_publisher(kind, f'{side}/{topic}', QoSProfile(depth=10),
                                                    qos_overriding_options=options)
                for side in ('left', 'right')
                for kind, topic in ((CameraInfo, 'camera_info'), (Image, 'image_raw'))}

    def _check(self, settings):
        """Refuse scenes that cannot be loaded; no peer chooses where files are written."""
        if self._scene is not None and settings.sim.cache != self._settings.cache:
            raise SettingsError(f'sim.cache = {brief(settings.sim.cache)} is refused: the folder '
                                f'is fixed at the start of the node')
        _load(settings.sim)

    def _changed(self, settings):
        old, self._settings = self._settings, settings.sim
        if settings.sim.rate != old.rate:
            self._start_timer()
        self._scene = _load(settings.sim)
        self._render_again()

    def _start_timer(self):
        if self._timer is not None:
            self.destroy_timer(self._timer)
        self._timer = self.create_timer(1 / self._settings.rate, self._publish)

    def _show(self, message):
        """Take a new pattern."""
        try:
            self._pattern = np.array(image_to_rgb(message))
        except ColorStereoError as error:
            self.get_logger().error(f'pattern/image: {error}')
            return
        self._render_again()

    def _render_again(self):
        if self._pattern is not None:
            self._job = self._scene, self._pattern, self._settings
            self._slot.put(self._job)

    def _work(self):
        """Render whatever is newest, until the node ends."""
        renderers = {}
        while not self._slot.closed:
            job = self._slot.take()
            if job is None:
                continue
            try:
                film = self._film_of(job, renderers)
            except Exception as error:  # a scene that fails must not end the node
                self.get_logger().error(f'{type(error).__name__}: {error}')
                continue
            self._film = film or self._film

    def _film_of(self, job, renderers):
        """Return the frames of a job, or None if a newer one or the end of the node came up."""
        scene, pattern, settings = job
        started = time.monotonic()
        key = scene.fingerprint, settings.samples, settings.indirect, settings.cache
        if key not in renderers:
            renderers.clear()
            renderers[key] = [Renderer(scene, samples=settings.samples, frame=frame,
                                       indirect=settings.indirect and scene.indirect,
                                       cache=settings.cache or None)
                              for frame in range(scene.frames)]
        views = []
        for renderer in renderers[key]:
            cameras = (scene.rig.left, scene.rig.right)
            radiance = []
            for camera in cameras:
                if self._slot.closed or self._job is not job:
                    return None
                radiance.append(renderer.radiance(camera, pattern))
            views.append(_View(tuple(radiance), exposures_for(radiance, cameras)))
        self.get_logger().info(f'scene {scene.name}: a pattern of {pattern.shape[1]} x '
                               f'{pattern.shape[0]} px rendered in '
                               f'{time.monotonic() - started:.1f} s')
        return _Film(scene, views)

    def _publish(self):
        """Publish a frame of both cameras."""
        film = self._film
        if film is None:
            return
        view = film.views[self._count % len(film.views)]
        rig = film.scene.rig
        now = self.get_clock().now().nanoseconds
        for index, camera in enumerate((rig.left, rig.right)):
            seed = np.random.SeedSequence([self._settings.seed, self._count, index])
            pixels = expose(view.radiance[index], camera, view.exposures[index], seed)
            header = Header.at(now, f'{camera.name}_camera_optical_frame')
            info = camera_info(getattr(rig.calibration, camera.name), header)
            self._outputs[camera.name, CameraInfo].publish(message_of(info))
            self._outputs[camera.name, Image].publish(message_of(_image(pixels, camera, header)))
        self._count += 1


def _load(settings):
    return load_scene(settings.scene, rig=settings.rig or None)


def _image(pixels, camera, header):
    """Return the content of a raw image: rgb8, or the mosaic of the sensor."""
    if pixels.dtype != np.uint8:
        pixels = (pixels >> (camera.bits - 8)).astype(np.uint8)
    encoding = 'rgb8' if pixels.ndim == 3 else f'bayer_{camera.bayer.lower()}8'
    return image(pixels, encoding, header)

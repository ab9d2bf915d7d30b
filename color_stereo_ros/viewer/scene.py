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
"""Frames as things of a viser scene: points, pictures, marks."""

import numpy as np

from .pictures import legends_of, pictures_of, point_colors
from .wall import FIELD, Wall
from ..core.triangulation import rays
from ..pages.serving import QUALITY

MARK = (214, 39, 110)
SECOND = (20, 120, 220)
PLANE = (20, 150, 90)
MARK_SIZE = 0.012
"""Of the depth; chosen: visible, and hides little."""
SHEET = 0.15
"""Size of the sheet of a plane, of the depth; chosen: its tilt shows."""
TITLE = 0.065
"""Height of a title, of that of its picture; chosen: it fits between two pictures."""
FRONT = 0.002
"""Of the depth: so far before a picture its marks are."""


class Scene:
    """
    What the browser draws.

    Parameters
    ----------
    server : viser.ViserServer
    frame : Frame
        The first one: the pictures stand at the depth of its points.
    precision : str
        'float32' or 'float16', of the points.

    """

    def __init__(self, server, frame, precision='float32'):
        self._server, self._precision = server, precision
        self.wall = Wall(frame.result.geometry, 0.5 * sum(frame.depth_limits))
        server.scene.set_up_direction('-y')
        server.scene.world_axes.visible = False
        self._camera()
        self._points = None
        self._pictures, self._titles, self._legends, self._marks = {}, {}, {}, {}
        self.colors, self.point_size = 'camera', 1.0

    def _camera(self):
        camera, (position, look_at) = self._server.initial_camera, self.wall.camera()
        camera.fov = float(FIELD)
        camera.near, camera.far = 0.02 * self.wall.depth, 100 * self.wall.depth
        camera.position, camera.look_at, camera.up = position, look_at, (0.0, -1.0, 0.0)

    def show(self, frame, step=1, picture_step=1):
        """
        Show a frame.

        Parameters
        ----------
        frame : Frame
            The measured pair that is shown.
        step, picture_step : int
            Every step-th pixel of every step-th row, of the points and of the pictures.

        """
        with self._server.atomic():
            self.show_points(frame, step)
            self._show_pictures(pictures_of(frame, picture_step))
            self._show_legends(legends_of(frame))

    def show_points(self, frame, step=1):
        """Show the points of a frame in the colors that are chosen."""
        part = np.s_[::step, ::step]
        geometry = frame.result.geometry
        known = np.isfinite(frame.result.depth[part])
        # points are made of the pixels that are shown
        rays_x, rays_y = (each[::step] for each in rays(geometry))
        rows, columns = np.nonzero(known)
        depth = frame.result.depth[part][known]
        # from the middle: small numbers are rounded less where they are sent as float16
        middle = 0.0, 0.0, self.wall.depth
        points = np.column_stack((depth * rays_x[columns], depth * rays_y[rows],
                                  depth - np.float32(middle[2])))
        colors = point_colors(frame, self.colors)[part][known]
        size = self.point_size * step * self.wall.depth / geometry.focal_x
        if self._points is None:
            self._points = self._server.scene.add_point_cloud(
                '/points', points, colors, precision=self._precision, position=middle,
                point_size=size, point_shape='square', point_shading='flat')
            return
        self._points.points, self._points.colors = points, colors
        self._points.point_size = size

    def _show_pictures(self, pictures):
        for name, (title, image) in pictures.items():
            if name not in self._pictures:
                place = self.wall.places[name]
                self._pictures[name] = self._picture(f'/pictures/{name}', image, place.corner,
                                                     place.width, place.height)
                self._titles[name] = self._server.scene.add_label(
                    f'/titles/{name}', title, anchor='bottom-left',
                    position=(*place.corner, self.wall.depth), font_size_mode='scene',
                    font_scene_height=TITLE * place.height)
                continue
            self._pictures[name].image = image
            if self._titles[name].text != title:
                self._titles[name].text = title
        for name, handle in self._pictures.items():
            if handle.visible != (name in pictures):
                handle.visible = self._titles[name].visible = name in pictures

    def _picture(self, name, image, corner, width, height):
        """Add an image with its upper left corner at a place of the wall."""
        return self._server.scene.add_image(
            name, image, width, height, format='jpeg', jpeg_quality=QUALITY, cast_shadow=False,
            receive_shadow=False,
            position=(corner[0] + width / 2, corner[1] + height / 2, self.wall.depth))

    def _show_legends(self, legends):
        """Show strips beside their pictures, those that are not there yet."""
        for name, strip in legends.items():
            if np.array_equal(self._legends.get(name), strip):
                continue
            self._legends[name] = strip
            place = self.wall.places[name]
            self._picture(f'/legends/{name}', strip, (place.corner[0] + place.width,
                                                      place.corner[1]),
                          place.height * strip.shape[1] / strip.shape[0], place.height)

    def mark(self, name, spots, color=MARK):
        """
        Put small balls at some places of the scene.

        Parameters
        ----------
        name : str
            Marks of the same name are replaced.
        spots : list of array-like, shape (3,)
            m.
        color : (int, int, int)
            RGB, 0..255.

        """
        self.unmark(name)
        radius = 0.5 * MARK_SIZE * self.wall.depth
        self._marks[name] = [
            self._server.scene.add_icosphere(f'/marks/{name}/{at}', radius=radius, color=color,
                                             position=np.asarray(spot, float), cast_shadow=False,
                                             receive_shadow=False)
            for at, spot in enumerate(spots)]

    def line(self, name, first, second, text):
        """Draw a line between two places with a text at its middle; `unmark` removes it."""
        self.unmark(name)
        scene = self._server.scene
        ends = np.array([[first, second]], np.float32)
        self._marks[name] = [
            scene.add_line_segments(f'/marks/{name}/line', ends, SECOND, thickness=3.0,
                                    thickness_units='screen'),
            scene.add_label(f'/marks/{name}/text', text, position=ends[0].mean(axis=0),
                            anchor='bottom-center')]

    def sheet(self, name, center, normal, before):
        """
        Draw a square sheet; `unmark` removes it.

        Parameters
        ----------
        name : str
            The name by which it is found.
        center, normal : numpy.ndarray, float64, shape (3,)
            m; unit.
        before : float
            m along the normal, so that points of the plane do not hide it.

        """
        self.unmark(name)
        size = SHEET * self.wall.depth
        center = center + (before + FRONT * self.wall.depth) * normal
        first = np.cross(normal, (0.0, 1.0, 0.0))
        first /= np.linalg.norm(first)
        second = np.cross(normal, first)
        corners = np.array([center + size / 2 * (a * first + b * second)
                            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
        self._marks[name] = [self._server.scene.add_mesh_simple(
            f'/marks/{name}', corners, np.array([[0, 1, 2], [0, 2, 3]]), color=PLANE, opacity=0.4,
            side='double', cast_shadow=False, receive_shadow=False)]

    def unmark(self, *names):
        """Remove marks; without names all of them."""
        for name in names or list(self._marks):
            for handle in self._marks.pop(name, []):
                handle.remove()

    def before(self, point):
        """Return a place so far before a point that its mark is not hidden, float64 (3,), m."""
        point = np.asarray(point, np.float64)
        return point * (1 - 0.5 * MARK_SIZE * self.wall.depth / np.linalg.norm(point))

    def on_picture(self, name, x, y):
        """Return a place a little before a pixel of a picture, float64 (3,), m."""
        return self.wall.spot(name, x, y) - [0, 0, FRONT * self.wall.depth]

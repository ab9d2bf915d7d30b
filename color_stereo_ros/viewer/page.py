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
"""The page of `color_stereo view`: a scene, a panel, and what happens at a click."""

from dataclasses import dataclass
from threading import Condition, RLock
import time

import cv2
import numpy as np

from .measuring import distance, fitted_plane, inside_box, inside_polygon, point_on_ray
from .pictures import LEFT, POINT_COLORS, RIGHT
from .scene import Scene, SECOND
from .telling import about_distance, about_frame, about_pixel, about_plane, HOW_TO
from ..errors import ColorStereoError
from ..pages.serving import ServedPage

TITLE = 'color_stereo view'
VIEWS = {'All': 'all', 'Points': 'points', 'Pictures': 'pictures'}
PERIOD = 0.2
"""s between two frames that play; chosen: browsers without a graphics card draw as many."""
MOVING_POINTS, MOVING_WIDTH = 30_000, 160
"""Points, and px of a picture, while frames follow each other; chosen: 8 ms of a processor."""
HALF, ZOOM = 12, 8
"""px around a pixel, and how much larger they are shown."""
NO_CURVE = np.array([0.0, 1.0])


@dataclass(frozen=True)
class BrowserCamera:
    """The camera of a browser, see `measuring.inside_box`."""

    position: np.ndarray
    rotation: np.ndarray
    fov: float
    aspect: float

    @classmethod
    def of(cls, camera):
        """Take that of a viser client."""
        from viser.transforms import SO3
        return cls(np.asarray(camera.position), SO3(np.asarray(camera.wxyz)).as_matrix(),
                   float(camera.fov), float(camera.aspect))


class ViewPage(ServedPage):
    """
    Serves frames until it is closed.

    Parameters
    ----------
    host, port : str, int
        As for `ServedPage`.
    frame : Frame
        The first one.
    frames : MeasuredFrames, optional
        All frames, the first of which is `frame`; None: `show` brings the next ones.

    """

    def __init__(self, host, port, frame, frames=None):
        super().__init__(host, port, TITLE, dark=True)
        self._frames, self._index = frames, 0
        self._lock, self._changed = RLock(), Condition()
        self._wanted, self._moving = 0, False
        self._picked, self._corners = None, []
        self.frame = frame
        """The Frame that is shown."""
        self.scene = Scene(self.server, frame)
        self._add_panel()
        self.server.scene.on_click()(lambda event: self._click(event, False))
        self.server.scene.on_click(modifier='cmd/ctrl')(lambda event: self._click(event, True))
        self.server.scene.on_click(modifier='shift')(self._add_corner)
        self.server.scene.on_rect_select(modifier='shift')(self._select)
        self.server.on_client_connect(self._greet)
        self.show(frame)

    def _greet(self, client):
        """Show all to a new browser, once more when the panel has taken its place."""
        aspects = [client.camera.aspect]
        self._look(client, 'all')

        def look_again(camera):
            if len(aspects) == 1 and camera.aspect != aspects[0]:
                aspects.append(camera.aspect)
                self._look(client, 'all')

        client.camera.on_update(look_again)

    def _add_panel(self):
        gui = self.server.gui
        self._about = gui.add_markdown('')
        self._add_time(gui)
        with gui.add_folder('View'):
            views = gui.add_button_group('look at', tuple(VIEWS))
            views.on_click(lambda event: self._look(event.client, VIEWS[views.value]))
            self._colors = gui.add_dropdown('points', tuple(POINT_COLORS))
            self._size = gui.add_slider('size', 0.5, 4.0, 0.1, 1.2)
        for handle in (self._colors, self._size):
            handle.on_update(lambda event: self._restyle())
        self.scene.point_size = self._size.value
        with gui.add_folder('Pixel'):
            self._told = gui.add_markdown(HOW_TO)
            self._curve = gui.add_uplot(
                (NO_CURVE, NO_CURVE, NO_CURVE), self._series(), visible=False, aspect=1.7,
                title='cost of the coarse search', scales={'x': {'time': False}},
                axes=tuple({'stroke': '#9aa1ad', 'grid': {'stroke': '#3b424d'}, 'label': label}
                           for label in ('disparity, px', 'cost')))
            self._patches = gui.add_image(np.zeros((8, 8, 3), np.uint8), visible=False,
                                          label='left and right camera, around the match')
        with gui.add_folder('Measure'):
            self._distance = gui.add_markdown('Distance: click, then Ctrl and click.')
            self._plane = gui.add_markdown('Plane: hold Shift, and drag a box over points or over '
                                           'a picture, or click around them.')
            gui.add_button('Remove marks').on_click(lambda event: self._clear())

    @staticmethod
    def _series():
        return ({'label': 'px'}, {'label': 'along paths', 'stroke': '#e0559a', 'width': 2},
                {'label': 'of the window', 'stroke': '#4aa3ff', 'width': 1})

    def _add_time(self, gui):
        self._slider = self._play = self._hold = None
        if self._frames is None:
            self._hold = gui.add_checkbox('hold this pair', False)
        elif len(self._frames) > 1:
            self._slider = gui.add_slider('pair', 0, len(self._frames) - 1, 1, 0)
            self._play = gui.add_checkbox('play', False)
            self._slider.on_update(lambda event: self._ask(self._slider.value))
            self._play.on_update(lambda event: self._ask(self._slider.value))

    def _ask(self, index):
        """Let `run` show a frame; of several wishes the last one counts."""
        with self._changed:
            self._wanted = index
            self._changed.notify()

    def run(self, ended=lambda: False):
        """Show what is asked for until somebody interrupts, or until a function says so."""
        while not ended():
            playing = self._play is not None and self._play.value
            with self._changed:
                self._changed.wait_for(lambda: self._wanted != self._index, PERIOD)
                wanted = self._wanted
            if wanted != self._index:
                self._go(wanted, playing)
            elif playing:
                begin = time.monotonic()
                self._slider.value = (self._index + 1) % len(self._frames)
                self._go(self._slider.value, True)
                time.sleep(max(0.0, PERIOD - (time.monotonic() - begin)))
            elif self._moving:
                self._settle()

    def _go(self, index, moving):
        self._index = self._wanted = index
        try:
            self.show(self._frames.frame(index), moving)
        except ColorStereoError as error:
            self._about.content = f'**{self._frames.name(index)}**  \n{error}'

    @property
    def held(self):
        """Return whether the live frame that is shown shall stay."""
        return self._hold.value

    def tick(self):
        """Show a live frame as fine as it is, once it is held."""
        if self.held and self._moving:
            self._settle()

    def show(self, frame, moving=False):
        """
        Show a frame.

        Parameters
        ----------
        frame : Frame
            The measured pair that is shown.
        moving : bool
            The next one follows at once: fewer points, smaller pictures.

        """
        with self._lock:
            self.frame, self._moving = frame, moving
            self.scene.show(frame, *self._steps())
            self._about.content = about_frame(frame)
            self.scene.unmark()
            self._corners.clear()
            if self._picked is not None and not moving:
                self._tell(*self._picked)

    def _steps(self):
        """Return the steps of points and pictures."""
        if not self._moving:
            return 1, 1
        width, height = self.frame.size
        return (max(1, round(np.sqrt(width * height / MOVING_POINTS))),
                max(1, round(width / MOVING_WIDTH)))

    def _settle(self):
        """Show the frame as fine as it is."""
        self.show(self.frame)

    def _restyle(self):
        with self._lock:
            self.scene.colors, self.scene.point_size = self._colors.value, self._size.value
            self.scene.show_points(self.frame, self._steps()[0])

    def _look(self, client, view):
        """Turn the camera of one browser."""
        camera = client.camera
        with client.atomic():
            camera.up_direction = (0.0, -1.0, 0.0)
            camera.position, camera.look_at = self.scene.wall.camera(view, camera.aspect)

    def _click(self, event, second):
        with self._lock:
            pixel = self._pixel_of(event.ray_origin, event.ray_direction)
            if pixel is None:
                return
            first, self._picked = self._picked, pixel
            if second and first is not None:
                self._measure(first, pixel)
                return
            self.scene.unmark('second', 'distance')
            self._tell(*pixel)

    def _pixel_of(self, origin, direction):
        """Return the pixel of the rectified left image that a ray hits, or None."""
        hit = self.scene.wall.pixel_of(origin, direction)
        if hit is None:
            return point_on_ray(self.frame.points, origin, direction)
        return self._left_of(*hit)

    def _left_of(self, name, x, y):
        """Return the pixel of the rectified left image for a place of a picture, or None."""
        if name == LEFT:
            return self.frame.rectified_pixel(0, x, y)
        if name == RIGHT:
            pixel = self.frame.left_pixel(*self.frame.rectified_pixel(1, x, y))
            if pixel is None:
                self._told.content = 'No pixel of the left image has its match there.'
            return pixel
        width, height = self.frame.size
        return min(max(round(x), 0), width - 1), min(max(round(y), 0), height - 1)

    def _spots(self, column, row):
        """Return where a pixel is seen: in its pictures, and as a point."""
        frame, scene = self.frame, self.scene
        places = {name: (column, row) for name in scene.wall.places}
        places[LEFT] = frame.raw_place(0, column, row)
        match = frame.match(column, row)
        if match is None:
            del places[RIGHT]
        else:
            places[RIGHT] = frame.raw_place(1, *match)
        if frame.left is None:
            places.pop(LEFT)
            places.pop(RIGHT, None)
        spots = [scene.on_picture(name, *place) for name, place in places.items()]
        if match is None:
            return spots
        return [*spots, self.scene.before(frame.points[row, column])]

    def _tell(self, column, row):
        """Mark a pixel and say what is known of it."""
        self.scene.mark('first', self._spots(column, row))
        curve = None
        if self._frames is not None:
            curve = self._frames.curve(self._index, column, row)
        self._told.content = about_pixel(self.frame, column, row, curve)
        self._curve.visible = curve is not None
        if curve is not None:
            self._curve.data = curve.disparity, curve.path, curve.window
        patches = patches_of(self.frame, column, row)
        self._patches.visible = patches is not None
        if patches is not None:
            self._patches.image = patches

    def _measure(self, first, second):
        """Draw and tell the distance of two pixels."""
        points = self.frame.points
        ends = [points[row, column] for column, row in (first, second)]
        if not np.isfinite(ends).all():
            self._distance.content = 'One of the two pixels has no range.'
            return
        found = distance(self.frame.result, points, first, second)
        self.scene.mark('second', self._spots(*second), SECOND)
        self.scene.line('distance', *ends, f'{1e3 * found.value:.2f} mm')
        self._distance.content = about_distance(found)

    def _select(self, event):
        with self._lock:
            self._corners.clear()
            self.scene.unmark('corners')
            self._fit(self._inside(event))

    def _fit(self, points):
        """Draw and tell the plane of some points, float32 (N, 3), m."""
        try:
            plane = fitted_plane(points)
        except ColorStereoError as error:
            self._plane.content = str(error)
            return
        self.scene.sheet('plane', plane.center, plane.normal, 4 * plane.rms)
        self._plane.content = about_plane(plane)

    def _add_corner(self, event):
        """Add a corner to a polygon; from the third one on, fit a plane to what it holds."""
        with self._lock:
            pixel = self._pixel_of(event.ray_origin, event.ray_direction)
            if pixel is None:
                return
            self._corners.append(pixel)
            self.scene.mark('corners', [spot for corner in self._corners
                                        for spot in self._spots(*corner)], SECOND)
            self._plane.content = f'Plane: {len(self._corners)} corners, three are needed.'
            if len(self._corners) > 2:
                inside = self.frame.points[inside_polygon(self._corners, self.frame.size)]
                self._fit(inside[np.isfinite(inside[:, 2])])

    def _inside(self, event):
        """Return the points inside a box in the window, float32 (N, 3)."""
        camera = BrowserCamera.of(event.client.camera)
        low, high = event.screen_min, event.screen_max
        corners = [self.scene.wall.pixel_of(camera.position, ray(camera, at))
                   for at in (low, high)]
        points = self.frame.points
        if None in corners or corners[0][0] != corners[1][0]:
            points = points.reshape(-1, 3)
            points = points[inside_box(points, camera, low, high)]
        else:
            (left, top), (right, bottom) = (self._left_of(*corner) or (0, 0)
                                            for corner in corners)
            points = points[top:bottom + 1, left:right + 1].reshape(-1, 3)
        return points[np.isfinite(points[:, 2])]

    def _clear(self):
        with self._lock:
            self.scene.unmark()
            self._picked = None
            self._corners.clear()
            self._told.content = HOW_TO
            self._patches.visible = self._curve.visible = False


def ray(camera, place):
    """Return the direction of a place of the window, given in shares of it, float64 (3,)."""
    tall = np.tan(camera.fov / 2)
    x, y = 2 * place[0] - 1, 2 * place[1] - 1
    return camera.rotation @ np.array([x * tall * camera.aspect, y * tall, 1.0])


def patches_of(frame, column, row):
    """Return enlarged what both raw images show around a match, RGB; None without images."""
    match = frame.match(column, row)
    if frame.left is None or match is None:
        return None
    places = frame.raw_place(0, column, row), frame.raw_place(1, *match)
    patches = [patch(image, place) for image, place in zip((frame.left, frame.right), places)]
    return np.concatenate([patches[0], np.zeros((patches[0].shape[0], 8, 3), np.uint8),
                           patches[1]], axis=1)


def patch(image, place):
    """Return what an image shows around a place, enlarged, with a cross at the place, RGB."""
    size = (2 * HALF + 1) * ZOOM
    middle = (size - 1) / 2
    # the pixel x, y of the patch shows the place (x - middle) / ZOOM + place of the image
    to_image = np.array([[1 / ZOOM, 0, place[0] - middle / ZOOM],
                         [0, 1 / ZOOM, place[1] - middle / ZOOM]])
    shown = cv2.warpAffine(image, to_image, (size, size),
                           flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP)
    cv2.drawMarker(shown, (size // 2, size // 2), (255, 255, 255), cv2.MARKER_CROSS, 2 * ZOOM, 3)
    cv2.drawMarker(shown, (size // 2, size // 2), (214, 39, 110), cv2.MARKER_CROSS, 2 * ZOOM, 1)
    return shown

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
"""`color_stereo view`: a real browser looks at a small recording, clicks, and asks nobody else."""

from contextlib import contextmanager
import re
import shutil
import threading
import time
from urllib.parse import urlsplit

from color_stereo_ros.cli import main as cli
from color_stereo_ros.core.settings import updated
from color_stereo_ros.parameters.groups import RangeNodeSettings
from color_stereo_ros.recordings.reading import Recording
from color_stereo_ros.recordings.writing import write_recording
from color_stereo_ros.viewer import mailed
from color_stereo_ros.viewer.page import BrowserCamera, ViewPage
from color_stereo_ros.viewer.sources import RecordedFrames
import cv2
import numpy as np
import pytest
from scenes import hue_pair, parallel_rig

SECOND = 1_000_000_000
WIDTH, HEIGHT = 96, 72
DISPARITIES = 6, 8, 10
PAPER = {'matching.method': 'paper', 'pattern.type': 'sweep', 'color.smoothing': 0.0,
         'range.min_depth': 0.4, 'range.max_depth': 3.0}
BROWSERS = 'chromium', 'chromium-browser', 'google-chrome'
FLAGS = ['--headless', '--no-sandbox', '--enable-unsafe-swiftshader', '--use-angle=swiftshader',
         '--disable-background-networking', '--disable-component-update', '--disable-sync',
         '--no-first-run']
WINDOW = {'width': 900, 'height': 480}
pytestmark = pytest.mark.processes
PATIENCE = 120_000  # ms; nothing depends on how fast a browser is


@pytest.fixture(scope='module')
def recording(tmp_path_factory):
    """Return a recording of planes at three depths."""
    path = tmp_path_factory.mktemp('viewer') / 'planes'
    with write_recording(path) as writer:
        for index, disparity in enumerate(DISPARITIES):
            writer.write_pair((1 + index) * SECOND, *hue_pair(disparity, WIDTH, HEIGHT),
                              parallel_rig(WIDTH, HEIGHT))
    return path


@pytest.fixture(scope='module')
def frames(recording):
    """Return its frames."""
    settings = updated(RangeNodeSettings(), PAPER)
    with Recording(recording) as opened:
        yield RecordedFrames(opened, opened.stereo_topics(), settings)


@pytest.fixture(scope='module')
def browser():
    """Return a headless Chromium; a user's machine may have none."""
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        pytest.skip('cannot run: no Chromium is installed')
    from playwright.sync_api import sync_playwright
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=path, args=FLAGS)
        yield started
        started.close()


class Seen:
    """A page in the browser, and what it has asked for."""

    def __init__(self, browser, address):
        self.requests, self.errors = [], []
        self.page = browser.new_page(viewport=WINDOW)
        self.page.set_default_timeout(PATIENCE)
        self.page.on('request', lambda request: self.requests.append(request.url))
        self.page.on('websocket', lambda socket: self.requests.append(socket.url))
        self.page.on('pageerror', lambda error: self.errors.append(str(error)))
        self.page.goto(address)
        # what viser says of a browser without a graphics card would lie over the pictures
        self.page.add_style_tag(content='[role=alert] { display: none !important }')

    def picture(self):
        """Return a screenshot, uint8 (H, W, 3), BGR."""
        return cv2.imdecode(np.frombuffer(self.page.screenshot(), np.uint8), cv2.IMREAD_COLOR)

    def colored(self, box):
        """Wait until more than half of the pixels of a box in the window have a color."""
        left, top, right, bottom = box
        for _ in range(60):
            part = self.picture()[top:bottom, left:right].astype(int)
            share = np.mean(part.max(axis=2) - part.min(axis=2) > 40)
            if share > 0.5:
                return share
            self.page.wait_for_timeout(500)
        raise AssertionError(f'{share:.0%} of the pixels have a color')


@contextmanager
def seen(browser, address):
    """Open an address."""
    found = Seen(browser, address)
    try:
        yield found
    finally:
        found.page.close()


@pytest.fixture(scope='module')
def page(frames):
    """Return a served page."""
    served = ViewPage('127.0.0.1', 0, frames.frame(0), frames)
    yield served
    served.close()


def client_of(page):
    """Return the one browser that looks at a page, once its panel is beside the scene."""
    def found():
        return [client for client in page.server.get_clients().values()
                if client.camera.image_width < WINDOW['width'] and np.allclose(
                    client.camera.position,
                    page.scene.wall.camera('all', client.camera.aspect)[0], rtol=1e-3)]

    wait_for(found)
    return found()[0]


def place_of(page, spot):
    """Return where a browser shows a place of the scene, px of its window."""
    client = client_of(page)
    camera = BrowserCamera.of(client.camera)
    x, y, z = (np.asarray(spot) - camera.position) @ camera.rotation
    tall = z * np.tan(camera.fov / 2)
    return (client.camera.image_width * (0.5 + 0.5 * x / (tall * camera.aspect)),
            client.camera.image_height * (0.5 + 0.5 * y / tall))


def depth_of(disparity):
    """Return the depth of a plane in mm."""
    return 1e3 * parallel_rig(WIDTH, HEIGHT).geometry.focal_baseline / disparity


def told(window, label):
    """Return the numbers that the panel tells beside a label."""
    row = window.page.get_by_role('row').filter(has_text=re.compile(f'^{label}'))
    text = row.first.inner_text()
    return [float(number) for number in re.findall(r'-?\d+(?:\.\d+)?', text)]


def wait_for(condition):
    """Wait until something holds."""
    for _ in range(1200):
        if condition():
            return
        time.sleep(0.1)
    raise AssertionError('it has not come')


def drag(window, first, second):
    """Drag the mouse with the Shift key."""
    mouse = window.page.mouse
    window.page.keyboard.down('Shift')
    mouse.move(*first)
    mouse.down()
    mouse.move(*second, steps=3)
    mouse.up()
    window.page.keyboard.up('Shift')


def test_a_browser_shows_points_and_answers_clicks(browser, page, frames):
    with seen(browser, page.address) as window, running(page):
        points = page.frame.points
        left, top = place_of(page, points[20, 30])
        right, bottom = place_of(page, points[50, 70])
        window.colored([round(at) for at in (left, top, right, bottom)])
        # a point: its depth is that of the plane
        window.page.mouse.click(*place_of(page, points[36, 48]))
        window.page.get_by_text('that the disparity is right').wait_for()
        assert told(window, 'depth')[0] == pytest.approx(depth_of(DISPARITIES[0]), rel=0.01)
        assert told(window, 'left, rectified') == pytest.approx([48, 36], abs=2)
        # a picture of the right camera: the pixel of the left one that has its match there
        window.page.mouse.click(*place_of(page, page.scene.wall.spot('right', 24, 20)))
        wait_for(lambda: told(window, 'right, raw') == pytest.approx([24, 20], abs=2))
        column, row = map(int, told(window, 'left, rectified'))
        assert column == pytest.approx(24 + DISPARITIES[0], abs=2)
        # the distance of two points
        window.page.keyboard.down('Control')
        window.page.mouse.click(*place_of(page, points[50, 70]))
        window.page.keyboard.up('Control')
        text = window.page.get_by_text('between the last two points').inner_text()
        distance = np.linalg.norm(points[50, 70] - points[row, column])
        assert float(text.split()[0]) == pytest.approx(1e3 * distance, rel=0.1)
        # a plane through a box
        drag(window, (left, top), (right, bottom))
        window.page.get_by_text('degrees from the optical axis').last.wait_for()
        wait_for(lambda: 'RMS' in window.page.inner_text('body'))
        assert told(window, 'tilt')[0] < 1 and told(window, 'points')[0] > 500
        # a plane through a polygon: half of the points of the box that its corners span
        window.page.keyboard.down('Shift')
        for count, place in enumerate(((22, 32), (22, 60), (46, 32)), 1):
            window.page.mouse.click(*place_of(page, points[place]))
            wait_for(lambda: len(page._corners) == count)
        window.page.keyboard.up('Shift')
        wait_for(lambda: told(window, 'points')[0] == pytest.approx(0.5 * 24 * 28, rel=0.15))
        assert told(window, 'tilt')[0] < 1
        # another pair
        window.page.get_by_role('slider').first.press('ArrowRight')
        window.page.get_by_text('pair 1 of 3').wait_for()
        assert page.frame is frames.frame(1)
        assert not window.errors
        assert {urlsplit(url.removeprefix('blob:')).hostname for url in window.requests} == {
            '127.0.0.1'}


@contextmanager
def running(page):
    """Let a page show what is asked for while the block runs."""
    ended = threading.Event()
    runner = threading.Thread(target=page.run, args=[ended.is_set])
    runner.start()
    try:
        yield
    finally:
        ended.set()
        runner.join()


def test_a_file_shows_the_points_without_a_server(browser, recording, tmp_path, capfd):
    path = tmp_path / 'view.html'
    options = [f'--{name}={value}' for name, value in PAPER.items()]
    assert cli.main(['view', str(recording), '--html', str(path), '--frames', '0,2',
                     *options]) == 0
    assert '2 of 3 pairs, points as float32' in capfd.readouterr().out
    assert path.stat().st_size < 2e6
    with seen(browser, path.as_uri()) as window:
        window.colored((460, 210, 520, 270))
        assert not window.errors
        assert {urlsplit(url.removeprefix('blob:')).scheme for url in window.requests} <= {
            'file', ''}


def test_large_clouds_are_rounded_and_thinned_so_that_the_file_can_be_mailed(frames, monkeypatch):
    monkeypatch.setattr(mailed, 'MOST_EXACT', 3000)
    monkeypatch.setattr(mailed, 'MOST', 10_000)
    made = mailed.mailed([frames.frame(0)])
    assert (made.precision, made.step) == ('float16', 1)
    monkeypatch.setattr(mailed, 'MOST', 3000)
    thinner = mailed.mailed([frames.frame(0)])
    assert (thinner.precision, thinner.step) == ('float32', 2)
    assert thinner.megabytes < made.megabytes

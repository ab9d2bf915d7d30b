# SPDX-License-Identifier: Apache-2.0
"""`color_stereo view`: a real browser looks at a small recording, clicks, and asks nobody else."""

from contextlib import contextmanager
import shutil

from color_stereo_ros.cli import main as cli
from color_stereo_ros.core.settings import updated
from color_stereo_ros.files.image import write_image
from color_stereo_ros.parameters.groups import RangeNodeSettings
from color_stereo_ros.recordings.reading import Recording
from color_stereo_ros.recordings.writing import write_recording
from color_stereo_ros.viewer.page import ViewPage
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
WINDOW = {'width': 760, 'height': 420}
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
        pytest.skip('no Chromium is installed')
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


def place_of(page, spot, window=(360, 420)):
    """Return where a browser shows a place of the scene: px of the window."""
    raise NotImplementedError

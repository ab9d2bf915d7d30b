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
"""The one thread that computes: the latest pair in, a result out, errors contained."""

from collections import deque
from dataclasses import dataclass
import threading
import time
import traceback

import numpy as np

from .projector_search import ProjectorSearch
from .row_search import RowSearch
from ..complaints import Complaints
from ..environment import name_thread
from ...core.compiled import is_cached, told_of_compiling
from ...core.doubts import Doubts
from ...core.pipeline import ColorStereo
from ...core.surface import warm_up
from ...errors import bounded, ColorStereoError
from ...messages.decompressing import opened
from ...messages.reading import image_to_rgb
from ...messages.significant_bits import SignificantBits
from ...messages.synchronizer import LatestSlot

_KEPT = 300
_PATIENCE = 2.0  # s
_TRACE = 4000  # characters
_FLAT = 12.0  # DN, contrast of an image that shows nothing
_EVERY = 4  # rows and columns that are looked at

COMPILING = 'no compiled kernels are found: they are compiled now'
READY = 'ready after'
THREAD = 'color_stereo'
"""Name of the thread that measures and publishes, and of those of its kernels."""


@dataclass(frozen=True, eq=False)
class Setup:
    """What a `ColorStereo` is built from."""

    calibration: object
    """StereoCalibration, or None while there is none."""
    settings: object
    """RangeNodeSettings."""

    @property
    def key(self):
        """Return what two setups with the same `ColorStereo` have in common."""
        return self.calibration, self.settings.core, self.settings.input.rectified


class Account:
    """What the worker has done; written by its thread, read by others."""

    def __init__(self):
        self.measured = 0
        """Pairs that gave a result."""
        self.failed = 0
        """Pairs that raised."""
        self.uncalibrated = 0
        """Pairs that came while there was no usable calibration."""
        self.error = None
        """Text of the latest failure; None after a success."""
        self.times = deque(maxlen=_KEPT)
        """When the recent results were published, s of `time.monotonic`."""
        self.latencies = deque(maxlen=_KEPT)
        """From the arrival of the second image to the publication of points, s."""
        self.result = None
        """The latest RangeResult."""

    def latency(self, percentile):
        """Return a percentile of the recent latencies, s, or None."""
        recent = list(self.latencies)
        return float(np.percentile(recent, percentile)) if recent else None

    def rate(self, now, seconds=5.0):
        """Return the results per second during the last seconds."""
        recent = [moment for moment in list(self.times) if now - moment <= seconds]
        if len(recent) < 2:
            return len(recent) / seconds
        return (len(recent) - 1) / max(now - recent[0], recent[-1] - recent[0], 1e-9)


class Worker:
    """
    Measures pairs in a thread of its own; a newer pair replaces one that waits.

    Parameters
    ----------
    setup : Setup
    publish : callable
        Called with (result, pair, setup) in the worker's thread.
    fail : callable
        Called with (pair, text) in the worker's thread when a pair gives no result.
    logger : object
        With the methods of an rclpy logger.
    prepare : callable
        Called once with a RangeResult, so that what publishing needs gets warm, too.

    """

    def __init__(self, setup, publish, fail, logger, prepare):
        self._wanted = setup
        self._publish = publish
        self._fail = fail
        self._prepare = prepare
        self._logger = logger
        self._complain = Complaints(lambda text: logger.error(bounded(text, _TRACE)))
        self._warn = Complaints(lambda text: logger.warning(bounded(text)))
        self.doubts = Doubts(self._warn)
        self._rows, self._projector = RowSearch(), ProjectorSearch()
        self.values = SignificantBits()
        self._built = None  # (key, ColorStereo)
        self._helper = None  # a process that compiles
        self._slot = LatestSlot()
        self._thread = threading.Thread(target=self._run, name=THREAD, daemon=True)
        self.account = Account()
        self.unmeasured = None
        """The pair whose turn came while there was no usable calibration, or None."""
        self.lost = None
        """Why the latest pair was measured without the right camera; None: it was not."""
        self.state = 'getting ready'
        """'getting ready', 'ready', or why nothing can be measured."""

    def start(self):
        """Begin to work."""
        self._thread.start()

    def stop(self):
        """Finish the pair at hand and end the thread; a kernel that compiles is not awaited."""
        self._slot.close()
        if self._thread.is_alive():
            self._thread.join(_PATIENCE)
        helper = self._helper
        if helper is not None:  # the thread still compiles, and waits for nobody
            helper.kill()

    @property
    def dropped(self):
        """Return how many pairs a newer one replaced."""
        return self._slot.replaced

    @property
    def calibration(self):
        """Return the calibration in force, or None."""
        return self._wanted.calibration

    def configure(self, setup):
        """Use another calibration or other settings from the next pair on."""
        self._wanted = setup
        self._slot.wake()

    def submit(self, pair):
        """Measure a pair of images as soon as the one at hand is done."""
        self.unmeasured = None
        self._slot.put(pair)

    def _run(self):
        name_thread(THREAD)
        self._warm_up()
        while not self._slot.closed:
            pair = self._slot.take()
            if self._slot.closed:
                return
            try:
                self._step(pair)
            except ColorStereoError as error:
                self._note_failure(pair, str(error))
            except Exception as error:  # one bad pair must never end the node
                if self._slot.closed:
                    return
                self._note_failure(pair, f'{type(error).__name__}: {error}',
                                   traceback.format_exc())
            pair = None  # images may be large, and the next ones may be long in coming

    def _warm_up(self):
        """Compile or load the kernels before the first calibration arrives."""
        started = time.monotonic()
        self._logger.info('getting ready: loading the kernels')
        settings = self._wanted.settings
        try:
            with told_of_compiling(lambda: self._note_compiling(settings.core)):
                stereo = ColorStereo(warm_up.some_calibration(), settings.core,
                                     rectified_input=settings.input.rectified)
            black = np.zeros((*warm_up.SIZE[::-1], 3), np.uint8)
            self._prepare(stereo.process(black, black))
        except ColorStereoError:
            pass  # limits that do not fit this rig may fit the real one
        finally:
            self._end_helper()
        if self._slot.closed:
            return
        self.state = 'ready'
        self._logger.info(f'{READY} {time.monotonic() - started:.1f} s')

    def _note_compiling(self, settings):
        """Say that kernels are compiled, not loaded; let another process help."""
        self._logger.info(f'{COMPILING}, which takes up to a minute')
        if settings.matching.method == 'surface' and is_cached():
            self._helper = warm_up.start_helper()

    def _end_helper(self):
        """End the process that helps to compile, if there is one."""
        if self._helper is not None:
            self._helper.kill()
            self._helper.wait()
            self._helper = None

    def _step(self, pair):
        setup = self._wanted
        stereo = self._stereo(setup)
        if pair is None:
            return
        if stereo is None:
            self._note_uncalibrated(pair)
            return
        bits = setup.settings.input.significant_bits
        shown = opened(pair)  # others know the pair by its identity
        left, right = (_image(side, message, bits) if message is not None else None
                       for side, message in (('left', shown.left), ('right', shown.right)))
        self.lost = _loss(left, right) if setup.settings.input.survive_right_loss else None
        if self.lost:
            result = _with_projector(stereo, left, self.lost)
        else:
            result = stereo.process(left, right)
        if self._wanted.calibration is not setup.calibration:
            self._note_uncalibrated(pair)
            return
        self._publish(result, pair, setup)
        self._note_success(result)
        if not self.lost:
            self._look(stereo, shown, left, right, result, bits)

    def _look(self, stereo, pair, left, right, result, bits):
        """Look for what is odd about a pair, and for what its successors need."""
        self.values.note(pair)
        news = self.values.news(bits)
        if news:
            self._warn(news)
        self.doubts.look(stereo, left, right, result)
        self._rows.look(stereo, left, right, result)
        if not self._rows.busy:
            self._projector.look(stereo, result)

    def _stereo(self, setup):
        """Return the ColorStereo of a setup, built again if need be; None without calibration."""
        if setup.calibration is None:
            self._built = None
            return None
        if self._built is None or self._built[0] != setup.key:
            self._built = None
            self.state = 'getting ready'
            try:
                with told_of_compiling(lambda: self._note_compiling(setup.settings.core)):
                    self._built = setup.key, ColorStereo(
                        setup.calibration, setup.settings.core,
                        rectified_input=setup.settings.input.rectified, search_at_once=False,
                        covariance=setup.settings.health.read_covariance())
            finally:
                self._end_helper()
                self.state = 'ready'
        return self._built[1]

    def note_published(self, pair):
        """Take down how long a pair took from its arrival until now."""
        self.account.latencies.append(time.monotonic() - pair.arrival)

    def _note_success(self, result):
        self.account.measured += 1
        self.account.times.append(time.monotonic())
        self.account.result = result
        self.account.error = None

    def _note_uncalibrated(self, pair):
        self.account.uncalibrated += 1
        self.unmeasured = pair
        self._fail(pair, 'there is no usable calibration')

    def _note_failure(self, pair, text, trace=''):
        if pair is not None:
            self.account.failed += 1
            self._fail(pair, text)
        self.account.error = text
        self._complain(f'{text}\n{trace}' if trace else text)


def _image(side, message, significant_bits):
    try:
        return image_to_rgb(message, significant_bits)
    except ColorStereoError as error:
        raise type(error)(f'{side} image: {error}') from error


def _loss(left, right):
    """Return why the right camera cannot be used, None if it can."""
    if right is None:
        return 'the right camera is silent'
    if _contrast(right) < _FLAT and _contrast(left) > 2 * _FLAT:
        return 'the right camera is covered or dark'
    return None


def _contrast(image):
    """Return by how much the values of an image differ, DN; extremes do not count."""
    low, high = np.percentile(image[::_EVERY, ::_EVERY], (10, 90))
    return float(high - low)


def _with_projector(stereo, left, lost):
    """Return the result of left camera and projector, or raise why there is none."""
    track = stereo.projector
    if track is None or track.model is None:
        raise ColorStereoError(f'{lost}, and the projector is not known, which could replace it')
    return stereo.process_left(left)

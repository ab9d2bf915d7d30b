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
"""Whether the pattern that pattern_node shows is the one that range_node expects."""

from dataclasses import asdict
import json
import threading

from std_msgs.msg import String

from ..following import FollowingSubscription
from ..pattern_source import fingerprint
from ...core.patterns.frames import PATTERN
from ...core.patterns.making import make_pattern
from ...core.patterns.registry import makable
from ...errors import bounded, brief, ColorStereoError

_LONGEST = 10_000
"""Characters of a description; those of this package have some hundred."""


class PatternWatch:
    """
    Compares the description on pattern/info with the own pattern.* settings.

    Parameters
    ----------
    node : rclpy.node.Node
        Warned once of each mismatch.
    parameters : NodeParameters

    """

    def __init__(self, node, parameters):
        self._node = node
        self._settings = parameters.settings.pattern
        self._shown = None
        self.mismatch = None
        """What does not fit, or None."""
        self._subscription = FollowingSubscription(
            node, String, 'pattern/info', lambda msg: self._take(msg.data), parameters)

    @property
    def known(self):
        """Tell whether anybody has said what is shown."""
        return self._shown is not None

    def _take(self, text):
        """Take the JSON text of pattern/info."""
        try:
            if len(text) > _LONGEST:
                raise ValueError(f'{len(text)} characters, expected at most {_LONGEST}')
            shown = json.loads(text)
            self._shown = {'pattern': dict(shown['pattern']), 'sha256': str(shown['sha256']),
                           'frame': str(shown.get('frame', PATTERN))}
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            self._shown = None
            self._report(f'pattern/info cannot be read: {type(error).__name__}: {error}')
            return
        self._compare()

    def follow(self):
        """Look after the subscription; call it from the executor's thread now and then."""
        self._subscription.follow()

    def configure(self, settings):
        """Take new pattern.* settings."""
        if settings != self._settings:
            self._settings = settings
            if self.known:
                self._compare()

    def _compare(self):
        if self._shown['frame'] != PATTERN:
            self._report(f'pattern.frame = {brief(self._shown["frame"])} is shown instead of the '
                         'pattern')
            return
        if self._settings.type not in makable():
            self.mismatch = None
            return
        own, shown = asdict(self._settings), self._shown['pattern']
        different = [f'pattern.{name} = {brief(shown.get(name))} is shown, but set to '
                     f'{own[name]!r}' for name in own if shown.get(name) != own[name]]
        if different:
            self._report('; '.join(different))
            return
        self.mismatch = None
        threading.Thread(target=self._compare_pixels, args=(self._settings, self._shown['sha256']),
                         daemon=True).start()

    def _compare_pixels(self, settings, sha256):
        """Make the pattern, which takes a moment, and compare its hash."""
        try:
            own = fingerprint(make_pattern(settings))
        except ColorStereoError as error:
            self._report(str(error))
            return
        if own != sha256 and settings == self._settings:
            self._report(f'the pattern shown has the same settings but other pixels: sha256 '
                         f'{brief(sha256[:12])[1:-1]}..., expected {own[:12]}...')

    def _report(self, mismatch):
        mismatch = bounded(mismatch)
        if mismatch != self.mismatch:
            self.mismatch = mismatch
            self._node.get_logger().warning(f'pattern: {mismatch}')

    def destroy(self):
        """Unsubscribe."""
        self._subscription.destroy()

# SPDX-License-Identifier: Apache-2.0
"""Whether the pattern that pattern_node shows is the one that range_node expects."""

from dataclasses import asdict
import json
import threading

from rclpy.event_handler import SubscriptionEventCallbacks

from std_msgs.msg import String

from ...core.patterns.making import make_pattern
from ...core.patterns.registry import makable
from ...errors import ColorStereoError
from ..pattern_source import fingerprint, latched


class PatternWatch:
    """
    Compares the description on pattern/info with the own pattern.* settings.

    Parameters
    ----------
    node : rclpy.node.Node
        Warned once of each mismatch.
    settings : PatternSettings

    """

    def __init__(self, node, settings):
        self._node = node
        self._settings = settings
        self._shown = None
        self.mismatch = None
        """What does not fit, or None."""
        self._subscription = node.create_subscription(
            String, 'pattern/info', lambda msg: self._take(msg.data), latched(),
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False))

    @property
    def known(self):
        """Tell whether anybody has said what is shown."""
        return self._shown is not None

    def _take(self, text):
        """Take the JSON text of pattern/info."""
        try:
            shown = json.loads(text)
            self._shown = {'pattern': dict(shown['pattern']), 'sha256': str(shown['sha256'])}
        except (ValueError, TypeError, KeyError) as error:
            self._shown = None
            self._report(f'pattern/info cannot be read: {type(error).__name__}: {error}')
            return
        self._compare()

    def configure(self, settings):
        """Take new pattern.* settings."""
        if settings != self._settings:
            self._settings = settings
            if self.known:
                self._compare()

    def _compare(self):
        if self._settings.type not in makable():
            self.mismatch = None
            return
        own, shown = asdict(self._settings), self._shown['pattern']
        different = [f'pattern.{name} = {shown.get(name)!r} is shown, but set to {own[name]!r}'
                     for name in own if shown.get(name) != own[name]]
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
                         f'{sha256[:12]}..., expected {own[:12]}...')

    def _report(self, mismatch):
        if mismatch != self.mismatch:
            self.mismatch = mismatch
            self._node.get_logger().warning(f'pattern: {mismatch}')

    def destroy(self):
        """Unsubscribe."""
        self._node.destroy_subscription(self._subscription)

# SPDX-License-Identifier: Apache-2.0
"""The pattern that pattern_node shows, and the description by which range_node knows it."""

from dataclasses import asdict
from functools import lru_cache
import hashlib
import json

from rclpy.node import Node
from rclpy.qos import QoSDurabilityPolicy, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions

from sensor_msgs.msg import Image

from std_msgs.msg import String

from ..core.patterns.making import make_pattern
from ..core.patterns.registry import makable
from ..errors import SettingsError
from ..messages.contents import Header, image
from ..parameters.groups import PatternNodeSettings
from .filling import message_of
from .parameters import NodeParameters

FRAME = 'projector_optical_frame'


def latched():
    """Return the QoS of a topic whose last message every late subscriber gets."""
    return QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)


def describe(settings, image):
    """Return the JSON text of pattern/info: the settings and a hash of the pixels."""
    return json.dumps({'pattern': asdict(settings), 'sha256': fingerprint(image)})


def fingerprint(image):
    """Return the SHA-256 of the pixels of a pattern, in hexadecimal."""
    return hashlib.sha256(image.tobytes()).hexdigest()


class PatternNode(Node):
    """Publishes pattern/image and pattern/info, latched, and again when a parameter changes."""

    def __init__(self):
        super().__init__('pattern_node', automatically_declare_parameters_from_overrides=True)
        parameters = NodeParameters(self, PatternNodeSettings(), check=_check,
                                    on_change=self._show)
        options = QoSOverridingOptions.with_default_policies()
        self._image = self.create_publisher(Image, 'pattern/image', latched(),
                                            qos_overriding_options=options)
        self._info = self.create_publisher(String, 'pattern/info', latched(),
                                           qos_overriding_options=options)
        parameters.warn_of_unknown()
        _check(parameters.settings)
        self._show(parameters.settings)

    def _show(self, settings):
        pattern = _make_once(settings.pattern)
        header = Header.at(self.get_clock().now().nanoseconds, FRAME)
        self._image.publish(message_of(image(pattern, 'rgb8', header)))
        self._info.publish(String(data=describe(settings.pattern, pattern)))
        self.get_logger().info(f'showing {settings.pattern.type}, {settings.pattern.width} x '
                               f'{settings.pattern.height} px')


def _check(settings):
    """Refuse what cannot be shown, by a ColorStereoError."""
    if settings.pattern.type not in makable():
        raise SettingsError(f'pattern.type = {settings.pattern.type!r} names no pattern that can '
                            'be shown')
    _make_once(settings.pattern)


@lru_cache(maxsize=1)
def _make_once(settings):
    """Return the pattern; the one that was checked is the one that is shown."""
    return make_pattern(settings)

# SPDX-License-Identifier: Apache-2.0
"""The node range_node: raw pairs and calibrations in, range images and points out."""

from .run import run


def make_node():
    """Return the node; what it needs is imported here, where Ctrl-C is handled already."""
    from rclpy.node import Node

    from .parameters import NodeParameters, RangeNodeSettings
    from .range_sensor import RangeSensor

    class RangeNode(Node):
        """Parameters and a sensor."""

        def __init__(self):
            super().__init__('range_node', automatically_declare_parameters_from_overrides=True)
            self._sensor = None
            parameters = NodeParameters(self, RangeNodeSettings(),
                                        on_change=lambda settings: self._sensor.configure(settings))
            self._sensor = RangeSensor(self, parameters)
            parameters.warn_of_unknown()

        def destroy_node(self):
            if self._sensor is not None:
                self._sensor.destroy()
            super().destroy_node()

    return RangeNode()


def main(args=None):
    """Run the node; the entry point of `ros2 run color_stereo_ros range_node`."""
    return run(make_node, args)

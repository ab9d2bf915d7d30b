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
"""range_node as a plain node and as a managed one: the same sensor inside."""

from rclpy.lifecycle import Node as ManagedNode, TransitionCallbackReturn
from rclpy.node import Node

from .range_sensor import RangeSensor
from .save import SaveFolder
from ..parameters import NodeParameters, Reloadable
from ...parameters.groups import RangeNodeSettings

NAME = 'range_node'


class RangeNode(Reloadable, Node):
    """Measures from its first moment to its last."""

    def __init__(self):
        super().__init__(NAME, automatically_declare_parameters_from_overrides=True)
        self.sensor = None
        parameters, folder = declare(self)
        self.sensor = RangeSensor(self, parameters, folder)
        parameters.warn_of_unknown()

    def destroy_node(self):
        """Stop the sensor, then leave."""
        if self.sensor is not None:
            self.sensor.destroy()
            self.sensor = None
        super().destroy_node()


class LifecycleRangeNode(Reloadable, ManagedNode):
    """Measures while it is active; topics and services exist from configure to cleanup."""

    def __init__(self):
        super().__init__(NAME, automatically_declare_parameters_from_overrides=True)
        self.sensor = None
        self._declared, self._folder = declare(self)

    def on_configure(self, state):
        """Create the sensor, which gets ready and takes calibrations, but measures nothing."""
        self.sensor = RangeSensor(self, self._declared, self._folder, active=False)
        self._declared.warn_of_unknown()
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state):
        """Start to measure."""
        self.sensor.active = True
        return super().on_activate(state)

    def on_deactivate(self, state):
        """Stop to measure."""
        self.sensor.active = False
        return super().on_deactivate(state)

    def on_cleanup(self, state):
        """Remove the sensor."""
        self._drop_sensor()
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state):
        """Remove the sensor for good."""
        self._drop_sensor()
        return TransitionCallbackReturn.SUCCESS

    def on_error(self, state):
        """Remove the sensor, so that it can be configured again."""
        self._drop_sensor()
        return TransitionCallbackReturn.SUCCESS

    def _drop_sensor(self):
        if self.sensor is not None:
            self.sensor.destroy()
            self.sensor = None

    def destroy_node(self):
        """Stop the sensor, then leave."""
        self._drop_sensor()
        super().destroy_node()


def declare(node):
    """
    Declare the parameters of range_node; its sensor, if there is one, follows them.

    Parameters
    ----------
    node : rclpy.node.Node
        The node that spins.

    Returns
    -------
    parameters : NodeParameters
    folder : SaveFolder

    """
    def check(settings):
        folder.check(settings.output)
        if node.sensor is not None:
            node.sensor.check(settings)

    def apply(settings):
        if node.sensor is not None:
            node.sensor.configure(settings)

    parameters = NodeParameters(node, RangeNodeSettings(), check, apply)
    folder = SaveFolder(parameters.settings.output)
    return parameters, folder

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
"""
Settings as ROS parameters and back.

Names, defaults, units, ranges and descriptions are those of the dataclass fields. Values are
validated as a set before anything changes, and arrive as a whole or not at all.

"""

from rcl_interfaces.msg import (FloatingPointRange, IntegerRange, ParameterDescriptor,
                                SetParametersResult)
from rclpy.parameter import Parameter

from ..core.settings import checked_value, described, flat, suggestion, updated
from ..errors import ColorStereoError
from ..parameters.groups import PatternNodeSettings, RangeNodeSettings

_INHERENT = ('use_sim_time', 'start_type_description_service')


class Reloadable:
    """
    A node that takes a dump of its own parameters; before `rclpy.node.Node` among the bases.

    rclpy refuses a read-only parameter even if nothing would change. `ros2 param load` of what
    `ros2 param dump` has written would then complain of `qos_overrides` and others.

    """

    def set_parameters_atomically(self, parameter_list):
        """Set parameters as one; those that are read-only and stay as they are do not count."""
        changed = [each for each in parameter_list if not self._stays(each)]
        if parameter_list and not changed:
            return SetParametersResult(successful=True)
        return super().set_parameters_atomically(changed)

    def _stays(self, parameter):
        """Return whether a parameter is read-only and has this value."""
        name = parameter.name
        return (self.has_parameter(name) and self.describe_parameter(name).read_only
                and self.get_parameter(name).value == parameter.value)


class NodeParameters:
    """
    Declares the settings of a node as its parameters and keeps both the same.

    The node must have been built with `automatically_declare_parameters_from_overrides=True`:
    that is the one public way to see overrides before their types are fixed.

    Parameters
    ----------
    node : rclpy.node.Node
    defaults : RangeNodeSettings or PatternNodeSettings
    check : callable, optional
        Called with new settings before they are accepted; refuses by a ColorStereoError.
    on_change : callable, optional
        Called with the settings after they have been accepted.

    Raises
    ------
    SettingsError
        If an override has a wrong type or range, or overrides contradict each other.

    """

    def __init__(self, node, defaults, check=None, on_change=None):
        self.node = node
        self._check = check or (lambda settings: None)
        self._on_change = on_change or (lambda settings: None)
        self._given = _take_overrides(node)
        known = flat(defaults)
        self.settings = updated(defaults, {
            name: value for name, value in self._given.items() if name in known})
        self._types = {name: type(default) for name, default, _ in described(defaults)}
        values = flat(self.settings)
        for name, _, meta in described(defaults):
            node.declare_parameter(name, values[name], descriptor(meta, self._types[name]),
                                   ignore_override=True)
        node.add_pre_set_parameters_callback(self._coerce)
        node.add_on_set_parameters_callback(self._validate)
        node.add_post_set_parameters_callback(self._apply)

    def is_given(self, name):
        """Tell whether the user gave a value for a parameter at the start."""
        return name in self._given

    def warn_of_unknown(self):
        """Report overrides that no parameter has taken; call it when all are declared."""
        # one file may serve both nodes
        elsewhere = {**flat(RangeNodeSettings()), **flat(PatternNodeSettings())}
        for name in self._given:
            if not self.node.has_parameter(name) and name not in elsewhere:
                self.node.get_logger().warning(
                    f'parameter {name!r} is unknown and ignored{suggestion(name, self._types)}')

    def _coerce(self, parameters):
        """Take integers for doubles, and false for the choice `off`."""
        return [self._coerced(parameter) for parameter in parameters]

    def _coerced(self, parameter):
        kinds = self._types.get(parameter.name), parameter.type_
        if kinds not in ((float, Parameter.Type.INTEGER), (str, Parameter.Type.BOOL)):
            return parameter
        try:
            value = checked_value(self.settings, parameter.name, parameter.value)
        except ColorStereoError:
            return parameter  # refused with its reason
        return Parameter(parameter.name, value=value)

    def _changed(self, parameters):
        return updated(self.settings, {parameter.name: parameter.value for parameter in parameters
                                       if parameter.name in self._types})

    def _validate(self, parameters):
        try:
            self._check(self._changed(parameters))
        except ColorStereoError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters):
        settings = self._changed(parameters)
        if settings != self.settings:
            self.settings = settings
            self._on_change(settings)


def _take_overrides(node):
    """Return the overrides that were given at the start and undeclare them."""
    names = [name for name in node.list_parameters([], 0).names if name not in _INHERENT]
    given = {name: node.get_parameter(name).value for name in names}
    for name in names:
        node.undeclare_parameter(name)
    return given


def descriptor(meta, kind):
    """
    Return a ParameterDescriptor.

    Parameters
    ----------
    meta : dict
        Metadata of a dataclass field made by `setting`.
    kind : type
        Of the value.

    """
    unit = f' [{meta["unit"]}]' if meta['unit'] else ''
    result = ParameterDescriptor(description=meta['description'] + unit)
    if meta['choices'] is not None:
        result.additional_constraints = f'one of {", ".join(meta["choices"])}'
    if kind is int:
        result.integer_range = [IntegerRange(from_value=meta['minimum'],
                                             to_value=meta['maximum'], step=0)]
    if kind is float:
        result.floating_point_range = [FloatingPointRange(
            from_value=float(meta['minimum']), to_value=float(meta['maximum']), step=0.0)]
    return result

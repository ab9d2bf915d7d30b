# SPDX-License-Identifier: Apache-2.0
"""
Settings as ROS parameters and back.

Names, defaults, units, ranges and descriptions are those of the dataclass fields. Values are
validated as a set before anything changes, and arrive as a whole or not at all.

"""

from dataclasses import dataclass
from pathlib import Path
import sys

from rcl_interfaces.msg import (FloatingPointRange, IntegerRange, ParameterDescriptor,
                                SetParametersResult)
from rclpy.parameter import Parameter

from ..core.settings import (
    described, flat, Group, PatternSettings, setting, Settings, suggestion, updated)
from ..errors import ColorStereoError


@dataclass(frozen=True)
class InputSettings(Group):
    """What arrives."""

    prefix = 'input'

    rectified: bool = setting(
        False, 'the images are rectified already and are not rectified again')
    mode: str = setting(
        'stream', 'stream: every pair is measured; capture: one pair for each call of the service '
        '~/capture', choices=('stream', 'capture'))


@dataclass(frozen=True)
class OutputSettings(Group):
    """What is published."""

    prefix = 'output'

    depth_encoding: str = setting(
        '32FC1', 'of depth/image: 32FC1 in m with NaN = unknown, or 16UC1 in mm with 0 = unknown',
        choices=('32FC1', '16UC1'))
    frame: str = setting(
        'rectified', 'frame of points: rectified = the rectified left camera, which depth/image '
        'and the peers use; camera = the physical left camera, rotated by R transposed',
        choices=('rectified', 'camera'))
    compact_points: bool = setting(
        False, 'points holds the known points only, in one row, instead of H x W with NaN')
    diagnostics_period: float = setting(
        1.0, 'time between two messages on /diagnostics', unit='s', minimum=0.1, maximum=60.0)
    save_directory: str = setting(
        '', 'where the service ~/save writes; empty = the directory that the node runs in')
    save_format: str = setting(
        'ply', 'of the files that the service ~/save writes', choices=('ply', 'pcd'))


@dataclass(frozen=True)
class SyncSettings(Group):
    """How left and right find each other."""

    prefix = 'sync'

    tolerance: float = setting(
        0.0, 'largest difference of the stamps of a pair; 0 adapts to a little less than half the '
        'frame period', unit='s', minimum=0.0, maximum=1.0)
    queue_size: int = setting(
        8, 'images of each camera that wait for their partner', minimum=1, maximum=100)
    warn_after: float = setting(
        3.0, 'time without a pair after which the reason is reported', unit='s', minimum=0.1,
        maximum=600.0)


@dataclass(frozen=True)
class RangeNodeSettings:
    """All parameters of range_node."""

    pattern: PatternSettings = Settings().pattern
    color: Group = Settings().color
    matching: Group = Settings().matching
    range: Group = Settings().range
    input: InputSettings = InputSettings()
    output: OutputSettings = OutputSettings()
    sync: SyncSettings = SyncSettings()

    @property
    def core(self):
        """Return the part that the core knows."""
        return Settings(pattern=self.pattern, color=self.color, matching=self.matching,
                        range=self.range)


@dataclass(frozen=True)
class PatternNodeSettings:
    """All parameters of pattern_node."""

    pattern: PatternSettings = Settings().pattern


_INHERENT = ('use_sim_time', 'start_type_description_service')


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
        elsewhere = flat(RangeNodeSettings())  # one file may serve both nodes
        for name in self._given:
            if not self.node.has_parameter(name) and name not in elsewhere:
                self.node.get_logger().warning(
                    f'parameter {name!r} is unknown and ignored{suggestion(name, self._types)}')

    def _coerce(self, parameters):
        """Take integers for doubles."""
        return [Parameter(parameter.name, value=float(parameter.value))
                if self._types.get(parameter.name) is float
                and parameter.type_ == Parameter.Type.INTEGER else parameter
                for parameter in parameters]

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


def parameter_file(node_name, settings):
    """
    Return the text of a parameter file (YAML, as `ros2 param dump` writes it).

    Parameters
    ----------
    node_name : str
    settings : RangeNodeSettings or PatternNodeSettings

    """
    lines = [f'/**/{node_name}:', '  ros__parameters:']  # in any namespace
    group = None
    for name, _, meta in described(settings):
        prefix, _, key = name.partition('.')
        if prefix != group:
            group = prefix
            lines.append(f'    {group}:')
        lines.append(f'      {key}: {_yaml_value(flat(settings)[name])}{_comment(meta)}')
    return '\n'.join(lines) + '\n'


def _yaml_value(value):
    if isinstance(value, str):
        return f"'{value}'"
    return str(value).lower() if isinstance(value, bool) else str(value)


def _comment(meta):
    """Return the legal values of a field as a comment."""
    if meta['choices'] is not None:
        return f'  # {", ".join(meta["choices"])}'
    if meta['minimum'] is None:
        return ''
    return f'  # {meta["minimum"]} .. {meta["maximum"]} {meta["unit"]}'.rstrip()


def write_parameter_files(folder):
    """Write the shipped parameter files, which hold the defaults."""
    for name, settings in (('range_node', RangeNodeSettings()),
                           ('pattern_node', PatternNodeSettings())):
        (Path(folder) / f'{name}.yaml').write_text(parameter_file(name, settings),
                                                   encoding='utf-8')


if __name__ == '__main__':
    write_parameter_files(sys.argv[1])

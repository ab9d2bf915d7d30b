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
"""Parameters: declared from the dataclass fields, validated as a set, applied as a whole."""

from pathlib import Path

from color_stereo_ros.core.settings import described, flat
from color_stereo_ros.nodes.parameters import NodeParameters
from color_stereo_ros.parameters.files import parameter_file
from color_stereo_ros.parameters.groups import PatternNodeSettings, RangeNodeSettings

import pytest

from rcl_interfaces.msg import ParameterType

import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_dict_from_yaml_file
from rclpy.parameter_client import AsyncParameterClient

from ros_rig import NodeProcess, Rig

import yaml

CONFIG = Path(__file__).resolve().parents[1] / 'config'
KNOWN = flat(RangeNodeSettings())
KINDS = {bool: ParameterType.PARAMETER_BOOL, int: ParameterType.PARAMETER_INTEGER,
         float: ParameterType.PARAMETER_DOUBLE, str: ParameterType.PARAMETER_STRING}


class Owner:
    """A node without communication beyond itself, with parameters."""

    def __init__(self, *arguments, **overrides):
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.warnings = []
        self.changes = []
        self.node = Node(
            'owner', context=self.context, automatically_declare_parameters_from_overrides=True,
            cli_args=['--ros-args', *arguments] if arguments else None,
            parameter_overrides=[Parameter(name.replace('__', '.'), value=value)
                                 for name, value in overrides.items()])
        logger = type('Logger', (), {'warning': lambda _, text: self.warnings.append(text)})()
        self.node.get_logger = lambda: logger

    def declare(self, **options):
        """Declare the parameters of range_node."""
        self.parameters = NodeParameters(self.node, RangeNodeSettings(),
                                         on_change=self.changes.append, **options)
        return self.parameters

    def set(self, **values):  # noqa: A003
        """Set parameters atomically."""
        return self.node.set_parameters_atomically(
            [Parameter(name.replace('__', '.'), value=value) for name, value in values.items()])

    def close(self):
        """Leave ROS."""
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


@pytest.fixture
def make():
    """Yield a function that makes owners and closes them at the end."""
    owners = []

    def build(*arguments, **overrides):
        owners.append(Owner(*arguments, **overrides))
        return owners[-1]

    yield build
    for owner in owners:
        owner.close()


def test_every_setting_is_a_parameter_with_its_default(make):
    owner = make()
    owner.declare()
    assert {name: owner.node.get_parameter(name).value for name in KNOWN} == KNOWN


@pytest.mark.parametrize('name, default, meta', list(described(RangeNodeSettings())))
def test_every_parameter_is_described_with_type_unit_and_range(make, name, default, meta):
    owner = make()
    owner.declare()
    told = owner.node.describe_parameter(name)
    assert told.type == KINDS[type(default)]
    assert len(told.description) > 10 and not told.read_only
    assert meta['unit'] in told.description
    if isinstance(default, float):
        limits = told.floating_point_range[0]
        assert (limits.from_value, limits.to_value) == (meta['minimum'], meta['maximum'])
    elif type(default) is int:
        limits = told.integer_range[0]
        assert (limits.from_value, limits.to_value) == (meta['minimum'], meta['maximum'])
    elif meta['choices']:
        assert all(choice in told.additional_constraints for choice in meta['choices'])


def test_an_integer_is_taken_for_a_double_at_the_start(make):
    owner = make(range__max_depth=2)
    assert owner.declare().settings.range.max_depth == 2.0
    assert owner.node.get_parameter('range.max_depth').type_ == Parameter.Type.DOUBLE


def test_an_integer_is_taken_for_a_double_at_run_time(make):
    owner = make()
    owner.declare()
    assert owner.set(range__max_depth=3).successful
    assert owner.node.get_parameter('range.max_depth').value == 3.0
    assert isinstance(owner.changes[-1].range.max_depth, float)


def test_overrides_that_fit_only_together_start_the_node(make):
    owner = make(range__min_depth=5.0, range__max_depth=9.0)
    settings = owner.declare().settings
    assert (settings.range.min_depth, settings.range.max_depth) == (5.0, 9.0)


@pytest.mark.parametrize('overrides, reason', [
    ({'range__min_depth': 5000.0}, r'range.min_depth = 5000.0 m is outside 0.001 .. 1000.0 m'),
    ({'range__min_depth': 'near'}, "range.min_depth = 'near' is a str, expected float"),
    ({'range__min_depth': True}, 'range.min_depth = True is a bool, expected float'),
    ({'range__min_depth': float('nan')}, 'range.min_depth = nan m is outside'),
    ({'sync__queue_size': 2.0}, 'sync.queue_size = 2.0 is a float, expected int'),
    ({'pattern__type': 'hues'}, "pattern.type = 'hues' is not one of hue_field"),
    ({'range__min_depth': 2.0}, 'range.min_depth = 2.0 m must be smaller than range.max_depth'),
    ({'matching__window_width': 8}, 'matching.window_width = 8 px is even'),
    ({'output__frame': 'base_link'}, "output.frame = 'base_link' is not one of rectified, camera"),
])
def test_overrides_that_are_refused_say_name_value_and_range(make, overrides, reason):
    from color_stereo_ros.core import SettingsError
    with pytest.raises(SettingsError, match=reason):
        make(**overrides).declare()


@pytest.mark.parametrize('values, reason', [
    ({'range__min_depth': 5000.0}, 'range.min_depth'),
    ({'range__min_depth': float('nan')}, 'range.min_depth'),
    ({'range__min_depth': 'near'}, 'DOUBLE'),
    ({'pattern__cycles': 1.5}, 'INTEGER'),
    ({'pattern__cycles': 0}, 'pattern.cycles out of range'),
    ({'input__rectified': 1}, 'BOOL'),
    ({'pattern__type': 'hues'}, "pattern.type = 'hues' is not one of"),
    ({'range__min_depth': 2.0}, 'must be smaller than range.max_depth'),
    ({'matching__window_width': 10}, 'is even')])
def test_values_that_are_refused_change_nothing(make, values, reason):
    owner = make()
    owner.declare()
    result = owner.set(**values)
    assert not result.successful and reason in result.reason
    assert owner.changes == [] and owner.parameters.settings == RangeNodeSettings()


def test_a_refused_value_keeps_the_whole_set_from_being_applied(make):
    owner = make()
    owner.declare()
    result = owner.set(sync__tolerance=0.01, range__min_depth=2.0)
    assert not result.successful
    assert owner.node.get_parameter('sync.tolerance').value == 0.0
    assert owner.parameters.settings.sync.tolerance == 0.0 and owner.changes == []


def test_a_set_arrives_as_a_whole(make):
    owner = make()
    owner.declare()
    assert owner.set(range__min_depth=5.0, range__max_depth=9.0).successful
    assert [(s.range.min_depth, s.range.max_depth) for s in owner.changes] == [(5.0, 9.0)]


def test_an_unchanged_value_changes_nothing(make):
    owner = make()
    owner.declare()
    assert owner.set(sync__tolerance=0.0).successful
    assert owner.changes == []


def test_what_the_owner_refuses_is_refused_with_its_reason(make):
    from color_stereo_ros.core import SettingsError

    def check(settings):
        if settings.range.max_depth > 1.5:
            raise SettingsError('too far for this rig')

    owner = make()
    owner.declare(check=check)
    assert owner.set(range__max_depth=2.0).reason == 'too far for this rig'


def test_a_mistyped_override_is_reported_with_the_nearest_name(make):
    owner = make(range__min_deph=0.3)
    owner.declare().warn_of_unknown()
    assert owner.warnings == ["parameter 'range.min_deph' is unknown and ignored; did you mean "
                              "'range.min_depth'?"]


def test_parameters_of_the_sibling_node_are_not_reported(make):
    owner = make(range__min_depth=0.3)
    NodeParameters(owner.node, PatternNodeSettings()).warn_of_unknown()
    assert owner.warnings == []


@pytest.mark.parametrize('name, settings', [('range_node', RangeNodeSettings()),
                                            ('pattern_node', PatternNodeSettings())])
def test_the_shipped_file_is_made_of_the_defaults(name, settings):
    text = (CONFIG / f'{name}.yaml').read_text()
    assert text == parameter_file(name, settings), (
        'write it again: python -m color_stereo_ros.parameters.files config')


@pytest.mark.parametrize('name, settings', [('range_node', RangeNodeSettings()),
                                            ('pattern_node', PatternNodeSettings())])
def test_the_shipped_file_holds_every_default_in_its_type(name, settings):
    content = yaml.safe_load((CONFIG / f'{name}.yaml').read_text())
    groups = content[f'/**/{name}']['ros__parameters']
    values = {f'{group}.{key}': value for group, keys in groups.items()
              for key, value in keys.items()}
    assert values == flat(settings)
    assert [type(value) for value in values.values()] == [
        type(value) for value in flat(settings).values()]


def test_a_dump_of_all_parameters_starts_the_node_again_unchanged(tmp_path):
    given = {'range.min_depth': 0.3, 'matching.method': 'paper', 'sync.queue_size': 4,
             'output.compact_points': True}
    first = NodeProcess(tmp_path / 'first.txt', parameters=given)
    rig = Rig()
    dump = {}
    names = rig.parameter_names()
    for name in names:
        dump[name] = rig.get_parameter(name)
    assert first.stop() == 0
    assert {name: dump[name] for name in given} == given
    file = tmp_path / 'dump.yaml'
    file.write_text(yaml.safe_dump({'/range_node': {'ros__parameters': dump}}))
    second = NodeProcess(tmp_path / 'second.txt', arguments=['--params-file', str(file)])
    again = {name: rig.get_parameter(name) for name in rig.parameter_names()}
    assert second.stop() == 0
    rig.close()
    assert again == dump
    assert 'unknown' not in second.text() and 'Traceback' not in second.text()


@pytest.mark.parametrize('namespace', ['', '/cell/left_arm'])
def test_the_shipped_file_is_found_in_every_namespace(make, tmp_path, namespace):
    text = (CONFIG / 'range_node.yaml').read_text().replace('queue_size: 8', 'queue_size: 5')
    file = tmp_path / 'changed.yaml'
    file.write_text(text)
    owner = make('--params-file', str(file), '-r', f'__ns:={namespace or "/"}',
                 '-r', '__node:=range_node')
    assert owner.declare().settings.sync.queue_size == 5


def dumped(rig):
    """Return all parameters of a node as `ros2 param dump` writes them."""
    tree = {}
    for name in sorted(rig.parameter_names()):
        *groups, key = name.split('.')
        place = tree
        for group in groups:
            place = place.setdefault(group, {})
        place[key] = rig.get_parameter(name)
    return yaml.dump({rig.target: {'ros__parameters': tree}}, default_flow_style=False)


@pytest.mark.parametrize('module', ['range_node', 'lifecycle_range_node', 'pattern_node'])
def test_a_node_takes_a_dump_of_its_own_parameters(module, tmp_path):
    node = NodeProcess(tmp_path / 'log.txt', module)
    rig = Rig(node_name=module.removeprefix('lifecycle_'))
    try:
        file = tmp_path / 'dump.yaml'
        file.write_text(dumped(rig))
        client = AsyncParameterClient(rig.node, rig.target)
        future = client.load_parameter_file(str(file), True)
        results = rig.spin_until(lambda: future.done() and future.result(), 'an answer').results
        names = list(parameter_dict_from_yaml_file(str(file), True))
        assert len(results) == len(names) > 5
        assert 'start_type_description_service' in names
        refused = {name: result.reason for name, result in zip(names, results)
                   if not result.successful}
        assert refused == {}
        assert not rig.set_parameters(start_type_description_service=False).successful
    finally:
        rig.close()
        assert node.stop() == 0


def test_the_bare_word_off_is_taken_though_ros_reads_it_as_false(make):
    owner = make('-p', 'matching.third_view:=off', '-p', 'matching.row_alignment:=off')
    owner.declare()
    assert owner.parameters.settings.matching.row_alignment == 'off'
    assert owner.set(matching__row_alignment='correct').successful
    assert owner.set(matching__row_alignment=False).successful
    assert owner.parameters.settings.matching.row_alignment == 'off'
    assert owner.node.get_parameter('matching.row_alignment').value == 'off'
    assert not owner.set(matching__row_alignment=True).successful
    assert not owner.set(output__frame=False).successful

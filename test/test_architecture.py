# SPDX-License-Identifier: Apache-2.0
"""The doors between the rooms of the house, read from the source."""

import ast
from pathlib import Path
import re
import sys

import pytest

PACKAGE = Path(__file__).parents[1] / 'color_stereo_ros'
SOURCES = {path.relative_to(PACKAGE).as_posix(): ast.parse(path.read_text(encoding='utf-8'))
           for path in sorted(PACKAGE.rglob('*.py'))}
MESSAGES = {'rclpy', 'sensor_msgs', 'stereo_msgs', 'std_msgs', 'std_srvs', 'diagnostic_msgs',
            'geometry_msgs', 'rcl_interfaces', 'builtin_interfaces', 'rosbags'}
# No test or user of the package may need them: they are not installable with pip everywhere.
NEVER = {'message_filters', 'cv_bridge', 'image_geometry', 'sensor_msgs_py', 'tf2_ros',
         'ros2cli', 'rosbag2_py'}
ENCODING = re.compile(r'(rgb8|bgr8|rgba8|bgra8|mono8|mono16|32FC1|16UC1|bayer_.*)$')
# What numba is made of, where a function is written that numba cannot.
COMPILER = {'core/_band_kernels.py': {'llvmlite'}}


def imports(tree, module_level_only=False):
    """Yield (level, module) for each import: level 0 is absolute, 1 the own folder, 2 above."""
    nodes = tree.body if module_level_only else ast.walk(tree)
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from ((0, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            if node.module is None:
                yield from ((node.level, alias.name) for alias in node.names)
            else:
                yield node.level, node.module


def rooms(name):
    """Return the rooms of this package that one module imports from, by their first name."""
    found = set()
    room = name.split('/')[0] if '/' in name else ''
    for level, module in imports(SOURCES[name]):
        parts = module.split('.')
        if level == 0 and parts[0] == 'color_stereo_ros':
            found.add(parts[1] if len(parts) > 1 else '')
        elif level == 1:
            found.add(room)
        elif level == 2:
            found.add(parts[0])
    return found


def foreign(name, **options):
    """Return the top-level packages that one module imports, standard library excluded."""
    return {module.split('.')[0] for level, module in imports(SOURCES[name], **options)
            if level == 0} - set(sys.stdlib_module_names)


def in_room(room):
    """Return the modules of a room."""
    return [name for name in SOURCES if name.startswith(f'{room}/')]


def siblings(name):
    """Return the modules of its own folder that a module imports, and their names within."""
    return {module.split('.')[0] for level, module in imports(SOURCES[name]) if level == 1}


@pytest.mark.parametrize('name', in_room('core'))
def test_the_core_imports_itself_and_numerical_libraries_only(name):
    assert rooms(name) <= {'core'}
    assert foreign(name) <= {'numpy', 'numba', 'cv2', 'yaml'} | COMPILER.get(name, set())


@pytest.mark.parametrize('name', [n for n in SOURCES if not n.startswith('tools/')])
def test_nobody_imports_the_tools(name):
    assert 'tools' not in rooms(name)


# The node that plays the simulated rig is the simulator's own door to ROS.
@pytest.mark.parametrize('name', [n for n in in_room('nodes') if n != 'nodes/sim_rig.py'])
def test_nodes_need_no_simulator_and_no_evaluation(name):
    assert not rooms(name) & {'sim', 'evaluation'}


@pytest.mark.parametrize('name', [*in_room('sim'), *in_room('evaluation')])
def test_simulator_and_evaluation_know_nothing_of_ros(name):
    assert not foreign(name) & MESSAGES
    assert 'nodes' not in rooms(name)


@pytest.mark.parametrize('name', SOURCES)
def test_no_module_needs_ros_packages_that_are_not_everywhere(name):
    assert not foreign(name) & NEVER


@pytest.mark.parametrize('name', SOURCES)
def test_heavy_optional_packages_are_imported_where_they_are_used(name):
    assert not foreign(name, module_level_only=True) & {'mitsuba', 'rosbags', 'scipy'}


@pytest.mark.parametrize('name', SOURCES)
def test_compiled_code_lives_in_kernel_modules(name):
    if 'numba' in foreign(name):
        assert name.endswith('_kernels.py')


@pytest.mark.parametrize('name', [n for n in SOURCES if n.endswith('_kernels.py')])
def test_kernels_know_arrays_only(name):
    assert foreign(name) <= {'numpy', 'numba'} | COMPILER.get(name, set())
    assert all(sibling == 'types' or sibling.endswith('_kernels') for sibling in siblings(name))


@pytest.mark.parametrize('name', [n for n in SOURCES if n.endswith('_kernels.py')])
def test_kernels_never_assume_that_there_is_no_nan(name):
    # a kernel module may import the name of its flags from another
    constants = {node.targets[0].id: node.value
                 for module, source in SOURCES.items() if module.endswith('_kernels.py')
                 for node in source.body
                 if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)}
    for node in ast.walk(SOURCES[name]):
        if isinstance(node, ast.keyword) and node.arg == 'fastmath':
            value = node.value
            flags = ast.literal_eval(
                constants[value.id] if isinstance(value, ast.Name) else value)
            assert not flags or {'nsz', 'arcp', 'contract', 'afn', 'reassoc'} >= set(flags)


@pytest.mark.parametrize('name, allowed', [
    ('core/types.py', {'triangulation'}), ('core/settings.py', {'types'}),
    ('core/triangulation.py', {'types'}), ('core/pattern.py', {'settings', 'types'}),
    ('core/calibration.py', {'types', 'yaml_file'}), ('core/rectification.py', {'types'}),
    ('core/color.py', {'_kernels', 'types'})])
def test_rooms_of_the_core_open_the_doors_they_need_and_no_other(name, allowed):
    assert siblings(name) <= allowed


@pytest.mark.parametrize('name', [*in_room('core'), *in_room('sim'), *in_room('evaluation')])
def test_only_nodes_and_tools_know_image_encodings(name):
    texts = {node.value for node in ast.walk(SOURCES[name])
             if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    assert not [text for text in texts if ENCODING.match(text)]


@pytest.mark.parametrize('name', [n for n in SOURCES if n != 'nodes/messages.py'])
def test_only_the_messages_module_knows_bayer_patterns(name):
    texts = {node.value for node in ast.walk(SOURCES[name])
             if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    assert not [text for text in texts if re.fullmatch(r'bayer_[a-z]{4}8', text)]


@pytest.mark.parametrize('name', SOURCES)
def test_every_module_and_public_name_has_a_docstring(name):
    tree = SOURCES[name]
    assert ast.get_docstring(tree) or not tree.body
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.name.startswith('_'):
            if node in tree.body:
                assert ast.get_docstring(node), f'{name}: {node.name}'


@pytest.mark.parametrize('name', SOURCES)
def test_every_source_begins_with_its_license(name):
    text = (PACKAGE / name).read_text(encoding='utf-8')
    assert not text or '# SPDX-License-Identifier: Apache-2.0' in text.splitlines()[:2]

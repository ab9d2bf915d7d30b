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
"""The doors between the rooms of the house, read from the source."""

import ast
from pathlib import Path
import re
import sys

from lanes import tree_of

PACKAGE = Path(__file__).parents[1] / 'color_stereo_ros'
SOURCES = [path.relative_to(PACKAGE).as_posix() for path in sorted(PACKAGE.rglob('*.py'))]

# Each room: the rooms that its modules import from, besides their own.
DOORS = {
    'errors': '',
    'patience': '',
    'pages': '',
    'files': 'errors',
    'core': 'errors files',
    'parameters': 'errors files core',
    'messages': 'errors files core',
    'sim': 'errors files core',
    'calibration': 'errors files core patience pages',
    'evaluation': 'errors files core parameters sim pages calibration',
    'recordings': 'errors files core parameters messages patience',
    'nodes': 'errors files core parameters messages patience calibration',
    'viewer': 'errors files core parameters messages patience pages calibration recordings nodes',
    'bench': 'errors files core parameters messages patience calibration sim evaluation '
             'recordings nodes',
    'demo': 'errors files core parameters messages patience calibration sim evaluation recordings '
            'nodes',
    'cli': 'errors files core parameters messages patience pages calibration sim evaluation '
           'recordings nodes viewer bench demo',
    '__main__': 'cli',
}
# Modules with a door of their own: the node that plays the simulated rig, the boards that the rig
# sees, and what measures the viewer with the pair of the command `process`.
SIDE_DOORS = {'nodes/sim_rig.py': 'sim', 'sim/board_shape.py': 'calibration',
              'bench/viewer.py': 'viewer cli'}

# Rooms within the core: the rooms that they must not know, besides those above.
CLOSED = {
    'core/compiled': 'settings cameras patterns projector surface paper',
    'core/settings': 'cameras projector surface paper',
    'core/cameras': 'patterns projector surface paper',
    'core/patterns': 'cameras projector surface paper',
    'core/projector': 'patterns surface paper',
    'core/rows': 'patterns projector surface paper',
    'core/health': 'patterns projector surface paper',
    'core/surface': 'paper',
    'core/paper': 'surface',
}

# Each room: the packages that it needs, besides Python's own library.
PACKAGES = {
    'errors': '',
    'patience': '',
    'pages': 'numpy cv2 matplotlib viser',
    'files': 'numpy cv2 yaml',
    'core': 'numpy cv2',
    'calibration': 'numpy cv2 matplotlib',
    'parameters': 'yaml',
    'messages': 'numpy cv2',
    'sim': 'numpy cv2 mitsuba',
    'evaluation': 'numpy cv2 yaml matplotlib PIL scipy tqdm',
}
# Recordings, nodes and what is built on them need what their users install.
ROS = {'rclpy', 'sensor_msgs', 'stereo_msgs', 'std_msgs', 'std_srvs', 'diagnostic_msgs',
       'geometry_msgs', 'rcl_interfaces', 'builtin_interfaces'}
# No test or user of the package may need them: they are not installable with pip everywhere.
NEVER = {'message_filters', 'cv_bridge', 'image_geometry', 'sensor_msgs_py', 'tf2_ros',
         'ros2cli', 'rosbag2_py'}
# What everybody may know of numba; the rest of it, and llvmlite, is behind core/compiled.
PUBLIC_NUMBA = {'njit', 'prange', 'get_num_threads', 'set_num_threads', 'threading_layer'}

# Of this package, kernels import these modules.
KERNELS_MAY_IMPORT = re.compile(r'core\.compiled(\.\w+)?$|(.*\.)?(status|status_codes|tuning)$'
                                r'|.*kernels$')
NAN_SAFE = {'nsz', 'arcp', 'contract', 'afn', 'reassoc'}
LATE = {'mitsuba', 'rosbags', 'scipy', 'viser', 'websockets'}
KERNELS = [name for name in SOURCES if name.endswith('kernels.py')]
COMPILED = [name for name in SOURCES if name.startswith('core/compiled/')]
ENCODING = re.compile(r'(rgb8|bgr8|rgba8|bgra8|mono8|mono16|32FC1|16UC1|bayer_.*)$')
ENCODING_ROOMS = {'messages', 'parameters', 'recordings', 'nodes', 'bench', 'demo'}


def tree(name):
    """Return the syntax tree of a module; read when a test asks, not when tests are collected."""
    return tree_of(PACKAGE / name)


def dotted(name):
    """Return the name of a module below the package: core/settings/__init__.py, core.settings."""
    return name.removesuffix('.py').removesuffix('__init__').replace('/', '.').strip('.')


MODULES = {dotted(name): name for name in SOURCES}


def imports(name, module_level_only=False):
    """
    Yield (module, attribute or None) for each import of one module.

    Modules of this package begin with a dot and are absolute: .core.settings; what else there is
    has its own name: numpy.

    """
    package = dotted(name) if name.endswith('__init__.py') else dotted(name).rpartition('.')[0]
    nodes = tree(name).body if module_level_only else ast.walk(tree(name))
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from ((ours(alias.name), None) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            if node.level:
                above = package.split('.') if package else []
                parts = above[:len(above) - node.level + 1] + (node.module or '').split('.')
                module = '.' + '.'.join(filter(None, parts))
            else:
                module = ours(node.module)
            yield from ((module, alias.name) for alias in node.names)


def ours(module):
    """Return the name of a module of this package with a dot in front, another as it is."""
    first, _, rest = module.partition('.')
    return '.' + rest if first == 'color_stereo_ros' else module


def needed(name, **options):
    """Return the modules of this package that one module names in its imports."""
    found = set()
    for module, attribute in imports(name, **options):
        if module.startswith('.'):
            inner = '.'.join(filter(None, (module[1:], attribute)))
            found.add(inner if inner in MODULES else module[1:])
    return found


def loaded(name):
    """Return the modules that run when a module is imported: with the packages above them."""
    own = dotted(name)
    found = set()
    for module in needed(name):
        found.add(module)
        parts = module.split('.')
        packages = {'.'.join(parts[:count]) for count in range(1, len(parts))}
        found |= {package for package in packages if not f'{own}.'.startswith(f'{package}.')}
    return found - {own}


def foreign(name, **options):
    """Return the top-level packages that one module imports, standard library excluded."""
    return {module.split('.')[0] for module, _ in imports(name, **options)
            if not module.startswith('.')} - set(sys.stdlib_module_names)


def room_of(module):
    """Return the room of a module, given by dots; '' for the package itself."""
    return module.split('.')[0]


def in_rooms(*rooms):
    """Return the modules of some rooms."""
    return [name for name in SOURCES if room_of(dotted(name)) in rooms]


def texts(name):
    """Return all strings of a module."""
    return {node.value for node in ast.walk(tree(name))
            if isinstance(node, ast.Constant) and isinstance(node.value, str)}


def breaches(names, found_in):
    """Return what a rule finds in some modules, by their names; {} = it is kept."""
    found = {name: found_in(name) for name in sorted(names)}
    return {name: sorted(what) for name, what in found.items() if what}


def circle(graph):
    """Return modules each of which imports the next and the last the first, or []."""
    finished, path = set(), []

    def visit(module):
        if module in path:
            return path[path.index(module):]
        if module in finished:
            return []
        path.append(module)
        for following in sorted(graph[module]):
            if found := visit(following):
                return found
        finished.add(path.pop())
        return []

    return next(filter(None, map(visit, sorted(graph))), [])


def test_every_room_has_its_doors_written_down():
    assert {room_of(module) for module in MODULES} - {''} == set(DOORS)


def test_rooms_open_the_doors_they_need_and_no_other():
    def beyond(name):
        room = room_of(dotted(name))
        allowed = {'', room, *DOORS[room].split(), *SIDE_DOORS.get(name, '').split()}
        return {module for module in needed(name) if room_of(module) not in allowed}

    assert breaches([name for name in SOURCES if dotted(name)], beyond) == {}


def test_rooms_of_the_core_do_not_know_what_is_built_on_them():
    def beyond(name):
        closed = CLOSED[name.rpartition('/')[0]].split()
        return {module for module in needed(name)
                if any(f'{module}.'.startswith(f'core.{room}.') for room in closed)}

    assert breaches([name for name in SOURCES if name.rpartition('/')[0] in CLOSED], beyond) == {}


def test_no_module_imports_another_in_a_circle():
    assert circle({dotted(name): loaded(name) for name in SOURCES}) == []


def test_circles_are_found():
    assert circle({'a': {'b'}, 'b': {'c', 'd'}, 'c': set(), 'd': {'b'}}) == ['b', 'd']
    assert circle({'a': {'b', 'c'}, 'b': {'c'}, 'c': set()}) == []


def test_rooms_need_the_packages_they_say_and_no_other():
    def beyond(name):
        allowed = set(PACKAGES[room_of(dotted(name))].split())
        if name in KERNELS:
            allowed = {'numpy', 'numba'}
        elif name in COMPILED:
            allowed = {'numpy', 'numba', 'llvmlite'}
        elif name.startswith('messages/'):
            allowed |= ROS  # where they are used; the next test
        return foreign(name) - allowed

    assert breaches(in_rooms(*PACKAGES), beyond) == {}


def test_messages_and_recordings_can_be_imported_without_ros():
    assert breaches(in_rooms('messages', 'recordings'),
                    lambda name: foreign(name, module_level_only=True) & ROS) == {}


def test_no_module_needs_ros_packages_that_are_not_everywhere():
    assert breaches(SOURCES, lambda name: foreign(name) & NEVER) == {}


def test_heavy_optional_packages_are_imported_where_they_are_used():
    assert breaches(SOURCES, lambda name: foreign(name, module_level_only=True) & LATE) == {}


def test_compiled_code_lives_in_kernel_modules():
    assert breaches(set(SOURCES) - {*KERNELS, *COMPILED},
                    lambda name: foreign(name) & {'numba', 'llvmlite'}) == {}


def test_the_insides_of_numba_are_behind_one_door():
    def beyond(name):
        return {attribute or module for module, attribute in imports(name)
                if module.split('.')[0] == 'numba'} - PUBLIC_NUMBA

    assert breaches(set(SOURCES) - set(COMPILED), beyond) == {}


def test_kernels_know_arrays_only():
    assert breaches(KERNELS, lambda name: {module for module in needed(name)
                                           if not KERNELS_MAY_IMPORT.match(module)}) == {}


def test_kernels_never_assume_that_there_is_no_nan():
    # a kernel module may import the name of its flags from another
    constants = {node.targets[0].id: node.value
                 for module in (*KERNELS, *COMPILED) for node in tree(module).body
                 if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)}

    def flags_of(value):
        if isinstance(value, ast.Name):
            value = constants.get(value.id)  # None: handed on by what makes decorators
        return set() if value is None else set(ast.literal_eval(value) or ())

    assert breaches((*KERNELS, *COMPILED), lambda name: set().union(*(
        flags_of(node.value) for node in ast.walk(tree(name))
        if isinstance(node, ast.keyword) and node.arg == 'fastmath')) - NAN_SAFE) == {}


def test_only_who_handles_messages_knows_image_encodings():
    names = [name for name in SOURCES if room_of(dotted(name)) not in ENCODING_ROOMS]
    assert breaches(names, lambda name: set(filter(ENCODING.match, texts(name)))) == {}


def test_one_module_knows_bayer_patterns():
    names = [name for name in SOURCES
             if any(re.fullmatch(r'bayer_[a-z]{4}8?', text) for text in texts(name))]
    assert len(names) == 1 and names[0].startswith('messages/')


def test_every_module_and_public_name_has_a_docstring():
    def without(name):
        body = tree(name).body
        public = [node for node in body if isinstance(node, (ast.FunctionDef, ast.ClassDef))
                  and not node.name.startswith('_')]
        return {getattr(node, 'name', 'module') for node in (tree(name), *public)
                if body and not ast.get_docstring(node)}

    assert breaches(SOURCES, without) == {}


def test_lines_of_source_have_at_most_99_columns():
    folders = PACKAGE, PACKAGE.parent / 'test', PACKAGE.parent / '.ci'
    long = [f'{path.relative_to(PACKAGE.parent)}:{number}'
            for folder in folders for path in sorted(folder.rglob('*.py'))
            for number, line in enumerate(path.read_text(encoding='utf-8').splitlines(), 1)
            if len(line) > 99]
    assert not long


def test_every_source_begins_with_its_license():
    def first_lines(name):
        return (PACKAGE / name).read_text(encoding='utf-8').splitlines()[:2]

    assert [name for name in SOURCES
            if first_lines(name) and '# SPDX-License-' 'Identifier: Apache-2.0' not in
            first_lines(name)] == []

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
Which tests are quick: read from the source, so that nobody has to mark them.

A module is not quick if importing it imports ROS or the simulator. A test of a quick module is not
quick if it, its fixtures or the functions it calls start a process, or import one of the former.

"""

import ast
from functools import lru_cache
from pathlib import Path
import sys

TESTS = Path(__file__).resolve().parent
PACKAGE = TESTS.parent / 'color_stereo_ros'
ROS = {'rclpy', 'builtin_interfaces', 'diagnostic_msgs', 'geometry_msgs', 'lifecycle_msgs',
       'rcl_interfaces', 'rosgraph_msgs', 'sensor_msgs', 'std_msgs', 'std_srvs', 'stereo_msgs'}
SIMULATOR = {'mitsuba', 'color_stereo_ros.sim'}
CLUSTERS = {'distributed'}
"""Starts processes from threads, where a refusal is not heard: who waits for them would hang."""
STARTERS = frozenset({'subprocess', 'multiprocessing'})
FORBIDDEN_EVENTS = {'subprocess.Popen', 'os.fork', 'os.forkpty', 'os.posix_spawn', 'os.exec'}
LONG_FILES = (
    # The first process compiles the kernels of the surface method. Those that begin with the next
    # files need others, or a cache of their own: nothing is compiled twice at the same time.
    'test_compiled', 'test_processes', 'test_sim_light', 'test_stamp', 'test_lanes',
    'test_node_faults', 'test_ready_kernels',
    # Then by their time.
    'test_demo', 'test_replay_of_others', 'test_color_simulated', 'test_evaluation_report',
    'test_rows', 'test_sim_boards', 'test_range_node', 'test_fits', 'test_surface_kernels',
    'test_surface', 'test_unlike', 'test_third_view', 'test_extras', 'test_calibrate_live',
    'test_pattern_node', 'test_account', 'test_whole_or_not_at_all', 'test_parts', 'test_bench',
    'test_bands', 'test_package', 'test_paper', 'test_method_pictures', 'test_sim_rig_node',
    'test_render', 'test_project', 'test_evaluation_methods', 'test_tuning', 'test_sim_truth',
    'test_stress_light', 'test_capture', 'test_capture_clocks', 'test_capture_loop')
"""Files of tests that run first: a long one that begins last leaves cores without work."""


def longest_first(items):
    """Sort tests: those of LONG_FILES first, in this order, then the others as they come."""
    place = {name: index for index, name in enumerate(LONG_FILES)}
    items.sort(key=lambda item: place.get(item.path.stem, len(place)))


def is_slow_import(module):
    """Tell whether a module belongs to ROS, to the simulator or to a cluster."""
    return module.split('.')[0] in ROS | SIMULATOR | CLUSTERS or any(
        f'{module}.'.startswith(f'{name}.') for name in SIMULATOR)


@lru_cache(maxsize=None)
def tree_of(path):
    """Return the syntax tree of a file."""
    return ast.parse(path.read_text(encoding='utf-8'))


def imported(nodes, package):
    """Yield the full names of modules that import statements name, for a module of a package."""
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package.split('.')[:len(package.split('.')) - node.level + 1]
            module = '.'.join(filter(None, [*(base if node.level else []), node.module]))
            yield module
            yield from (f'{module}.{alias.name}' for alias in node.names)


@lru_cache(maxsize=None)
def file_of(module):
    """Return the file of a module of this package or of the tests, or None."""
    if module.split('.')[0] == PACKAGE.name:
        place = PACKAGE.joinpath(*module.split('.')[1:])
    else:
        place = TESTS / module
    found = [path for path in (place / '__init__.py', place.with_suffix('.py')) if path.is_file()]
    return found[0] if found else None


def packages_of(module):
    """Return a module and the packages that are imported before it."""
    parts = module.split('.')
    return ['.'.join(parts[:count]) for count in range(1, len(parts) + 1)]


@lru_cache(maxsize=None)
def slow_imports(path):
    """Return what importing a file imports of ROS and of the simulator."""
    found, seen, waiting = set(), set(), [path]
    while waiting:
        path = waiting.pop()
        if path in seen:
            continue
        seen.add(path)
        slow, files = first_imports(path)
        found |= slow
        waiting += files
    return found


@lru_cache(maxsize=None)
def first_imports(path):
    """Return what a file itself imports: of ROS and the simulator, and files of ours."""
    modules = list(imported(tree_of(path).body, package_of(path)))
    names = {name for module in modules for name in packages_of(module)}
    return set(filter(is_slow_import, modules)), set(map(file_of, names)) - {None}


def package_of(path):
    """Return the package that relative imports of a file start from."""
    if not path.is_relative_to(PACKAGE):
        return ''
    return '.'.join(path.parent.relative_to(PACKAGE.parent).parts)


@lru_cache(maxsize=None)
def needs_more_than_a_process(path, name):
    """Tell whether a function of a test module, with all it uses, is not quick."""
    seen, waiting = set(), [(path, name), *((path, own) for own in always_used(path))]
    while waiting:
        path, name = waiting.pop()
        if (path, name) in seen:
            continue
        seen.add((path, name))
        if name in imported_names(path, STARTERS):
            return True
        origin = origins(path).get(name)
        if origin:
            waiting.append((origin, name))
        if name not in definitions(path):
            continue
        if imports_inside(path, name) & STARTERS or any(map(is_slow_import,
                                                            imports_inside(path, name))):
            return True
        waiting += [(path, used) for used in names_in(path, name)]
    return False


@lru_cache(maxsize=None)
def definitions(path):
    """Return the functions, classes and constants of a file by their names."""
    found = {}
    for node in tree_of(path).body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            found[node.name] = node
        elif isinstance(node, ast.Assign):
            found.update({target.id: node for target in node.targets
                          if isinstance(target, ast.Name)})
    return found


@lru_cache(maxsize=None)
def origins(path):
    """Return the files of the tests from which a file takes names, by the names."""
    return {alias.name: file_of(node.module) for node in tree_of(path).body
            if isinstance(node, ast.ImportFrom) and not node.level
            and (TESTS / f'{node.module}.py').is_file() for alias in node.names}


@lru_cache(maxsize=None)
def imported_names(path, modules=frozenset()):
    """Return the names by which a file knows some modules and what is in them."""
    names = set()
    for node in tree_of(path).body:
        if isinstance(node, ast.Import):
            names |= {alias.asname or alias.name for alias in node.names if alias.name in modules}
        elif isinstance(node, ast.ImportFrom) and node.module in modules:
            names |= {alias.asname or alias.name for alias in node.names}
    return names


@lru_cache(maxsize=None)
def always_used(path):
    """Return the fixtures of a file that every test of it uses."""
    return [name for name, node in definitions(path).items()
            if isinstance(node, ast.FunctionDef)
            and any('autouse=True' in ast.unparse(line) for line in node.decorator_list)]


@lru_cache(maxsize=None)
def imports_inside(path, name):
    """Return the modules that a definition of a file imports itself."""
    return set(imported(ast.walk(definitions(path)[name]), ''))


@lru_cache(maxsize=None)
def names_in(path, name):
    """Return the names that a definition uses, arguments and names of fixtures included."""
    node, found = definitions(path)[name], set()
    for inner in ast.walk(node):
        if isinstance(inner, ast.Name):
            found.add(inner.id)
        elif isinstance(inner, ast.arg):
            found.add(inner.arg)
    return found | {
        inner.value for line in getattr(node, 'decorator_list', [])
        if 'usefixtures' in ast.unparse(line) for inner in ast.walk(line)
        if isinstance(inner, ast.Constant) and isinstance(inner.value, str)}


def keep_quick():
    """From now on, refuse to start processes and to import ROS, the simulator or a cluster."""
    def refuse(event, arguments):
        if event in FORBIDDEN_EVENTS:
            raise RuntimeError(f'the quick lane starts no process ({event})')
        if event == 'import' and is_slow_import(arguments[0]):
            raise RuntimeError(f'the quick lane does not import {arguments[0]}')

    sys.addaudithook(refuse)

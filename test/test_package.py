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
"""The package as a whole: what setup.py, package.xml and colcon make of it."""

import ast
import configparser
from importlib.metadata import entry_points
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
from xml.etree import ElementTree

import color_stereo_ros

import pytest

ROOT = Path(__file__).resolve().parents[1]
EXECUTABLES = {'range_node', 'lifecycle_range_node', 'pattern_node', 'sim_rig_node',
               'color_stereo', 'show_rviz', 'play_recording'}

ROSDEP_KEYS = {'cv2': 'python3-opencv', 'numba': 'python3-numba', 'llvmlite': 'python3-numba',
               'numpy': 'python3-numpy', 'yaml': 'python3-yaml',
               'matplotlib': 'python3-matplotlib', 'PIL': 'python3-matplotlib',
               'pygame': 'python3-pygame', 'tqdm': 'python3-tqdm'}
"""Module to rosdep key, where they differ."""

FIELD = 'License-Identifier'
"""Apart from its prefix, so that `reuse lint` does not take this file for licensed twice."""

FROM_PYPI = {'mitsuba', 'drjit', 'rosbags', 'mcap', 'dask', 'distributed', 'viser',
             'websockets'}
"""Modules of the extras that rosdep does not install."""


@pytest.fixture(scope='module')
def manifest():
    return ElementTree.parse(ROOT / 'package.xml').getroot()


def test_package_xml_setup_py_and_the_installation_agree_on_the_version(manifest):
    setup = re.search(r"^    version='([\d.]+)',$", (ROOT / 'setup.py').read_text(), re.M).group(1)
    assert manifest.findtext('version') == setup == color_stereo_ros.__version__


def test_the_addresses_are_the_same_in_package_xml_and_setup_py(manifest):
    home = re.search(r"^HOME = f'(.*)'$", (ROOT / 'setup.py').read_text(), re.M).group(1)
    home = home.replace('{NAME}', 'color_stereo_ros')
    assert {url.get('type'): url.text for url in manifest.iter('url')} == {
        'website': home, 'repository': home, 'bugtracker': f'{home}/issues'}


def test_the_maintainer_has_a_valid_mail_address(manifest):
    assert re.fullmatch(r'[\w.+-]+@[\w-]+(\.[\w-]+)+', manifest.find('maintainer').get('email'))


def test_the_license_is_the_same_everywhere(manifest):
    assert manifest.findtext('license') == 'Apache-2.0'
    assert 'Apache License' in (ROOT / 'LICENSE').read_text()
    unmarked = [path for folder in ('color_stereo_ros', 'test', 'launch')
                for path in (ROOT / folder).rglob('*.py')
                if not path.read_text().startswith(f'# SPDX-{FIELD}: Apache-2.0\n')]
    assert not unmarked


def imported_modules(path):
    """Return the names of the top-level packages that a module imports from elsewhere."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name.partition('.')[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            names.add(node.module.partition('.')[0])
    return names


def test_package_xml_names_every_dependency_that_is_imported(manifest):
    imported = set()
    for folder in ('color_stereo_ros', 'launch'):
        for path in (ROOT / folder).rglob('*.py'):
            imported |= imported_modules(path)
    foreign = imported - sys.stdlib_module_names - FROM_PYPI - {'color_stereo_ros',
                                                                'mpl_toolkits'}
    named = {element.text for element in manifest.iter('exec_depend')}
    missing = {name for name in foreign if ROSDEP_KEYS.get(name, name) not in named}
    assert not missing


def test_the_launch_files_start_programs_of_this_package_alone(manifest):
    named = {element.text for element in manifest.iter('exec_depend')}
    assert 'ros2launch' in named
    assert not named & {'rviz2', 'ros2bag', 'rosbag2_storage_mcap', 'launch', 'launch_ros'}
    for path in (ROOT / 'launch').glob('*.xml'):
        launch = ElementTree.parse(path).getroot()
        assert {node.get('pkg') for node in launch.iter('node')} <= {'color_stereo_ros'}, path
        for command in (element.get('cmd') for element in launch.iter('executable')):
            assert command.startswith('$(find-pkg-prefix color_stereo_ros)/lib/color_stereo_ros/')
            assert command.split()[1].rpartition('/')[2] in EXECUTABLES, command


def test_every_executable_can_be_imported():
    points = {point.name: point for point in entry_points(group='console_scripts')
              if point.value.startswith('color_stereo_ros.')}
    assert set(points) == EXECUTABLES
    for point in points.values():
        assert callable(point.load())


def test_scripts_go_where_ros2_run_looks_for_them():
    config = configparser.ConfigParser()
    config.read(ROOT / 'setup.cfg')
    assert config['develop']['script_dir'] == '$base/lib/color_stereo_ros'
    assert config['install']['install_scripts'] == '$base/lib/color_stereo_ros'


@pytest.fixture(scope='module')
def workspace(tmp_path_factory):
    """Build a copy of the sources with colcon and return the workspace."""
    folder = tmp_path_factory.mktemp('workspace')
    shutil.copytree(ROOT, folder / 'src' / 'color_stereo_ros', ignore=shutil.ignore_patterns(
        '.git', '.venv*', '*_output', '__pycache__', '*.egg-info', 'sample', 'build', 'install',
        'log'))
    colcon = Path(sys.executable).with_name('colcon')
    environment = {**os.environ, 'PATH': f'{colcon.parent}{os.pathsep}{os.environ["PATH"]}'}
    built = subprocess.run([colcon, 'build', '--event-handlers', 'console_direct+'], cwd=folder,
                           env=environment, capture_output=True, text=True, timeout=300)
    assert built.returncode == 0, built.stdout + built.stderr
    return folder


def test_colcon_puts_the_executables_where_ros2_run_looks(workspace):
    folder = workspace / 'install/color_stereo_ros/lib/color_stereo_ros'
    assert {path.name for path in folder.iterdir() if os.access(path, os.X_OK)} == EXECUTABLES


def test_colcon_installs_manifest_marker_parameters_and_launch_files(workspace):
    share = workspace / 'install/color_stereo_ros/share'
    assert (share / 'ament_index/resource_index/packages/color_stereo_ros').exists()
    assert (share / 'color_stereo_ros/package.xml').exists()
    for folder in ('config', 'launch'):
        expected = {path.name for path in (ROOT / folder).iterdir() if path.is_file()}
        installed = {path.name for path in (share / 'color_stereo_ros' / folder).iterdir()}
        assert installed == expected


def test_the_installed_command_runs_from_the_sourced_workspace(workspace):
    command = ('source install/setup.bash && '
               'color_stereo --version && command -v color_stereo && '
               'python -c "import color_stereo_ros; print(color_stereo_ros.__file__)"')
    environment = {**os.environ, 'PYTHONPATH': '',
                   'PATH': f'{Path(sys.executable).parent}{os.pathsep}{os.environ["PATH"]}'}
    ran = subprocess.run(['bash', '-c', command], cwd=workspace, env=environment,
                         capture_output=True, text=True, timeout=120)
    assert ran.returncode == 0, ran.stderr
    version, command, place = ran.stdout.splitlines()
    assert version == f'color_stereo_ros {color_stereo_ros.__version__}'
    for found in (command, place):
        assert found.startswith(str(workspace / 'install'))


def test_colcon_installs_the_data_files_inside_the_package(workspace):
    place = workspace / 'install/color_stereo_ros/lib'
    installed = next(place.rglob('color_stereo_ros/__init__.py')).parent
    source = ROOT / 'color_stereo_ros'
    wanted = {path.relative_to(source) for path in source.rglob('*')
              if path.suffix not in ('.py', '.pyc', '.nbi', '.nbc') and path.is_file()
              and '__pycache__' not in path.parts}
    assert wanted <= {path.relative_to(installed) for path in installed.rglob('*')}

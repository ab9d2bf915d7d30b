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
"""The lanes: what is quick is read from the source, figures are kept with their goals."""

import json
from pathlib import Path
import subprocess
import sys
from types import SimpleNamespace

import lanes
import proof
import pytest

HERE = Path(__file__).parent


def quick(*words):
    """Run the quick lane in a process of its own."""
    return subprocess.run([sys.executable, '-m', 'pytest', '--quick', '-q', '-p',
                           'no:cacheprovider', *words], cwd=HERE.parent, capture_output=True,
                          text=True)


def test_the_quick_lane_imports_neither_ros_nor_the_simulator():
    ran = quick('--collect-only')  # an import of them is an error of the collection
    assert ran.returncode == 0, ran.stdout
    modules = {line.partition('::')[0] for line in ran.stdout.splitlines()}
    assert {'test/test_surface.py', 'test/test_calibration.py'} <= modules
    assert not {'test/test_range_node.py', 'test/test_sim_light.py'} & modules
    assert 'test_kernels_give_the_same_without_the_compiler' not in ran.stdout


@pytest.mark.parametrize('line, word', [
    ('import rclpy', 'does not import rclpy'),
    ('from color_stereo_ros import sim', 'does not import color_stereo_ros.sim'),
    ('from distributed import LocalCluster', 'does not import distributed'),
    ('import os; os.fork()', 'starts no process'),
    ('import subprocess; subprocess.run(["true"])', 'starts no process')])
def test_the_quick_lane_refuses_what_is_not_quick(line, word):
    ran = subprocess.run([sys.executable, '-c', f'import lanes; lanes.keep_quick(); {line}'],
                         cwd=HERE, capture_output=True, text=True)
    assert ran.returncode and word in ran.stderr


@pytest.mark.parametrize('name, slow', [
    ('test_calibration.py', False), ('test_surface.py', False), ('test_range_node.py', True),
    ('test_node_parts.py', True), ('test_sim_light.py', True)])
def test_modules_that_import_ros_or_the_simulator_are_not_quick(name, slow):
    assert bool(lanes.slow_imports(HERE / name)) == slow


def test_long_files_run_first_and_the_others_as_they_come():
    assert len(set(lanes.LONG_FILES)) == len(lanes.LONG_FILES)
    assert all((HERE / f'{name}.py').is_file() for name in lanes.LONG_FILES)
    first, second = lanes.LONG_FILES[:2]
    items = [SimpleNamespace(path=Path(f'{name}.py'), name=number) for number, name in enumerate(
        ['test_b', second, 'test_a', first, second])]
    lanes.longest_first(items)
    assert [item.name for item in items] == [3, 1, 4, 0, 2]


SOURCE = """
import subprocess
import pytest

COMMAND = ['true']


@pytest.fixture
def built():
    return helper()


def helper():
    return subprocess.run(COMMAND)


def test_plain():
    assert COMMAND


def test_own():
    subprocess.run(COMMAND)


def test_by_fixture(built):
    assert built


@pytest.mark.usefixtures('built')
def test_by_mark():
    pass


def test_inside():
    import rclpy
"""


@pytest.mark.parametrize('name, slow', [
    ('test_plain', False), ('test_own', True), ('test_by_fixture', True), ('test_by_mark', True),
    ('test_inside', True)])
def test_what_a_test_uses_tells_whether_it_is_quick(tmp_path, name, slow):
    path = tmp_path / 'test_some.py'
    path.write_text(SOURCE)
    assert not lanes.slow_imports(path)
    assert lanes.needs_more_than_a_process(path, name) == slow


def test_a_proof_runs_the_same_code_longer():
    assert list(proof.Effort(False).seeds(3, 200)) == [0, 1, 2]
    assert len(proof.Effort(True).seeds(3, 200)) == 200
    assert proof.Effort(True).count(1, 7) == 7


def test_a_figure_is_kept_even_if_it_misses_its_goal():
    kept = []
    figures = proof.Figures('test_x', kept)
    figures('good', 1.0, 'px', over=range(3), at_most=2)
    with pytest.raises(AssertionError, match='bad = 3.0 px, at least 0 and at most 2'):
        figures('bad', 3.0, 'px', over=4, at_least=0, at_most=2)
    assert [(figure.name, figure.goal, figure.seeds) for figure in kept] == [
        ('good', 'at most 2', '0 .. 2'), ('bad', 'at least 0 and at most 2', '4 rounds')]


@pytest.mark.processes  # git says the revision
def test_the_figures_are_written_with_revision_and_versions(tmp_path):
    kept = []
    proof.Figures('test_x', kept)('error', 0.5, 'px', over=range(2), at_most=1)
    path = tmp_path / 'proof.json'
    proof.write(kept, {'test_y'}, path)
    record = json.loads(path.read_text())
    assert record['figures'] == [{'name': 'error', 'value': 0.5, 'unit': 'px',
                                  'goal': 'at most 1', 'seeds': '0 .. 1', 'test': 'test_x'}]
    assert record['failed'] == ['test_y']
    assert {'revision', 'changed_files', 'versions'} <= set(record['facts'])

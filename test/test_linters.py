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
"""What the linters of ROS 2 want; they themselves run in `make release-check`, and on Jazzy."""

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
import re
import subprocess
import sys
from xml.etree import ElementTree

from color_stereo_ros.core.compiled.requirement import REQUIREMENT

ROOT = Path(__file__).resolve().parents[1]
LINTERS = 'ament_copyright', 'ament_flake8', 'ament_pep257', 'ament_xmllint'
HEAD = ('# SPDX-License-{}: Apache-2.0\n# Copyright 2026 color_stereo_ros contributors\n#\n'
        '# Licensed under the Apache License, Version 2.0').format('Identifier')


def test_every_source_begins_with_license_and_holder_of_the_rights():
    without = [str(path.relative_to(ROOT)) for folder in ('color_stereo_ros', 'test')
               for path in sorted((ROOT / folder).rglob('*.py'))
               if path.stat().st_size and not path.read_text().startswith(HEAD)]
    assert not without


def test_every_xml_file_is_well_formed():
    files = [path for folder in ('launch', 'config', 'color_stereo_ros')
             for path in (ROOT / folder).rglob('*.xml')]
    for path in [ROOT / 'package.xml', *files]:
        ElementTree.parse(path)


def test_the_linters_that_are_installed_find_nothing(monkeypatch):
    monkeypatch.chdir(ROOT)
    for name in LINTERS:
        if find_spec(name) is not None:
            folders = ['launch', 'config'] if name == 'ament_xmllint' else [
                'color_stereo_ros', 'test']
            assert import_module(f'{name}.main').main(argv=folders) == 0, name


def test_ruff_finds_nothing_in_the_version_that_pre_commit_runs():
    pinned = {re.search(pattern, (ROOT / name).read_text()).group(1) for name, pattern in (
        ('setup.py', r"'ruff==([\d.]+)'"), ('.ci/release/tools.txt', r'ruff==([\d.]+)'),
        ('.pre-commit-config.yaml', r'ruff-pre-commit\n    rev: v([\d.]+)'))}
    assert len(pinned) == 1
    if find_spec('ruff') is not None:  # the build farm of ROS has none
        ran = subprocess.run([sys.executable, '-m', 'ruff', 'check', '--no-cache', '.'], cwd=ROOT,
                             capture_output=True, text=True)
        assert ran.returncode == 0, ran.stdout


def test_the_linters_are_dependencies_of_the_tests():
    named = {element.text for element in ElementTree.parse(ROOT / 'package.xml').iter(
        'test_depend')}
    assert {*LINTERS, 'python3-pytest'} == named


def test_constraints_name_the_oldest_and_the_newest_versions_within_the_bounds():
    def versions(name):
        lines = (ROOT / 'constraints' / name).read_text().splitlines()
        return dict(line.split('==') for line in lines if not line.startswith('#'))

    oldest, newest = versions('oldest.txt'), versions('newest.txt')
    assert set(oldest) <= set(newest)
    assert REQUIREMENT in (ROOT / 'setup.py').read_text()
    low, high = (tuple(map(int, bound.strip('numba<>=').split('.')))
                 for bound in REQUIREMENT.split(','))
    for found in (oldest['numba'], newest['numba']):
        assert low <= tuple(map(int, found.split('.')[:2])) < high

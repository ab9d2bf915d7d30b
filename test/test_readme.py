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
"""What the documents say is what the code does."""

import ast
from pathlib import Path
import re
import shlex
import subprocess
import sys

from color_stereo_ros.cli import main as cli
from color_stereo_ros.cli.tables import documents, TABLES, with_tables
from color_stereo_ros.core import ColorStereoError

import pytest

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / 'README.md').read_text()
MOST_LINES = 120
DOCUMENTS = sorted([*ROOT.glob('*.md'), *(ROOT / 'docs').glob('*.md'), *(ROOT / 'sample').glob(
    '*.md')])


def code_of(text):
    """Return the lines that a Markdown text shows as code to type."""
    fenced = ''.join(re.findall(r'```(?:bash|sh|console)?\n(.*?)```', text, re.DOTALL))
    return [line.strip() for line in fenced.splitlines() + re.findall(r'^ {4}(\S.*)$', text, re.M)]


@pytest.mark.parametrize('path', documents(ROOT), ids=lambda path: path.name)
def test_the_tables_are_those_of_the_code(path):
    assert path.read_text() == with_tables(path.read_text()), 'run `make tables`'


def test_the_reference_has_the_topics_the_parameters_and_the_commands():
    reference = (ROOT / 'docs/parameters.md').read_text()
    for name in ('outputs', 'parameters', 'commands'):
        assert TABLES[name]() in reference


def test_the_package_index_can_follow_the_links_of_the_readme():
    shown = subprocess.run([sys.executable, 'setup.py', '--long-description'], cwd=ROOT,
                           capture_output=True, text=True, check=True).stdout
    targets = re.findall(r'\]\(([^)]+)\)', shown)
    assert 'raw.githubusercontent.com' in shown
    assert [each for each in targets if not re.match('https:|#', each)] == []


def test_the_readme_is_short():
    assert len(README.splitlines()) < MOST_LINES


def test_an_unknown_table_is_refused():
    with pytest.raises(ColorStereoError, match="table 'weather' is not one of parameters"):
        with_tables('<!-- table: weather -->\n<!-- end -->')


def test_the_readme_names_make_demo_and_make_test_and_they_exist():
    typed = {line.partition('#')[0].strip() for line in code_of(README)}
    assert {'make demo', 'make test'} <= typed


@pytest.mark.parametrize('path', DOCUMENTS, ids=lambda path: path.name)
def test_every_make_target_that_a_document_names_exists(path):
    text = path.read_text()
    for target in set(re.findall(r'(?:`|^ {4})make ([a-z-]+)', text, re.M)):
        planned = subprocess.run(['make', '--dry-run', target], cwd=ROOT, capture_output=True,
                                 text=True)
        assert planned.returncode == 0, planned.stderr


@pytest.mark.parametrize('path', DOCUMENTS, ids=lambda path: path.name)
def test_every_subcommand_that_a_document_names_exists(path):
    named = set(re.findall(r'(?:^|[`/ ])color_stereo ([a-z]+)', path.read_text(), re.M))
    assert named <= set(cli.find_commands())


def command_lines(text):
    """Yield the arguments of every `color_stereo` that a text shows, continued lines joined."""
    for line in code_of(re.sub(r'\\\n\s*', ' ', text)):
        if line.startswith('color_stereo '):
            yield shlex.split(re.sub(r'\s#.*|\.\.\.', '', line))[1:]


@pytest.mark.parametrize('path', DOCUMENTS, ids=lambda path: path.name)
def test_every_command_line_that_a_document_shows_is_accepted(path):
    for words in command_lines(path.read_text()):
        try:
            assert callable(cli.parsed(words).run)
        except SystemExit as ending:
            assert ending.code == 0, words


@pytest.mark.parametrize('path', DOCUMENTS, ids=lambda path: path.name)
def test_every_link_inside_the_repository_leads_somewhere(path):
    for target in re.findall(r'\]\(([^)#]+)(?:#[^)]*)?\)', path.read_text()):
        if not re.match(r'[a-z]+:', target):
            assert (path.parent / target).exists(), target


def test_the_index_of_the_manual_lists_every_page():
    pages = {path.name for path in (ROOT / 'docs').glob('*.md')} - {'index.md'}
    assert pages == set(re.findall(r'\]\((\w+\.md)\)', (ROOT / 'docs/index.md').read_text()))


def test_the_example_of_the_library_runs(tmp_path, monkeypatch):
    import numpy as np

    from color_stereo_ros.core import StereoCalibration
    example = re.search(r'```python\n(.*?)```', README, re.DOTALL).group(1)
    assert ast.parse(example)
    camera = np.array([[60.0, 0, 31.5], [0, 60.0, 23.5], [0, 0, 1]])
    StereoCalibration.from_arrays((64, 48), camera, [], camera, [], np.eye(3), [-0.06, 0, 0]
                                  ).to_yaml(tmp_path / 'left.yaml', tmp_path / 'right.yaml')
    monkeypatch.chdir(tmp_path)
    black = np.zeros((48, 64, 3), np.uint8)
    scope = {'left_rgb': black, 'right_rgb': black}
    exec(example, scope)
    assert scope['result'].depth.shape == (48, 64)
    assert scope['pattern'].dtype == np.uint8


def test_continuous_integration_runs_the_tests_of_the_readme():
    assert 'make test' in (ROOT / '.ci/run').read_text()


def test_the_changelog_begins_with_what_comes_or_with_the_version_of_the_package():
    lines = (ROOT / 'CHANGELOG.rst').read_text().splitlines()
    assert lines[1] == 'Changelog for package color_stereo_ros'
    heading = next(one for one, two in zip(lines[3:], lines[4:]) if re.fullmatch('-+', two))
    version = re.search('<version>(.*)</version>', (ROOT / 'package.xml').read_text()).group(1)
    released = re.fullmatch(r'(\S+) \(\d{4}-\d\d-\d\d\)', heading)
    assert heading == 'Forthcoming' or released and released.group(1) == version

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
"""The documents are easy to read: short paragraphs, and every name in them leads somewhere."""

from dataclasses import fields
from pathlib import Path
import re

from color_stereo_ros.core.constants import listed
from color_stereo_ros.core.surface.tuning import TUNING

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / 'color_stereo_ros'
PAGES = [*sorted(ROOT.glob('*.md')), *sorted((ROOT / 'docs').glob('*.md')),
         ROOT / 'sample/README.md']
MOST_LINES, WIDEST = 5, 140
CHANGELOG_LINES = 25
SHIPPED = 'config/', 'constraints/', 'launch/', 'test/', 'docs/', 'sample/', '.ci/'
ROOMS = tuple(f'{path.name}/' for path in PACKAGE.iterdir() if path.is_dir())

each_page = pytest.mark.parametrize('path', PAGES, ids=lambda path: str(path.relative_to(ROOT)))


def prose(text):
    """Return a Markdown text without fenced code, comments, headings, tables and indented code."""
    text = re.sub(r'^(```|~~~).*?^\1$|^<!-- [a-z]+: .*?^<!-- end -->$', '', text,
                  flags=re.M | re.S)
    return re.sub(r'^(<!--.*|#.*|\|.*| {4}.*)$', '', text, flags=re.M)


def paragraphs(text):
    """Return the paragraphs and list items of a Markdown text, each a list of lines."""
    found = [[]]
    for line in prose(text).splitlines():
        if not line.strip():
            found.append([])
        elif re.match(r'\s*([-*]|\d+\.) ', line):
            found.append([line])
        else:
            found[-1].append(line)
    return [each for each in found if each]


def anchors(text):
    """Return the anchors that GitHub gives the headings of a Markdown text."""
    titles = re.findall(r'^#+ (.*)$', re.sub(r'^```.*?^```$', '', text, flags=re.M | re.S), re.M)
    return {re.sub(r'[^\w\- ]', '', title.lower()).replace(' ', '-') for title in titles}


def source_of(name):
    """Return the file or folder that a name of ours in backticks means, None if it is not ours."""
    if name.startswith(SHIPPED):
        return ROOT / name
    if name.startswith((*ROOMS, 'color_stereo_ros/')):
        return (ROOT if name.startswith('color_stereo_ros/') else PACKAGE) / name
    if re.fullmatch(r'[\w*]+\.py', name):
        return next(PACKAGE.rglob(name), ROOT / name)
    return None


@each_page
def test_paragraphs_have_at_most_five_lines(path):
    long = [lines[0] for lines in paragraphs(path.read_text()) if len(lines) > MOST_LINES]
    assert not long


@each_page
def test_lines_of_prose_are_not_too_wide(path):
    wide = [line for lines in paragraphs(path.read_text()) for line in lines if len(line) > WIDEST]
    assert not wide


@each_page
def test_links_and_images_lead_somewhere(path):
    for target in re.findall(r'\]\(([^)\s]+)\)', path.read_text()):
        if re.match(r'[a-z]+:', target):
            continue
        file, _, anchor = target.partition('#')
        page = path.parent / file if file else path
        assert page.exists(), target
        assert not anchor or anchor in anchors(page.read_text()), target


@each_page
def test_the_files_that_a_page_names_exist(path):
    for quoted in re.findall(r'`([^`\n]+)`', path.read_text()):
        # `file.py: symbol`, or a command whose first word is a file
        source = source_of(re.split(':? ', quoted)[0].rstrip('/'))
        assert source is None or list(source.parent.glob(source.name)), quoted


@each_page
def test_the_functions_that_a_page_names_are_in_their_files(path):
    for file, symbol in re.findall(r'`([\w/]+\.py): (\w+)', path.read_text()):
        known = [source_of(file)] if '/' in file else PACKAGE.rglob(file)
        defined = rf'^\s*(def|class) {symbol}\b|^{symbol}\b'
        assert any(re.search(defined, source.read_text(), re.M) for source in known), (
            file, symbol)


@each_page
def test_the_modules_that_a_page_names_exist(path):
    for name in re.findall(r'\bcolor_stereo_ros((?:\.[a-z_]+)+)', path.read_text()):
        parts = name[1:].split('.')
        module = PACKAGE.joinpath(*parts)
        assert (module.is_dir() or module.with_suffix('.py').exists()
                or module.parent.with_suffix('.py').exists()), name


@each_page
def test_the_constants_that_a_page_names_exist(path):
    groups = '|'.join(spec.name for spec in fields(TUNING))
    named = set(re.findall(rf'`((?:{groups})\.\w+)`', path.read_text()))
    files = {name for name in named if name.endswith(('.py', '.yaml', '.png'))}
    assert named - files <= {entry.name for entry in listed(TUNING)}


def test_the_sequence_of_the_steps_is_that_of_the_code():
    page = (ROOT / 'docs/surface_method.md').read_text()
    code = ' '.join((PACKAGE / 'core/surface/method.py').read_text().split())
    lines = re.search(r'```python\n(.*?)```', page, re.DOTALL).group(1).splitlines()
    assert len(lines) > 5 and not [line for line in lines if line.strip() not in code]


def test_the_changelog_of_this_version_is_short():
    section = (ROOT / 'CHANGELOG.rst').read_text().split('-----------\n', 1)[1]
    assert len(section.strip().splitlines()) <= CHANGELOG_LINES

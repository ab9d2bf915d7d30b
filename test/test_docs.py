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
"""The manual reads as well in the browser of the repository as on its site."""

from pathlib import Path
import re
import runpy

from color_stereo_ros import core

from PIL import Image
import pytest

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / 'docs'
PAGES = [*sorted(ROOT.glob('*.md')), *sorted(DOCS.glob('*.md'))]
WIDTHS = range(480, 1601)  # px: text of narrower or wider ones is hard to read in a page
MOST_BYTES = 1_500_000
HOME = 'https://github.com/color-stereo-ros/color_stereo_ros'

each_page = pytest.mark.parametrize('path', PAGES, ids=lambda path: path.name)


def pictures(text):
    """Return the pictures of a Markdown text: pairs of alternative text and target."""
    return re.findall(r'!\[([^]]*)\]\(([^)\s]+)', text)


@each_page
def test_pictures_say_in_words_what_they_show(path):
    assert all(len(words.split()) > 2 for words, _ in pictures(path.read_text()))
    assert '<img' not in path.read_text()


@each_page
def test_pictures_have_a_readable_size_and_are_small_files(path):
    for _, target in pictures(path.read_text()):
        picture = path.parent / target
        assert Image.open(picture).width in WIDTHS, target
        assert picture.stat().st_size < MOST_BYTES, target


def test_no_picture_is_left_that_no_page_shows():
    shown = {(path.parent / target).resolve() for path in PAGES
             for _, target in pictures(path.read_text())}
    assert shown == {path for kind in ('png', 'webp', 'svg') for path in DOCS.rglob(f'*.{kind}')}


def test_the_site_has_the_pages_of_the_index_in_their_order():
    listed = re.findall(r'^\| \[[^]]+\]\((\w+)\.(?:md|rst)\)', (DOCS / 'index.md').read_text(),
                        re.M)
    assert listed == re.findall(r'^   (\w+)$', (DOCS / 'index.rst').read_text(), re.M)


def test_the_site_describes_every_public_name_of_the_core():
    named = re.findall(r'^\.\. auto\w+:: (\w+)$', (DOCS / 'api.rst').read_text(), re.M)
    assert sorted(named) == sorted(core.__all__)


def test_links_that_leave_the_manual_lead_to_the_repository_on_the_site():
    configuration = runpy.run_path(str(DOCS / 'conf.py'))
    source = ['[here](../README.md#extras), [there](nodes.md), `API <nodes.md>`_']
    configuration['complete'](None, 'page', source)
    assert source == [f'[here]({HOME}/blob/main/README.md#extras), [there](nodes.md), '
                      '`API <nodes.html>`_']


def test_external_links_are_found_whole():
    links = runpy.run_path(str(ROOT / '.ci/links'))['links']
    text = 'see [a](https://a.org/b.html#c), <https://d.org/e>, https://f.org/g. and `x`'
    assert links(text) == {'https://a.org/b.html#c', 'https://d.org/e', 'https://f.org/g'}


def test_the_table_of_versions_has_a_column_for_each_set():
    table = runpy.run_path(str(ROOT / '.ci/versions'))['table']
    rows = table({'oldest': {'numpy': '1.26.4'}, 'newest': {'numpy': '2.4.6', 'pyyaml': '6.0.4'}},
                 ['9 passed', '8 passed, 1 failed']).splitlines()
    assert {'|  | oldest | newest |', '| numpy | 1.26.4 | 2.4.6 |', '| PyYAML | - | 6.0.4 |',
            '| tests | 9 passed | 8 passed, 1 failed |'} <= set(rows)
    assert len(rows) == 5, 'what no set holds has no row'


def test_the_newest_versions_are_asked_of_what_setup_gives_a_lower_bound():
    bounded = runpy.run_path(str(ROOT / '.ci/versions'))['BOUNDED']
    assert len(bounded) == len(set(bounded)) and not {'setuptools', 'python_requires'} & {*bounded}
    lines = (ROOT / 'constraints/newest.txt').read_text().splitlines()
    assert {line.partition('==')[0] for line in lines if not line.startswith('#')} <= {*bounded}


def test_the_addresses_of_the_repository_agree():
    for name in ('README.md', 'SECURITY.md', 'CITATION.cff', 'docs/conf.py',
                 '.github/ISSUE_TEMPLATE/config.yml'):
        found = re.findall(r'https://github\.com/color[\w-]*/\w*', (ROOT / name).read_text())
        assert set(found) == {HOME}, name

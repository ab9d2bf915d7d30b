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
The site of the documentation: the pages of this folder and the API, by Sphinx and MyST.

`make docs` builds it; rosdoc2 reads this file, too (rosdoc2.yaml). The pages are written for the
browser of the repository. What Sphinx needs beside that is added here while it reads them.

"""

import re

project = 'color_stereo_ros'
author = 'color_stereo_ros contributors'
copyright = author  # noqa: A001, Sphinx names it so
HOME = 'https://github.com/color-stereo-ros/color_stereo_ros'

extensions = ['myst_parser', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon']
source_suffix = {'.rst': 'restructuredtext', '.md': 'markdown'}
# index.rst includes index.md: rosdoc2 wants an index.rst. The others are pages that rosdoc2
# makes: copies of README and the like, and a page for every module.
exclude_patterns = ['index.md', 'standard*', '__*', '*links.rst', 'modules.rst',
                    'color_stereo_ros*.rst']
html_theme = 'furo'
html_title = project

myst_heading_anchors = 6
autodoc_member_order = 'bysource'
autodoc_default_options = {'members': True, 'undoc-members': False}
autodoc_preserve_defaults = True
default_role = 'code'  # single backticks of docstrings
autodoc_typehints = 'none'  # docstrings tell shapes and units, too
napoleon_google_docstring = False
napoleon_use_rtype = False
suppress_warnings = ['myst.header']  # a page may begin its sections at any level


def complete(app, name, source):
    """Let links to other folders lead to the repository, those of the API to pages."""
    text = re.sub(r'\]\(\.\./([^)\s]+)\)', rf']({HOME}/blob/main/\1)', source[0])
    source[0] = re.sub(r'<(\w+)\.md>`_', r'<\1.html>`_', text)


def setup(app):
    """Let Sphinx call `complete` for every page."""
    app.connect('source-read', complete)

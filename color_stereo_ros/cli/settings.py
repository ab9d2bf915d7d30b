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
"""`color_stereo settings`: the core's settings with unit, range, default and meaning."""

SUMMARY = 'print the settings of the core, as a table or as a YAML parameter file'
NEEDS = ''


def add_arguments(parser):
    """Declare the arguments."""
    from .arguments import add_settings_arguments
    parser.add_argument('--format', choices=('table', 'yaml', 'markdown'), default='table',
                        help='table: for reading (default); yaml: for --params-file of the '
                             'nodes and --config of the commands; markdown: for documents')
    add_settings_arguments(parser)


def run(args):
    """Print the settings of the command line."""
    from ..parameters.files import settings_text
    from .arguments import settings_from
    settings = settings_from(args)
    if args.format == 'yaml':
        print(settings_text(settings.flat(), '/**'), end='')
    elif args.format == 'markdown':
        print(markdown_table(settings), end='')
    else:
        print(text_table(settings), end='')


def rows(settings):
    """Yield (name, value, legal values, description) of every setting, as text."""
    from ..core.settings import described, flat
    values = flat(settings)
    for name, _, meta in described(settings):
        yield name, _text(values[name]), _legal(values[name], meta), meta['description']


def _text(value):
    return str(value).lower() if isinstance(value, bool) else str(value) or "''"


def _legal(value, meta):
    if meta['choices']:
        return ', '.join(meta['choices'])
    if isinstance(value, bool):
        return 'true, false'
    if isinstance(value, str):
        return 'text'
    limits = f'{meta["minimum"]} .. {meta["maximum"]}'
    return f'{limits} {meta["unit"]}'.strip()


def text_table(settings):
    """Return the settings for a terminal: one line each, the description below it."""
    import textwrap
    lines = []
    for name, value, legal, description in rows(settings):
        lines.append(f'{name} = {value}   [{legal}]')
        lines += textwrap.wrap(description, 95, initial_indent='    ', subsequent_indent='    ')
    return '\n'.join(lines) + '\n'


def markdown_table(settings):
    """Return the settings of any dataclass made of groups as a Markdown table."""
    lines = ['| parameter | default | values | meaning |', '|---|---|---|---|']
    lines += [f'| `{name}` | {value} | {legal} | {description} |'
              for name, value, legal, description in rows(settings)]
    return '\n'.join(lines) + '\n'

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
"""Read YAML files; what goes wrong is said in one line and without the words of programmers."""

from pathlib import Path
import re

import yaml

from ..errors import bounded

MOST_BYTES = 1_000_000
MOST_VALUES = 20_000
"""Keys and values of a file, those that it repeats by reference counted each time."""
MOST_ITEMS = 10_000
"""Lines and commas of a file: it has hardly more than twice as many keys and values."""
MOST_LEVELS = 100
IMPOSSIBLE = (ValueError, TypeError, AttributeError, KeyError, OverflowError)
"""What PyYAML raises for scalars such as 2024-99-99."""


class UnreadableError(Exception):
    """A file is missing or no YAML; the text says which, and in which line, but not the file."""


class _Loader(yaml.SafeLoader):
    """Reads what a person would write; a file that grows while it is read is refused."""

    def __init__(self, text):
        super().__init__(text)
        self._values = 0
        self._levels = 0
        self._sizes = {}  # values below a complete node, by its id

    def compose_node(self, parent, index):
        """Compose a node and count it."""
        line = self.peek_event().start_mark.line + 1
        if self.check_event(yaml.AliasEvent):
            node = super().compose_node(parent, index)
            if id(node) not in self._sizes:
                raise UnreadableError(f'contains itself, see line {line}')
            self._count(self._sizes[id(node)], line)
            return node
        self._levels += 1
        if self._levels > MOST_LEVELS:
            raise UnreadableError(f'has more than {MOST_LEVELS} levels, see line {line}')
        before = self._values
        self._count(1, line)
        node = super().compose_node(parent, index)
        self._sizes[id(node)] = self._values - before
        self._levels -= 1
        return node

    def _count(self, number, line):
        self._values += number
        if self._values > MOST_VALUES:
            raise UnreadableError(f'has more than {MOST_VALUES} values, see line {line}')

    def compose_mapping_node(self, anchor):
        """Compose a mapping and refuse a key that is there twice."""
        node = super().compose_mapping_node(anchor)
        keys = set()
        for key, _ in node.value:
            name = (key.tag, key.value) if isinstance(key, yaml.ScalarNode) else id(key)
            if name in keys and key.tag != 'tag:yaml.org,2002:merge':
                raise UnreadableError(f'has the key {str(key.value)[:60]!r} twice, see line '
                                      f'{key.start_mark.line + 1}')
            keys.add(name)
        return node


# OpenCV's FileStorage writes matrices as mappings with this tag.
_Loader.add_constructor('tag:yaml.org,2002:opencv-matrix',
                        lambda loader, node: loader.construct_mapping(node, deep=True))


def load_yaml(path):
    """
    Return the content of a YAML file.

    Parameters
    ----------
    path : path-like
        Of the file.

    Raises
    ------
    UnreadableError
        If the file cannot be read, is no text, no YAML, or more than settings can be: see
        `parse_yaml`.

    """
    return parse_yaml(read_text(path))


def read_text(path):
    """Return the text of a file of at most `MOST_BYTES`; errors as for `load_yaml`."""
    try:
        with open(Path(path), 'rb') as file:
            data = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise UnreadableError(f'cannot be read: {error.strerror}') from error
    if len(data) > MOST_BYTES:
        raise UnreadableError(f'has more than {MOST_BYTES} bytes')
    try:
        return data.decode('utf-8')
    except UnicodeDecodeError as error:
        raise UnreadableError('cannot be read: it is no text') from error


def parse_yaml(text):
    """
    Return the content of a YAML text of one document.

    Parameters
    ----------
    text : str
        The content of a file.

    Raises
    ------
    UnreadableError
        If the text is no YAML, has several documents, a key twice, more than `MOST_VALUES`
        values or `MOST_LEVELS` levels, or contains itself.

    """
    documents = parse_documents(text)
    if len(documents) > 1:
        raise UnreadableError(f'holds {len(documents)} documents, expected one')
    return documents[0] if documents else None


def parse_documents(text):
    """Return the contents of the documents of a YAML text that are not empty."""
    # FileStorage's first line is no directive of YAML
    text = re.sub(r'\A\ufeff?%YAML:1\.\d[ \t]*(?=\r?\n|\Z)', '', text)
    _refuse_masses(text)
    try:
        loader = _Loader(text)
        contents = []
        while loader.check_data():
            contents.append(loader.get_data())
    except yaml.YAMLError as error:
        raise UnreadableError(f'is no YAML{_place(error)}') from error
    except IMPOSSIBLE as error:
        raise UnreadableError('is no YAML: it holds an impossible number or date') from error
    return [content for content in contents if content is not None]


def _refuse_masses(text):
    """Refuse at a glance what would keep the parser busy for a long time."""
    if text.count('\n') + text.count(',') > MOST_ITEMS:
        raise UnreadableError(f'has more than {MOST_ITEMS} lines and commas')
    if re.search(r'(?:[\[{]\s*){%d}' % (MOST_LEVELS + 1), text):
        raise UnreadableError(f'has more than {MOST_LEVELS} levels')


def about_number(value):
    """Return a hint where a text was meant as a number: YAML 1.1 takes 1e-1 for a text."""
    if not isinstance(value, str) or not re.fullmatch(r'[-+]?[\d.]+[eE][-+]?\d+', value):
        return ''
    try:
        mantissa, exponent = re.split('[eE]', str(value))
        return (f': YAML 1.1 takes {value} for a text, write '
                f'{float(mantissa)}e{int(exponent):+d}')
    except ValueError:
        return ''


def _place(error):
    mark, problem = getattr(error, 'problem_mark', None), getattr(error, 'problem', None)
    if mark is None:
        return ': it holds characters that are no text'
    text = bounded(problem or 'it ends too early', 200).replace('<stream end>', 'the end')
    return f', line {mark.line + 1}: {text}'


def yaml_text(content):
    """Return the YAML text of a dict of texts, numbers and lists, in its order."""
    return yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=99)

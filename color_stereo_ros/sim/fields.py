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
"""Reads the fields of a YAML description; every error names field, value and what is legal."""

from dataclasses import dataclass
from difflib import get_close_matches
import math
from pathlib import Path

from color_stereo_ros.files.yaml import about_number

from .errors import SceneError

_MISSING = object()


@dataclass(frozen=True)
class Reader:
    """A value of a description with the path that leads to it."""

    value: object
    path: str
    folder: Path = Path('.')

    def fail(self, expected):
        """Raise SceneError for this value."""
        raise SceneError(f'{self.path} = {self.value!r}, expected {expected}')

    def only(self, *known):
        """Refuse unknown fields; the nearest known name is suggested."""
        if not isinstance(self.value, dict):
            self.fail(f'a mapping with some of {", ".join(known)}')
        for name in self.value:
            if name not in known:
                near = get_close_matches(str(name), known, n=1)
                hint = f'; did you mean {near[0]!r}?' if near else ''
                raise SceneError(f'{self.path}.{name} is no known field{hint} '
                                 f'(known: {", ".join(known)})')
        return self

    def has(self, name):
        """Return whether a mapping holds a field."""
        return isinstance(self.value, dict) and self.value.get(name) is not None

    def get(self, name, default=_MISSING):
        """Return the Reader of a field of this mapping, or of its default."""
        if not isinstance(self.value, dict):
            self.fail('a mapping')
        path = f'{self.path}.{name}'
        value = self.value.get(name)
        if value is None:
            if default is _MISSING:
                raise SceneError(f'{path} is missing')
            value = default
        return Reader(value, path, self.folder)

    def items(self):
        """Return the Readers of a list."""
        if not isinstance(self.value, (list, tuple)):
            self.fail('a list')
        return [Reader(value, f'{self.path}[{index}]', self.folder)
                for index, value in enumerate(self.value)]

    def number(self, minimum=-math.inf, maximum=math.inf):
        """Return a finite float within limits."""
        value = self.value
        if isinstance(value, bool) or not isinstance(value, (int, float)) \
                or not abs(value) < math.inf or not minimum <= value <= maximum:
            self.fail(f'a number {minimum:g} .. {maximum:g}{about_number(value)}')
        return float(value)

    def integer(self, minimum, maximum):
        """Return an int within limits."""
        value = self.value
        if isinstance(value, bool) or not isinstance(value, int) \
                or not minimum <= value <= maximum:
            self.fail(f'an integer {minimum} .. {maximum}')
        return value

    def flag(self):
        """Return a bool."""
        if not isinstance(self.value, bool):
            self.fail('true or false')
        return self.value

    def text(self):
        """Return a string."""
        if not isinstance(self.value, str):
            self.fail('a text')
        return self.value

    def choice(self, known):
        """Return one of the known names; the nearest one is suggested otherwise."""
        if not isinstance(self.value, str) or self.value not in known:
            near = get_close_matches(str(self.value), list(known), n=1)
            hint = f'; did you mean {near[0]!r}?' if near else ''
            raise SceneError(f'{self.path} = {self.value!r} is not known{hint} '
                             f'(known: {", ".join(known)})')
        return self.value

    def vector(self, length=3, minimum=-math.inf, maximum=math.inf):
        """Return a tuple of so many finite floats."""
        items = self.value if isinstance(self.value, (list, tuple)) else ()
        if len(items) != length:
            self.fail(f'a list of {length} numbers')
        return tuple(item.number(minimum, maximum) for item in self.items())

    def pair(self, minimum=-math.inf, maximum=math.inf):
        """Return two floats; a single number stands for both."""
        if isinstance(self.value, (int, float)):
            return (self.number(minimum, maximum),) * 2
        return self.vector(2, minimum, maximum)

    def color(self):
        """Return an albedo or gain as three floats 0..1; a single number stands for gray."""
        if isinstance(self.value, (int, float)):
            return (self.number(0.0, 1.0),) * 3
        return self.vector(3, 0.0, 1.0)

    def existing_file(self):
        """Return the path of a file, relative to the folder of the description."""
        path = self.folder / self.text()
        if not path.is_file():
            self.fail(f'a file; {path} does not exist')
        return path

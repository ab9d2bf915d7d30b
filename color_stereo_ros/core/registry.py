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
"""Tables of named entries that anyone can extend: patterns, methods, lens models, outputs."""

from contextlib import contextmanager
from difflib import get_close_matches
import re

from ..errors import ColorStereoError

# capitals behind a '/': image_transport calls a topic compressedDepth
NAME = re.compile(r'[a-z][a-z0-9_]*(/[a-z][a-zA-Z0-9_]*)*')


class Registry:
    """
    Entries by name, in the order in which they were registered.

    A registry is the one source of its names. Whoever lists or checks them asks it each time, so
    an entry that is registered later is known everywhere.

    Parameters
    ----------
    what : str
        What an entry is, for error messages: 'pattern type'.
    kind : type
        The class of the entries; anything else is refused.
    entries : dict
        Names to entries that are there from the start.

    Examples
    --------
    >>> SHAPES = Registry('shape', int, {'triangle': 3})
    >>> SHAPES.register('square', 4)
    4
    >>> SHAPES['square'], list(SHAPES), 'circle' in SHAPES
    (4, ['triangle', 'square'], False)

    """

    def __init__(self, what, kind=object, entries=None):
        """Register the first entries."""
        self.what = what
        self.kind = kind
        self._entries = {}
        for name, entry in (entries or {}).items():
            self.register(name, entry)

    def register(self, name, entry=None):
        """
        Add an entry at the end.

        Parameters
        ----------
        name : str
            Lower-case words joined by `_`, in levels separated by `/`: 'hue_field', 'depth/image'.
        entry : object
            Without it the call is a decorator, `@SHAPES.register('square')`, that registers what
            it decorates.

        Returns
        -------
        entry : object
            The entry itself.

        Raises
        ------
        ColorStereoError
            If the name is malformed or taken, or the entry is of another class.

        """
        if entry is None:
            return lambda decorated: self.register(name, decorated)
        if not isinstance(name, str) or not NAME.fullmatch(name):
            raise ColorStereoError(f'{self.what} {name!r} is no name, expected lower-case '
                                   "letters, digits, '_' and '/', such as 'hue_field' and "
                                   "'depth/image'")
        if name in self._entries:
            raise ColorStereoError(f'{self.what} {name!r} is registered already')
        if not isinstance(entry, self.kind):
            raise ColorStereoError(f'{self.what} {name!r} is a {type(entry).__name__}, expected '
                                   f'{self.kind.__name__}')
        self._entries[name] = entry
        return entry

    def __getitem__(self, name):
        """Return the entry of a name; an unknown one raises ColorStereoError with the names."""
        if name not in self._entries:
            raise ColorStereoError(f'unknown {self.what} {name!r}{suggestion(str(name), self)}; '
                                   f'known are {", ".join(self)}')
        return self._entries[name]

    def __contains__(self, name):
        """Tell whether an entry has this name."""
        return name in self._entries

    def __iter__(self):
        """Iterate over the names."""
        return iter(tuple(self._entries))

    def __len__(self):
        """Return the number of entries."""
        return len(self._entries)

    @property
    def names(self):
        """Return the names of this moment, a tuple of str."""
        return tuple(self._entries)

    def items(self):
        """Return the pairs (name, entry) of this moment, a tuple."""
        return tuple(self._entries.items())

    @contextmanager
    def temporarily(self):
        """Forget, at the end of a `with` block, what was registered inside; for tests."""
        before = dict(self._entries)
        try:
            yield self
        finally:
            self._entries = before


def suggestion(name, known):
    """Return `'; did you mean ...?'` for the known name nearest to a mistyped one, or ''."""
    near = get_close_matches(name, list(known), n=1)
    return f'; did you mean {near[0]!r}?' if near else ''

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
"""What `--help` of a node prints: its topics, services and parameters; no node is started."""

from dataclasses import dataclass
import shutil
import sys
import textwrap

_HELP = '--help', '-h'
_INDENT = 6


@dataclass(frozen=True)
class Usage:
    """What a node is for, and what it opens to others."""

    name: str
    summary: str
    settings: object
    """A dataclass made of groups, the parameters with their defaults."""
    subscribed: tuple = ()
    """(topic, type, meaning) of each; so are the others."""
    published: tuple = ()
    services: tuple = ()

    def text(self, width):
        """Return the help, at most so many columns wide."""
        command = (f'usage: {self.name} [--help] [--ros-args [-p NAME:=VALUE] [-r TOPIC:=TOPIC] '
                   '[--params-file FILE] ...]')
        lines = [*textwrap.wrap(command, width, subsequent_indent=' ' * _INDENT), '',
                 *textwrap.wrap(self.summary, width)]
        for title, rows in (('subscribed topics', self.subscribed),
                            ('published topics', self.published), ('services', self.services)):
            if rows:
                lines += ['', f'{title}:']
                lines += [line for topic, kind, meaning in rows
                          for line in _entry(f'{topic}  ({kind})', meaning, width)]
        return '\n'.join([*lines, '', 'parameters:', *_parameters(self.settings, width)])


def _entry(head, meaning, width):
    """Return the lines of one entry."""
    head = textwrap.wrap(head, width, initial_indent='  ', subsequent_indent=' ' * 2 * _INDENT)
    indent = ' ' * _INDENT
    return [*head, *textwrap.wrap(meaning, width, initial_indent=indent,
                                  subsequent_indent=indent)]


def _parameters(settings, width):
    """Return the lines about all parameters."""
    from ..core.settings import described
    for name, default, meta in described(settings):
        value = repr(default) if isinstance(default, str) else str(default).lower()
        allowed = ''
        if meta['choices'] is not None:
            allowed = f'; {", ".join(meta["choices"])}'
        elif meta['minimum'] is not None:
            allowed = f'; {meta["minimum"]} .. {meta["maximum"]} {meta["unit"]}'.rstrip()
        yield from _entry(f'{name}  ({value}{allowed})', meta['description'], width)


def is_wanted(arguments):
    """
    Tell whether a command line asks for help.

    Parameters
    ----------
    arguments : list of str
        `--help` counts everywhere, `-h` outside of `--ros-args ... --`.

    """
    inside = False
    for word in arguments:
        inside = word == '--ros-args' or (inside and word != '--')
        if word == _HELP[0] or (word in _HELP and not inside):
            return True
    return False


def show(usage):
    """Print a Usage."""
    sys.stdout.write(usage.text(min(shutil.get_terminal_size().columns, 99)) + '\n')

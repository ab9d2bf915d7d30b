# SPDX-License-Identifier: Apache-2.0
"""
The tables of the documentation, made from the code: `python -m color_stereo_ros.cli.tables`.

A Markdown file asks for one by two comment lines, `<!-- table: NAME -->` and `<!-- end -->`, with
the table between them. A test holds the files equal to the code.

"""

from pathlib import Path
import re
import sys

from ..core.status import Status
from ..errors import ColorStereoError

BLOCK = re.compile(r'(<!-- table: (\w+) -->\n).*?(<!-- end -->)', re.DOTALL)


def parameter_table():
    """Return every parameter of range_node."""
    from ..parameters.groups import RangeNodeSettings
    from .settings import markdown_table
    return markdown_table(RangeNodeSettings())


def output_table():
    """Return every output of range_node."""
    from ..messages.outputs import OUTPUTS
    lines = ['| topic | type | meaning |', '|---|---|---|']
    lines += [f'| `{topic}` | {output.type.replace("/msg/", "/")} | {output.description} |'
              for topic, output in OUTPUTS.items()]
    return '\n'.join(lines) + '\n'


def status_table():
    """Return the codes of status/image."""
    lines = ['| code | name | meaning |', '|---|---|---|']
    lines += [f'| {code.value} | {code.name} | {code.meaning} |' for code in Status]
    return '\n'.join(lines) + '\n'


def command_table():
    """Return the subcommands of `color_stereo`."""
    from .main import find_commands
    lines = ['| command | what it does |', '|---|---|']
    lines += [f'| `color_stereo {name}` | {summary} |'
              for name, summary in find_commands().items()]
    return '\n'.join(lines) + '\n'


TABLES = {'parameters': parameter_table, 'outputs': output_table, 'status': status_table,
          'commands': command_table}


def with_tables(text):
    """
    Return a Markdown text with its tables made anew.

    Raises
    ------
    ColorStereoError
        If it asks for a table that is not in `TABLES`.

    """
    def made(match):
        if match.group(2) not in TABLES:
            raise ColorStereoError(f'table {match.group(2)!r} is not one of {", ".join(TABLES)}')
        return match.group(1) + TABLES[match.group(2)]() + match.group(3)
    return BLOCK.sub(made, text)


def documents(root):
    """Return the Markdown files of a source tree that ask for tables."""
    return [path for path in [*sorted(root.glob('*.md')), *sorted((root / 'docs').glob('*.md'))]
            if BLOCK.search(path.read_text(encoding='utf-8'))]


def main():
    """Make the tables of all documents below the working directory anew."""
    from ..files.atomic import write_text
    for path in documents(Path.cwd()):
        text = path.read_text(encoding='utf-8')
        if with_tables(text) != text:
            write_text(path, with_tables(text))
            print(path)


if __name__ == '__main__':
    sys.exit(main())

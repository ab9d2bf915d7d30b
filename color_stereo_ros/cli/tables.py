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


def product_table():
    """Return every product of `color_stereo export`."""
    from ..recordings.products import PRODUCTS
    lines = ['| product | file | content | read by |', '|---|---|---|---|']
    lines += [f'| `{name}` | `{"" if item.film else "STAMP_"}{item.ending}` | {item.description} '
              f'| {item.readers} |' for name, item in PRODUCTS.items()]
    return '\n'.join(lines) + '\n'


def status_table():
    """Return the codes of status/image."""
    lines = ['| code | name | meaning |', '|---|---|---|']
    lines += [f'| {code.value} | {code.name} | {code.meaning} |' for code in Status]
    return '\n'.join(lines) + '\n'


def command_table():
    """Return the subcommands of `color_stereo`, and theirs."""
    from .main import find_commands
    lines = ['| command | what it does | extras |', '|---|---|---|']
    inner = find_commands(constant='COMMANDS')
    for name in find_commands():
        folder = Path(__file__).parent / inner.get(name, '')
        found, needs = find_commands(folder), find_commands(folder, 'NEEDS')
        rows = {f'{name} {each.replace("_", "-")}': each for each in found} \
            if name in inner else {name: name}
        lines += [f'| `color_stereo {words}` | {found[each]} | {needs[each]} |'.replace(
            '|  |', '| |') for words, each in rows.items()]
    return '\n'.join(lines) + '\n'


def tuning_table():
    """Return every constant of the surface method, with its values under other patterns."""
    from ..core.surface.tuning import PERIODIC, slow, TUNING
    return constant_table(TUNING, {'periodic': PERIODIC, 'slow': slow(4)})


def paper_tuning_table():
    """Return every constant of the paper's method."""
    from ..core.paper.tuning import TUNING
    return constant_table(TUNING)


def row_tuning_table():
    """Return every constant of the row alignment."""
    from ..core.rows.tuning import TUNING
    return constant_table(TUNING)


def health_tuning_table():
    """Return every constant of the health of the calibration."""
    from ..core.health.tuning import TUNING
    return constant_table(TUNING)


def third_view_tuning_table():
    """Return every constant of the projector as a third view."""
    from ..core.surface.third.tuning import TUNING
    return constant_table(TUNING)


def projector_tuning_table():
    """Return every constant of the projector's geometry."""
    from ..core.projector.tuning import TUNING
    return constant_table(TUNING)


def account_tuning_table():
    """Return every constant of the doubts about a pair."""
    from ..core.account import TUNING
    return constant_table(TUNING)


def disturbance_table():
    """Return every disturbance of the stress test."""
    from ..evaluation.stress.disturbances import DISTURBANCES
    lines = ['| disturbance | group | what | levels |', '|---|---|---|---|']
    lines += [f'| `{name}` | {entry.group} | {entry.title} | '
              f'{", ".join(f"{level:g}" for level in entry.levels)} {entry.unit} |'
              for name, entry in DISTURBANCES.items()]
    return '\n'.join(line.replace('  |', ' |') for line in lines) + '\n'


def constant_table(constants, variants=None):
    """
    Return a table of constants.

    Parameters
    ----------
    constants : Constants
        Of one stage or method.
    variants : dict or None
        Names of conditions to the changes under them, flat names to `Change`.

    """
    from ..core.constants import listed
    lines = ['| constant | value |', '|---|---|']
    if variants:
        lines = ['| constant | value | other patterns |', '|---|---|---|']
    lines = [f'{line} {rest} |' for line, rest in zip(
        lines, ('unit | what for | where from | how found is recorded', '---|---|---|---'))]
    for entry in listed(constants):
        changes = {name: found[entry.name] for name, found in (variants or {}).items()
                   if entry.name in found}
        cells = [f'`{entry.name}`', shown(entry.value)]
        if variants:
            cells.append('; '.join(f'{name}: {shown(change.value)}'
                                   for name, change in changes.items()))
        origin = [explained(entry.provenance), *(f'{name.capitalize()}: '
                  f'{explained(change.provenance)}' for name, change in changes.items())]
        known = ['yes' if entry.provenance.explained else 'no', *(
            f'{name}: no' for name, change in changes.items() if not change.provenance.explained)]
        cells += [entry.unit, entry.reason, ' '.join(origin), '; '.join(known)]
        lines.append(f'| {" | ".join(cell.replace("|", "/") for cell in cells)} |')
    return '\n'.join(lines) + '\n'


def shown(value):
    """Return a value as the table of constants shows it."""
    if isinstance(value, float):
        return f'{value:.6g}'
    if isinstance(value, tuple) and len(value) > 2 and isinstance(value[0], tuple):
        return f'{len(value)} x {len(value[0])} numbers'
    if isinstance(value, tuple):
        return f'({", ".join(map(shown, value))})'
    return str(value)


def explained(provenance):
    """Return where a value comes from, beginning with the kind of its provenance."""
    link = '; fit it anew by' if provenance.kind == 'recorded' else ' by'
    command = f'{link} `{provenance.command}`' if provenance.command else ''
    return f'*{provenance.kind}{command}*. {provenance.text}'


TABLES = {'parameters': parameter_table, 'outputs': output_table, 'products': product_table,
          'status': status_table, 'commands': command_table, 'tuning': tuning_table,
          'paper_tuning': paper_tuning_table, 'row_tuning': row_tuning_table,
          'health_tuning': health_tuning_table,
          'projector_tuning': projector_tuning_table,
          'third_view_tuning': third_view_tuning_table, 'account_tuning': account_tuning_table,
          'disturbances': disturbance_table}


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

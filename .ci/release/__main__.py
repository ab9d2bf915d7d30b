# SPDX-License-Identifier: Apache-2.0
"""
Run all checks of a release and print a table: `python .ci/release`.

What cannot run here is a row of the table, too, and makes the exit status 1.

"""

import argparse
from pathlib import Path
import re
import shutil
import sys
import time

ROOT = Path(__file__).resolve().parents[2]
OUTPUT = ROOT / 'release_output'
if __name__ == '__main__' and not __package__:
    sys.path.insert(0, str(ROOT / '.ci'))

from release.checks import CHECKS  # noqa: E402, I100
from release.places import Failed, LeftOut, NotHere, Places  # noqa: E402


def main():
    """Return 0 if all checks passed."""
    parser = argparse.ArgumentParser(prog='make release-check', description=__doc__)
    parser.add_argument('--only', metavar='A,B', default='', help='the checks whose name holds '
                        'one of these texts; the check build comes first all the same')
    args = parser.parse_args()
    chosen = [check for check in CHECKS if check.name == 'build' or any(
        text in check.name for text in args.only.split(','))]
    shutil.rmtree(OUTPUT, ignore_errors=True)
    places = Places(ROOT, OUTPUT)
    rows = [run(check, places) for check in chosen]
    text = table(rows)
    (OUTPUT / 'table.md').write_text(text, encoding='utf-8')
    print(f'\n{text}\nLogs and this table are in {OUTPUT.relative_to(ROOT)}/.')
    return int(any(row[2] not in ('passed', 'left out') for row in rows))


def run(check, places):
    """Return one row: name, command, result, figure, seconds."""
    print(f'{check.name} ...', flush=True)
    started = time.monotonic()
    places.log = places.output / f'{re.sub(r"[^a-z0-9.]+", "_", check.name.lower())}.log'
    try:
        result, figure = 'passed', check.function(places)
    except LeftOut as error:
        result, figure = 'left out', str(error)
    except NotHere as error:
        result, figure = 'NOT RUN', str(error)
    except Failed as error:
        result, figure = 'FAILED', str(error)
    print(f'  {result}: {figure}', flush=True)
    return check.name, check.command, result, figure, f'{time.monotonic() - started:.0f} s'


def table(rows):
    """Return rows as a Markdown table."""
    lines = ['| check | command | result | found | time |', '|---|---|---|---|---|']
    return '\n'.join([*lines, *(
        '| ' + ' | '.join([row[0], f'`{row[1]}`', *row[2:]]) + ' |' for row in rows)]) + '\n'


if __name__ == '__main__':
    sys.exit(main())

# SPDX-License-Identifier: Apache-2.0
"""The command `.ci/same_bytes`."""

import argparse
import json
from pathlib import Path
import sys
import tempfile
import time

from tqdm import tqdm

from . import combinations, comparison, speed
from .inputs import Inputs
from .trees import GateError, two_trees

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = """\
examples:
  .ci/same_bytes HEAD                     everything not committed yet changes no byte
  .ci/same_bytes main --quick             a first answer, in a minute or two
  .ci/same_bytes main --only 'paper'      the combinations whose line holds the word
  .ci/same_bytes main --time              is it as fast?
  .ci/same_bytes main --all --json f.json bytes, times and cold start, all figures in a file
  .ci/same_bytes --list                   the combinations, one a line

The exit code is 1 where a byte differs, 2 where the comparison cannot be made, else 0. Times
change no exit code: they depend on what else the machine does.
"""


def main():
    """Do what the command line asks for; return the exit code."""
    options = parse()
    numbered = chosen(options)
    if options.list:
        print('\n'.join(f'[{number}] {each}' for number, each in numbered))
        return 0
    try:
        return compare(options, numbered)
    except GateError as error:
        print(f'same_bytes: {error}', file=sys.stderr)
        return 2


def parse():
    """Return the options."""
    parser = argparse.ArgumentParser(
        prog='.ci/same_bytes', formatter_class=argparse.RawDescriptionHelpFormatter,
        description='Compare the results of this working tree with those of a revision: every '
                    'byte of every\noutput. Both are compiled and run here, from copies.',
        epilog=EXAMPLES)
    parser.add_argument('revision', metavar='REV', nargs='?', help='a commit, branch or tag')
    parser.add_argument('--list', action='store_true', help='print the combinations and end')
    parser.add_argument('--quick', action='store_true', help='a short list of combinations')
    parser.add_argument('--only', metavar='TEXT', default='',
                        help='only combinations whose line in --list holds the text')
    parser.add_argument('--time', action='store_true',
                        help='compare the time of a pair instead of bytes')
    parser.add_argument('--cold', action='store_true',
                        help='compare the start of a process instead of bytes')
    parser.add_argument('--all', action='store_true', help='compare bytes, time and start')
    parser.add_argument('--runs', type=positive, default=5, help='of --time (default 5)')
    parser.add_argument('--rounds', type=positive, default=40,
                        help='of each run of --time (default 40)')
    parser.add_argument('--json', metavar='FILE', type=Path, help='write all figures')
    options = parser.parse_args()
    if not (options.revision or options.list):
        parser.error('REV is missing: a commit, branch or tag to compare with')
    return options


def positive(text):
    """Return a whole number above 0."""
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f'{number} is not above 0')
    return number


def chosen(options):
    """Return the combinations that the options choose, numbered as in the whole list."""
    every = combinations.all_combinations()
    few = set(combinations.quick_combinations()) if options.quick else every
    numbered = [(number, each) for number, each in enumerate(every, 1)
                if each in few and options.only in str(each)]
    if not numbered:
        sys.exit(f'same_bytes: no combination holds {options.only!r}, see --list')
    return numbered


def compare(options, numbered):
    """Make the comparisons that the options ask for; return the exit code."""
    figures, code = {}, 0
    with tempfile.TemporaryDirectory(prefix='same_bytes_') as temporary:
        folder = Path(temporary)
        trees = two_trees(ROOT, options.revision, folder)
        figures['revision'] = trees[0].name
        if options.all or not (options.time or options.cold):
            verdict = same_bytes(trees, numbered, folder)
            figures['bytes'] = comparison.as_json(verdict)
            code = int(bool(verdict.differences))
        if options.all or options.time:
            figures['time'] = speed.compare_times(trees, folder, options.runs, options.rounds)
        if options.all or options.cold:
            figures['start'] = speed.compare_starts(trees, folder)
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1), encoding='utf-8')
    return code


def same_bytes(trees, numbered, folder):
    """Compare the bytes, say what came out, and return the Verdict."""
    start = time.monotonic()
    arrays, pairs = folder / 'arrays', folder / 'pairs'
    for each in (arrays, pairs):
        each.mkdir()
    inputs = Inputs(pairs, trees[1].folder / 'test/data/scenes')
    with tqdm(total=len(numbered), unit='', disable=None, desc='bytes', smoothing=0) as bar:
        checks = comparison.Comparison(trees, inputs, arrays, bar.write)
        verdict = checks.run(numbered, bar.update)
    print(summary(verdict, trees[0].name, time.monotonic() - start))
    return verdict


def summary(verdict, name, seconds):
    """Return the last lines of the comparison of bytes."""
    what = (f'{verdict.combinations} combinations, {verdict.results} pairs, {verdict.outputs} '
            f'outputs compared with {name} in {seconds:.0f} s')
    lines = [f'{what}.', *(f'[{number}] ends with the same error in both: {text}'
                           for number, text in verdict.errors)]
    if verdict.differences:
        lines.append(f'{len(verdict.differences)} outputs of {verdict.differing()} combinations '
                     'DIFFER.')
    else:
        lines.append('No byte differs.')
    return '\n'.join(lines)


if __name__ == '__main__':
    sys.exit(main())

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
"""`color_stereo bench`: how long everything takes, beside OpenCV's matchers in the same run."""

import json
from pathlib import Path

SUMMARY = "measure times beside OpenCV's matchers, and range_node through real DDS"
NEEDS = '[tools], [ros]'

RATES = 30.0, 60.0  # Hz
DOUBLE = 1280, 960
STARTS = 5  # of range_node, of which the median counts
PARTS = 'times', 'outputs', 'first', 'node'


def add_arguments(parser):
    """Declare the arguments."""
    parser.add_argument('--output', type=Path, default=Path('bench_output'), metavar='FOLDER',
                        help='gets bench.json and bench.md (default bench_output); those of an '
                        'earlier run are replaced')
    parser.add_argument('--overwrite', action='store_true', help='replace files in the folder of '
                        '--output that are not of an earlier run, too')
    parser.add_argument('--rounds', type=int, default=40, metavar='N',
                        help='how often each contender is measured (default 40)')
    parser.add_argument('--seconds', type=float, default=10.0, metavar='S',
                        help='how long range_node is fed at each rate (default 10)')
    parser.add_argument('--only', choices=PARTS, action='append',
                        help='measure this part alone; repeatable')
    parser.add_argument('--profile', type=Path, default=Path('config/fastdds_shm.xml'),
                        metavar='FILE', help='Fast DDS profile with which range_node is measured '
                        'once more, if it is there (default config/fastdds_shm.xml)')
    parser.add_argument('--docs', type=Path, metavar='FILE',
                        help='Markdown file whose tables are to be written, docs/speed.md')
    parser.add_argument('--figures', type=Path, metavar='FILE',
                        help='measure nothing: take the figures of an earlier bench.json')


def run(args):
    """Measure, print, write."""
    from ..bench.report import plain, TABLES, with_tables
    from ..files.atomic import write_text
    from ..files.claim import claimed
    if args.figures:
        figures = json.loads(args.figures.read_text(encoding='utf-8'))
    else:
        with claimed(args.output, 'bench', ('bench.json', 'bench.md'), overwrite=args.overwrite):
            figures = measured(args)
            write_text(args.output / 'bench.json', json.dumps(figures, indent=1) + '\n')
            blocks = '\n'.join(f'<!-- bench: {name} -->\n<!-- end -->\n' for name in TABLES)
            write_text(args.output / 'bench.md', with_tables(blocks, figures))
    print(f'\n{plain(figures)}')
    if args.docs:
        text = args.docs.read_text(encoding='utf-8')
        write_text(args.docs, with_tables(text, figures))


def measured(args):
    """Return all figures, a dict that fits into JSON."""
    from datetime import date
    import tempfile

    from ..bench.report import goal_rows, machine
    parts = args.only or PARTS
    figures = {'date': date.today().isoformat(), 'machine': machine(), 'rounds': args.rounds,
               'times': {}}
    with tempfile.TemporaryDirectory(prefix='color_stereo_bench_') as folder:
        if 'times' in parts:
            figures['times'] = _times(args.rounds, folder)
        if 'outputs' in parts:
            figures['outputs'] = _outputs(args.rounds, folder)
        if 'first' in parts:
            figures |= _first(folder)
        if 'node' in parts:
            figures |= _node(args, folder)
    figures['goals'] = goal_rows(figures)
    return figures


def _times(rounds, folder):
    """Return contender's name to times."""
    from functools import partial

    from ..bench.times import all_contenders, interleaved
    from .progress import Progress
    contenders = all_contenders()
    print(f'{len(contenders)} contenders, each {rounds} times in turn; first the kernels get '
          'warm, for AVX2 they are compiled', flush=True)
    found = interleaved(contenders, rounds, folder, partial(Progress, unit='round'))
    return {item.name: times for item, times in found.items()}


def _outputs(rounds, folder):
    """Return what each output costs."""
    from ..bench.outputs import measured as outputs_measured
    from ..bench.scene import VGA
    from ..bench.times import save_pair
    print('outputs', flush=True)
    return outputs_measured(save_pair(Path(folder) / 'outputs', VGA), rounds)


def _first(folder):
    """Return the times from process start to the first result, without and with kernel cache."""
    from ..bench.node import measured as node_measured
    from ..bench.scene import VGA
    from ..bench.times import first_results, save_pair
    print('first results, with an empty kernel cache', flush=True)
    found = {'first': first_results(folder)}
    cold = {'NUMBA_CACHE_DIR': str(Path(folder) / 'cold_kernels_of_node')}
    found['node_cold'] = node_measured(save_pair(Path(folder) / 'cold', VGA), [], 0.0, cold)
    return found


def _node(args, folder):
    """Return what range_node does through real DDS."""
    from ..bench.node import measured as node_measured
    from ..bench.scene import VGA
    from ..bench.times import interleaved, pair_contenders, save_pair
    pair = save_pair(Path(folder) / 'node', VGA)
    print('the processor time of a pair', flush=True)
    alone = interleaved(pair_contenders(), args.rounds, Path(folder) / 'pair')
    print('range_node through DDS', flush=True)
    node_measured(pair, [], 0.0)  # the kernels that only the node needs get warm
    found = {'pair': {item.name: times for item, times in alone.items()},
             'starts': [node_measured(pair, [], 0.0) for _ in range(STARTS)],
             'node': node_measured(pair, RATES, args.seconds),
             'node_depth': node_measured(pair, RATES, args.seconds, topic='depth/image'),
             'node_third': node_measured(pair, RATES, args.seconds, topic='depth/image',
                                         third_view='automatic'),
             'node_double': node_measured(save_pair(Path(folder) / 'double', DOUBLE), RATES[:1],
                                          args.seconds, topic='depth/image')}
    if args.profile.is_file():
        print(f'range_node with {args.profile}', flush=True)
        profile = {'FASTRTPS_DEFAULT_PROFILES_FILE': str(args.profile.resolve())}
        found['node_profile'] = node_measured(pair, RATES, args.seconds, profile)
    return found

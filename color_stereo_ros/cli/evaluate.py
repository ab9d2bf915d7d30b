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
"""`color_stereo evaluate`: what is measured, how well, beside the paper and beside OpenCV."""

from contextlib import nullcontext
import os
from pathlib import Path
import time

from ..core import SettingsError
from ..evaluation.numbers import figure_of, write_json
from ..files.atomic import check_free
from ..files.claim import claimed

SUMMARY = "measure methods against the truth: the paper's experiments, or folders with truth"
NEEDS = '[tools]; without FOLDER [sim]'

DEFAULT_METHODS = 'surface,paper,bm,sgbm,3way'

STRESS_METHODS = 'surface,sgbm,3way'

COLUMNS = (
    ('density', 'density', '{:.3f}', 'share of the visible pixels that have a range'),
    ('correct', 'correct', '{:.3f}', 'share of the visible pixels whose depth is within 1 %'),
    ('mean %', 'mean_percent', '{:.4f}', 'mean depth error, % of the true depth'),
    ('median %', 'median_percent', '{:.4f}', 'median depth error, % of the true depth'),
    ('median px', 'median_px', '{:.4f}', 'median disparity error, px'),
    ('p95 %', 'p95_percent', '{:.3f}', '95 of 100 depth errors are smaller, % of the true depth'),
    ('bad-0.5', 'bad_05', '{:.4f}', 'share of the ranges that are off by more than 0.5 px'),
    ('bad-1', 'bad_1', '{:.4f}', 'the same for 1 px: these ranges are called wrong'),
    ('bad-2', 'bad_2', '{:.4f}', 'the same for 2 px'),
    ('false', 'false_share', '{:.4f}', 'share of all ranges where at most one camera sees a lit '
     'surface'),
    ('plane mm', 'planes.rms_mm', '{:.3f}', 'root mean square distance from fitted planes, mm'),
    ('plane px', 'planes.rms_px', '{:.4f}', 'the same in disparity, px'),
    ('locking', 'locking.peak_to_peak_px', '{:.4f}', 'how far disparities are drawn to whole '
     'pixels, peak to peak, px'),
    ('/limit', 'noise_limit.best.error_over_limit', '{:.2f}', 'error over the limit that the '
     'noise of the images sets; 1 is the best possible'),
    ('calib.', 'reliability.calibration_error', '{:.3f}', 'mean difference of confidence and '
     'share of right ranges; 0 is honest'),
    ('z std', 'z_scores.robust_std', '{:.2f}', 'spread of error / disparity_std; 1 is honest'),
    ('ms', 'milliseconds', '{:.1f}', 'time for one pair, ms'))
"""Title, key of the figure, format and meaning."""

LEGEND = '\n'.join([
    'Columns ("-": there is no such figure):',
    *(f'  {title:10} {meaning}' for title, _, _, meaning in COLUMNS),
    'Visible pixels: both cameras see the surface point, and the projector lights it. Errors are '
    'those', 'of the visible pixels that have a range.'])

EXPERIMENTS_OUTPUT = Path('evaluation_output')

STRESS_OUTPUT = Path('stress_output')

ABLATION_COLUMNS = (('density', '{:.4f}'), ('mean_percent', '{:.4f}'), ('median_px', '{:.4f}'),
                    ('bad_1', '{:.4f}'), ('false_share', '{:.4f}'), ('milliseconds', '{:.1f}'))


def add_arguments(parser):
    """Declare the arguments of `color_stereo evaluate`."""
    from .arguments import add_settings_arguments
    parser.add_argument('folders', nargs='*', metavar='FOLDER',
                        help='scene folders (left.png right.png left.yaml right.yaml truth.npz) '
                             'or folders of them; without any, the experiments of the paper on '
                             'the simulated rig')
    parser.add_argument('--methods', metavar='A,B',
                        help="methods, separated by commas; bm, sgbm and 3way are OpenCV's "
                             f'(default {DEFAULT_METHODS}; with --stress {STRESS_METHODS})')
    parser.add_argument('--quick', action='store_true',
                        help='fewer and coarser experiments: minutes instead of half an hour')
    parser.add_argument('--ablation', action='store_true',
                        help='switch every stage of the first of --methods off, one at a time; '
                             'with --stress under every disturbance')
    parser.add_argument('--stress', action='store_true',
                        help='disturb the simulated rig as real rigs are disturbed: rows, focus, '
                             'color, light, compression and more, each in steps')
    parser.add_argument('--only', metavar='A,B', help='with --stress: these disturbances, '
                        'groups of them, or one level, such as rows=1; "list" prints all')
    parser.add_argument('--scenes', metavar='A,B', help='with --stress: these scenes '
                        '(default: six of them)')
    parser.add_argument('--pairs', type=int, default=1, metavar='N',
                        help='with --stress: pairs of each scene, one after the other through one '
                             'ColorStereo; the table shows the last one (default 1)')
    parser.add_argument('--output', type=Path, metavar='DIR', help='where the results go: '
                        'report.html, figures.json and the rendered pairs of the experiments '
                        '(default evaluation_output, with --stress stress_output); tables.txt '
                        'and figures.json of FOLDER and of --ablation (default: printed only)')
    parser.add_argument('--overwrite', action='store_true', help='replace files that are not of '
                        'an earlier run, too')
    parser.add_argument('--renders', type=Path, metavar='DIR',
                        help='keeps the rendered pairs for the next run (default: renders in the '
                             'folder of --output)')
    parser.add_argument('--seed', type=int, default=1, metavar='N',
                        help='seed of the simulated noise (default 1)')
    parser.add_argument('--depth', nargs=2, type=float, metavar=('NEAR', 'FAR'),
                        help='depth limits of FOLDER in m, the same as --range.min_depth and '
                             '--range.max_depth (default: its settings.yaml, or else derived '
                             'from its rig)')
    parser.add_argument('--set', action='append', default=[], metavar='NAME=VALUE',
                        help='the same as --NAME VALUE, for example pattern.type=sweep; '
                             'repeatable')
    parser.add_argument('--repeats', type=int, default=3, metavar='N',
                        help='runs of a fast method; the shortest time counts (default 3)')
    parser.add_argument('--json', type=Path, metavar='FILE',
                        help='write all figures of FOLDER or of --ablation to a file')
    add_settings_arguments(parser)


def run(args):
    """Evaluate folders, the stages of a method, or run the experiments of the report."""
    from ..evaluation.methods import checked_methods
    from .arguments import named
    args.methods = args.methods or (STRESS_METHODS if args.stress else DEFAULT_METHODS)
    methods = checked_methods(named(args.methods))
    check_arguments(args)
    experiments = not (args.ablation or args.folders)
    if (experiments or args.stress) and args.output is None:
        args.output = STRESS_OUTPUT if args.stress else EXPERIMENTS_OUTPUT
    if args.stress and args.only == 'list':
        from .stress import print_disturbances
        print_disturbances()
        return
    if args.json and not args.overwrite:
        check_free(args.json)
    names = ('figures.json', 'report.html' if experiments else 'tables.txt')
    with (claimed(args.output, 'evaluate', names, overwrite=args.overwrite) if args.output
          else nullcontext()):
        if args.stress:
            from .stress import run_stress
            run_stress(args, methods, folder_values(args), facts_of(args))
        elif args.ablation:
            run_ablation(args, methods[0])
        elif args.folders:
            run_folders(args, methods)
        else:
            run_experiments(args, methods)


def check_arguments(args):
    """Refuse arguments that would have no effect."""
    if args.stress and args.folders:
        raise SettingsError('--stress has scenes of its own: it does not go with FOLDER')
    for name in ('only', 'scenes'):
        if getattr(args, name) and not args.stress:
            raise SettingsError(f'--{name} is for --stress')
    if args.pairs < 1 or (args.pairs > 1 and not args.stress):
        raise SettingsError(f'--pairs = {args.pairs}: expected 1 or more, and --stress')
    if not (args.folders or args.stress) and folder_values(args):
        raise SettingsError(f'{next(iter(folder_values(args)))} is set, but no FOLDER is given: '
                            'the experiments of the paper have settings of their own')
    if args.json and (args.stress or not (args.folders or args.ablation)):
        raise SettingsError('--json is for FOLDER or --ablation; the experiments of the paper '
                            'write figures.json into the folder of --output')
    if not 0 <= args.seed < 2**31:
        raise SettingsError(f'--seed = {args.seed} is outside 0 .. {2**31 - 1}')
    if getattr(args, 'matching.method') is not None:
        raise SettingsError('--matching.method: choose by --methods what is evaluated')


def run_folders(args, methods):
    """Evaluate folders with truth and print one table for each, then what its columns say."""
    from ..evaluation.methods import evaluate
    from ..patience import patience
    records, lines = [], []

    def tell(text):
        lines.append(text)
        print(text, flush=True)

    for scene in loaded(args):
        tell(f'\n{scene.name}: {scene.settings["range.min_depth"]} .. '
             f'{scene.settings["range.max_depth"]} m ({scene.limits_source})')
        tell(table_row('', [title for title, *_ in COLUMNS]))
        for method in methods:
            with patience('measuring; on the first run the kernels are compiled, too'):
                _, figures = evaluate(scene, method, {}, args.repeats)
            records.append({'experiment': 'folder', 'scene': scene.name, 'method': method,
                            'settings': scene.settings, 'figures': figures})
            tell(table_row(method, [cell(figures, key, form) for _, key, form, _ in COLUMNS]))
    tell(f'\n{LEGEND}')
    write_results(args, records, lines)


def write_results(args, records, lines):
    """Write the records into the files of --json and --output, the printed lines beside them."""
    from ..files.atomic import write_text
    if args.json:
        write_json(args.json, records, facts_of(args))
    if args.output:
        write_json(args.output / 'figures.json', records, facts_of(args))
        write_text(args.output / 'tables.txt', '\n'.join(lines).lstrip('\n') + '\n')
        print(f'{args.output / "tables.txt"} and {args.output / "figures.json"} written')


def loaded(args):
    """Yield the scenes of the folders."""
    from ..evaluation.datasets import find_scenes, load_folder
    values = folder_values(args)
    for folder in find_scenes(args.folders):
        yield load_folder(folder, values)


def folder_values(args):
    """Return the flat settings of the command line, which override those of a folder."""
    from .arguments import given_settings
    limits = zip(('range.min_depth', 'range.max_depth'), args.depth or ())
    return given_settings(args) | parsed_settings(args.set) | dict(limits)


def run_experiments(args, methods):
    """Run the paper's experiments on the simulated rig; write the page and the numbers."""
    from ..evaluation.experiments import Laboratory, Plan, QUICK, run_tasks
    from ..evaluation.renders import Renders
    from ..evaluation.report import write_report
    from .progress import Progress
    start = time.monotonic()
    plan = QUICK if args.quick else Plan()
    args.output.mkdir(parents=True, exist_ok=True)
    renders = Renders(args.renders or args.output / 'renders', plan.samples, args.seed)
    laboratory = Laboratory(renders, methods, plan)
    records = run_tasks(laboratory.tasks(), Progress)
    facts = {**facts_of(args), 'duration': f'{(time.monotonic() - start) / 60:.1f} min'}
    write_report(args.output / 'report.html', laboratory, records, facts)
    write_json(args.output / 'figures.json', records, facts)
    print(f'{args.output / "report.html"} and {args.output / "figures.json"} written '
          f'in {facts["duration"]}')


def run_ablation(args, method):
    """Switch every stage of a method off, one at a time, and print what that costs."""
    from ..evaluation.ablation import ablation, scenes_for
    from ..evaluation.experiments import Plan, QUICK
    from ..evaluation.renders import Renders
    from .progress import Progress
    if args.folders:
        scenes = list(loaded(args))
    else:
        plan = QUICK if args.quick else Plan()
        kept = args.renders or (args.output or EXPERIMENTS_OUTPUT) / 'renders'
        renders = Renders(kept, plan.samples, args.seed)
        scenes = scenes_for(renders, plan.complex, method)
    rows = ablation(scenes, method, Progress, args.repeats)
    titles = [key for key, _ in ABLATION_COLUMNS]
    lines = [f'{method} on {len(scenes)} scenes',
             f'{"off":44}' + ''.join(f'{title:>14}' for title in titles)]
    lines += [f'{row["off"] or "nothing":44}' + ''.join(
        f'{cell(row, key, form):>14}' for key, form in ABLATION_COLUMNS) for row in rows]
    print('\n'.join(lines))
    write_results(args, rows, lines)


def facts_of(args):
    """Return what a reader needs in order to repeat the run."""
    return {'command': 'color_stereo evaluate ' + ' '.join(map(str, args.folders)),
            'methods': args.methods, 'plan': 'quick' if args.quick else 'full',
            'seed': args.seed, 'processors': os.cpu_count()}


def parsed_settings(assignments):
    """Return flat settings from `NAME=VALUE` texts, values read as YAML."""
    from ..files.yaml import parse_yaml, UnreadableError
    values = {}
    for text in assignments:
        name, equals, value = text.partition('=')
        if not equals:
            raise SettingsError(f'--set {text!r} is no NAME=VALUE')
        try:
            values[name.strip()] = parse_yaml(value)
        except UnreadableError as error:
            raise SettingsError(f'--set {text!r}: the value is no YAML') from error
    return values


def cell(figures, key, form):
    """Return the figure at a dotted key as text, '-' where there is none."""
    figure = figure_of(figures, key)
    return '-' if figure is None else form.format(figure)


def table_row(title, cells):
    """Return one line of a table."""
    return f'{title:10}' + ''.join(f'{text:>10}' for text in cells)

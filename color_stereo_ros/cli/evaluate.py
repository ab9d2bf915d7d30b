# SPDX-License-Identifier: Apache-2.0
"""`color_stereo evaluate`: what is measured, how well, beside the paper and beside OpenCV."""

import os
from pathlib import Path
import time

from ..core import SettingsError
from ..evaluation.numbers import figure_of, write_json

SUMMARY = 'measure methods against the truth: the paper\'s experiments, or folders with truth'

DEFAULT_METHODS = 'surface,paper,bm,sgbm,3way'

COLUMNS = (('density', 'density', '{:.3f}'), ('correct', 'correct', '{:.3f}'),
           ('mean %', 'mean_percent', '{:.4f}'), ('median %', 'median_percent', '{:.4f}'),
           ('median px', 'median_px', '{:.4f}'), ('p95 %', 'p95_percent', '{:.3f}'),
           ('bad-0.5', 'bad_05', '{:.4f}'), ('bad-1', 'bad_1', '{:.4f}'),
           ('bad-2', 'bad_2', '{:.4f}'), ('false', 'false_share', '{:.4f}'),
           ('plane mm', 'planes.rms_mm', '{:.3f}'), ('plane px', 'planes.rms_px', '{:.4f}'),
           ('locking', 'locking.peak_to_peak_px', '{:.4f}'),
           ('/limit', 'noise_limit.best.error_over_limit', '{:.2f}'),
           ('calib.', 'reliability.calibration_error', '{:.3f}'),
           ('z std', 'z_scores.robust_std', '{:.2f}'), ('ms', 'milliseconds', '{:.1f}'))

ABLATION_COLUMNS = (('density', '{:.4f}'), ('mean_percent', '{:.4f}'), ('median_px', '{:.4f}'),
                    ('bad_1', '{:.4f}'), ('false_share', '{:.4f}'), ('milliseconds', '{:.1f}'))


def add_arguments(parser):
    """Declare the arguments of `color_stereo evaluate`."""
    from .arguments import add_settings_arguments
    parser.add_argument('folders', nargs='*', metavar='FOLDER',
                        help='scene folders (left.png right.png left.yaml right.yaml truth.npz) '
                             'or folders of them; without any, the experiments of the paper on '
                             'the simulated rig')
    parser.add_argument('--methods', default=DEFAULT_METHODS, metavar='A,B',
                        help=f'methods, separated by commas; bm, sgbm and 3way are OpenCV\'s '
                             f'(default {DEFAULT_METHODS})')
    parser.add_argument('--quick', action='store_true',
                        help='fewer and coarser experiments: minutes instead of half an hour')
    parser.add_argument('--ablation', action='store_true',
                        help='switch every stage of the first of --methods off, one at a time')
    parser.add_argument('--output', type=Path, default=Path('evaluation_output'),
                        metavar='DIR', help='where report.html, figures.json and the rendered '
                        'pairs go (default evaluation_output)')
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
    methods = checked_methods([name.strip() for name in args.methods.split(',')])
    check_arguments(args)
    if args.ablation:
        run_ablation(args, methods[0])
    elif args.folders:
        run_folders(args, methods)
    else:
        run_experiments(args, methods)


def check_arguments(args):
    """Refuse arguments that would have no effect."""
    if not args.folders and folder_values(args):
        raise SettingsError(f'{next(iter(folder_values(args)))} is set, but no FOLDER is given: '
                            'the experiments of the paper have settings of their own')
    if args.json and not (args.folders or args.ablation):
        raise SettingsError('--json is for FOLDER or --ablation; the experiments of the paper '
                            'write figures.json into the folder of --output')
    if not 0 <= args.seed < 2**31:
        raise SettingsError(f'--seed = {args.seed} is outside 0 .. {2**31 - 1}')
    if getattr(args, 'matching.method') is not None:
        raise SettingsError('--matching.method: choose by --methods what is evaluated')


def run_folders(args, methods):
    """Evaluate folders with truth and print one table for each."""
    from ..evaluation.methods import evaluate
    from ..patience import patience
    records = []
    for scene in loaded(args):
        print(f'\n{scene.name}: {scene.settings["range.min_depth"]} .. '
              f'{scene.settings["range.max_depth"]} m ({scene.limits_source})')
        print(table_row('', [title for title, _, _ in COLUMNS]))
        for method in methods:
            with patience('measuring; on the first run the kernels are compiled, too'):
                _, figures = evaluate(scene, method, {}, args.repeats)
            records.append({'experiment': 'folder', 'scene': scene.name, 'method': method,
                            'settings': scene.settings, 'figures': figures})
            print(table_row(method, [cell(figures, key, form) for _, key, form in COLUMNS]),
                  flush=True)
    if args.json:
        write_json(args.json, records, facts_of(args))


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
    from tqdm import tqdm

    from ..evaluation.experiments import Laboratory, Plan, QUICK, run_tasks
    from ..evaluation.renders import Renders
    from ..evaluation.report import write_report
    start = time.monotonic()
    plan = QUICK if args.quick else Plan()
    args.output.mkdir(parents=True, exist_ok=True)
    renders = Renders(args.renders or args.output / 'renders', plan.samples, args.seed)
    laboratory = Laboratory(renders, methods, plan)
    records = run_tasks(laboratory.tasks(), tqdm)
    facts = {**facts_of(args), 'duration': f'{(time.monotonic() - start) / 60:.1f} min'}
    write_report(args.output / 'report.html', laboratory, records, facts)
    write_json(args.output / 'figures.json', records, facts)
    print(f'{args.output / "report.html"} and {args.output / "figures.json"} written '
          f'in {facts["duration"]}')


def run_ablation(args, method):
    """Switch every stage of a method off, one at a time, and print what that costs."""
    from tqdm import tqdm

    from ..evaluation.ablation import ablation, scenes_for
    from ..evaluation.experiments import Plan, QUICK
    from ..evaluation.renders import Renders
    if args.folders:
        scenes = list(loaded(args))
    else:
        plan = QUICK if args.quick else Plan()
        renders = Renders(args.renders or args.output / 'renders', plan.samples, args.seed)
        scenes = scenes_for(renders, plan.complex, method)
    rows = ablation(scenes, method, tqdm, args.repeats)
    titles = [key for key, _ in ABLATION_COLUMNS]
    print(f'{method} on {len(scenes)} scenes')
    print(f'{"off":44}' + ''.join(f'{title:>14}' for title in titles))
    for row in rows:
        print(f'{row["off"] or "nothing":44}' + ''.join(
            f'{cell(row, key, form):>14}' for key, form in ABLATION_COLUMNS))
    if args.json:
        write_json(args.json, rows, facts_of(args))


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

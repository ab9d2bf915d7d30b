# SPDX-License-Identifier: Apache-2.0
"""`color_stereo evaluate`: what is measured, how well, beside the paper and beside OpenCV."""

import argparse
import json
import os
from pathlib import Path

from ..core import SettingsError

SUMMARY = 'measure the quality of methods against scenes with a known truth'

DEFAULT_METHODS = 'paper,surface,bm,sgbm,3way'

COLUMNS = (('density', 'density', '{:.3f}'), ('correct', 'correct', '{:.3f}'),
           ('mean %', 'mean_percent', '{:.4f}'), ('median %', 'median_percent', '{:.4f}'),
           ('median px', 'median_px', '{:.4f}'), ('p95 px', 'p95_px', '{:.3f}'),
           ('bad-0.5', 'bad_05', '{:.4f}'), ('bad-1', 'bad_1', '{:.4f}'),
           ('bad-2', 'bad_2', '{:.4f}'), ('false', 'false_share', '{:.4f}'),
           ('plane mm', 'planes.rms_mm', '{:.3f}'), ('plane px', 'planes.rms_px', '{:.4f}'),
           ('locking', 'locking.peak_to_peak_px', '{:.4f}'),
           ('/limit', 'noise_limit.best.error_over_limit', '{:.2f}'),
           ('calib.', 'reliability.calibration_error', '{:.3f}'),
           ('z std', 'z_scores.robust_std', '{:.2f}'), ('ms', 'milliseconds', '{:.1f}'))


def add_arguments(parser):
    """Declare the arguments of `color_stereo evaluate`."""
    parser.add_argument('folders', nargs='+', metavar='FOLDER',
                        help='scene folders (left.png right.png left.yaml right.yaml truth.npz) '
                             'or folders of them')
    parser.add_argument('--methods', default=DEFAULT_METHODS, metavar='A,B',
                        help=f'methods, separated by commas (default {DEFAULT_METHODS})')
    parser.add_argument('--depth', nargs=2, type=float, metavar=('NEAR', 'FAR'),
                        help='depth limits in m (default: settings.yaml of each folder, or else '
                             'derived from its rig)')
    parser.add_argument('--set', action='append', default=[], metavar='NAME=VALUE',
                        help='any setting of the core, for example pattern.type=sweep; repeatable')
    parser.add_argument('--repeats', type=int, default=3,
                        help='runs of a fast method; the shortest time counts (default 3)')
    parser.add_argument('--json', type=Path, metavar='FILE', help='write all figures to a file')


def run(args):
    """Evaluate and print one table for each scene."""
    from ..evaluation.datasets import find_scenes, load_folder
    from ..evaluation.methods import checked_methods, evaluate

    methods = checked_methods([name.strip() for name in args.methods.split(',')])
    values = parsed_settings(args.set)
    if args.depth:
        values.update(zip(('range.min_depth', 'range.max_depth'), args.depth))
    records = []
    for folder in find_scenes(args.folders):
        scene = load_folder(folder, values)
        print(f'\n{scene.name}: {scene.settings["range.min_depth"]} .. '
              f'{scene.settings["range.max_depth"]} m ({scene.limits_source})')
        print(table_row('', [title for title, _, _ in COLUMNS]))
        for method in methods:
            _, figures = evaluate(scene, method, values, args.repeats)
            records.append({'scene': scene.name, 'method': method, 'settings': scene.settings,
                            'figures': figures})
            print(table_row(method, [cell(figures, key, form) for _, key, form in COLUMNS]),
                  flush=True)
    if args.json:
        write_json(args.json, records)


def parsed_settings(assignments):
    """Return flat settings from `NAME=VALUE` texts, values read as YAML."""
    import yaml
    values = {}
    for text in assignments:
        name, equals, value = text.partition('=')
        if not equals:
            raise SettingsError(f'--set {text!r} is no NAME=VALUE')
        values[name.strip()] = yaml.safe_load(value)
    return values


def cell(figures, key, form):
    """Return the figure at a dotted key as text, '-' where there is none."""
    for part in key.split('.'):
        figures = None if figures is None else figures.get(part)
    return '-' if figures is None else form.format(figures)


def table_row(title, cells):
    """Return one line of a table."""
    return f'{title:10}' + ''.join(f'{text:>10}' for text in cells)


def write_json(path, data):
    """Write a JSON file as a whole or not at all."""
    temporary = path.with_name(path.name + '.part')
    temporary.write_text(json.dumps(data, indent=1))
    os.replace(temporary, path)


def main():
    """Run as `python -m color_stereo_ros.tools.evaluate`."""
    parser = argparse.ArgumentParser(description=SUMMARY)
    add_arguments(parser)
    run(parser.parse_args())


if __name__ == '__main__':
    main()

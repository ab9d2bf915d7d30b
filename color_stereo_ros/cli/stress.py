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
"""`color_stereo evaluate --stress`: rigs as people have them, as a table, curves and numbers."""

from pathlib import Path

from ..core import SettingsError
from ..evaluation.numbers import write_json


def print_disturbances():
    """Print every disturbance with its group, unit and levels."""
    from ..evaluation.stress.disturbances import DISTURBANCES
    for name, entry in DISTURBANCES.items():
        levels = ' '.join(f'{level:g}' for level in entry.levels)
        print(f'{name:18}{entry.group:12}{entry.title}: {levels} {entry.unit}'.rstrip())


def run_stress(args, methods, values, facts):
    """
    Run the stress test of a command line; print the table, write the page and the numbers.

    Parameters
    ----------
    args : argparse.Namespace
        Of `color_stereo evaluate`.
    methods : sequence of str
        The first one is judged.
    values : dict
        Flat settings that override those of the scenes.
    facts : dict
        What a reader needs in order to repeat the run.

    """
    from ..evaluation.stress.page import sentences, write_page
    from ..evaluation.stress.runs import cases_of, StressTest
    plan = plan_of(args, methods, values)
    if args.ablation:
        return run_ablation(args, plan, facts)
    args.output.mkdir(parents=True, exist_ok=True)
    cases = cases_of(plan)
    test = StressTest(plan, light_scenes(args.renders or args.output / 'renders', plan.scenes))
    by_case, records = {}, []
    facts = {**facts, 'command': 'color_stereo evaluate --stress', 'only': ', '.join(plan.only),
             'scenes': ', '.join(plan.scenes), 'pairs': plan.pairs, 'settings': values}
    for case in measured(test, cases, methods, by_case):
        records += by_case[case]
        write_json(args.output / 'figures.json', records, facts)
    print('\n'.join(sentences(cases, by_case, methods)))
    write_page(args.output / 'report.html', cases, by_case, methods, facts)
    print(f'{args.output / "report.html"} and {args.output / "figures.json"} written')


def run_ablation(args, plan, facts):
    """
    Switch every stage of a method off under every disturbance; print what that costs.

    Parameters
    ----------
    args : argparse.Namespace
        Of `color_stereo evaluate`.
    plan : color_stereo_ros.evaluation.stress.runs.StressPlan
        The first of its methods is taken apart.
    facts : dict
        What a reader needs in order to repeat the run.

    """
    from ..evaluation.stress.runs import averages, cases_of, StressTest, with_switches
    from ..files.atomic import write_text
    from .progress import Progress
    plan = with_switches(plan)
    whole, *off = plan.methods
    args.output.mkdir(parents=True, exist_ok=True)
    test = StressTest(plan, light_scenes(args.renders or args.output / 'renders', plan.scenes))
    titles = [name.removeprefix('matching.').removeprefix('color.') for name in off]
    lines = [f'{"right share, and without":24}{whole:>9}'
             + ''.join(f'{title:>{len(title) + 2}}' for title in titles)]
    print(lines[0], flush=True)
    records, bar = [], Progress(cases_of(plan))
    for case in bar:
        bar.set_description(f'{case.title:24}')
        found = test.run(case)
        records += found
        shares = [averages(found, name).get('right') for name in plan.methods]
        texts = ['-' if share is None else f'{share:.3f}' for share in shares]
        lines.append(f'{case.title:24}{texts[0]:>9}' + ''.join(
            f'{text:>{len(title) + 2}}' for text, title in zip(texts[1:], titles)))
        say(bar, lines[-1])
        write_json(args.output / 'figures.json', records,
                   {**facts, 'command': 'color_stereo evaluate --stress --ablation'})
    write_text(args.output / 'tables.txt', '\n'.join(lines) + '\n')
    print(f'{args.output / "tables.txt"} and {args.output / "figures.json"} written')


def plan_of(args, methods, values):
    """Return the StressPlan of a command line."""
    from ..evaluation.stress.light import SCENES
    from ..evaluation.stress.runs import StressPlan
    from .arguments import named
    for name in named(args.scenes):
        if name not in SCENES:
            raise SettingsError(f'--scenes {name}: known are {", ".join(SCENES)}')
    plan = {'methods': methods, 'only': named(args.only), 'pairs': args.pairs,
            'seed': args.seed, 'values': values}
    if args.scenes:
        plan['scenes'] = named(args.scenes)
    return StressPlan.quick(**plan) if args.quick else StressPlan(**plan)


def light_scenes(folder, names):
    """Return the LightScenes of names; those that are not kept in the folder are rendered."""
    from ..evaluation.stress.light import LightScenes
    from .progress import Progress
    keeper = LightScenes(Path(folder))
    bar = Progress(names)
    scenes = []
    for name in bar:
        bar.set_description(f'light of {name:18}')
        scenes.append(keeper.scene(name))
    return scenes


def measured(test, cases, methods, by_case):
    """Measure the cases, print a line for each, keep its records in by_case and yield it."""
    from ..evaluation.stress.page import COLUMNS
    from ..evaluation.stress.runs import averages
    from .progress import Progress
    rivals = methods[1:]
    print(f'{"":24}' + ''.join(f'{title:>9}' for title, *_ in COLUMNS)
          + ''.join(f'{name:>8}' for name in rivals) + '  (right)', flush=True)
    bar = Progress(cases)
    for case in bar:
        bar.set_description(f'{case.title:24}')
        by_case[case] = test.run(case)
        pairs = sorted({record['pair'] for record in by_case[case]})
        for pair in pairs if case.disturbance.per_pair else pairs[-1:]:
            others = [averages(by_case[case], name, pair).get('right') for name in rivals]
            title = f'{case.title} pair {pair}' if len(pairs) > 1 else case.title
            say(bar, line(title, averages(by_case[case], methods[0], pair), others))
        yield case


def line(title, figures, others):
    """Return one line of the table."""
    from ..evaluation.stress.page import cells_of
    shares = ['-' if value is None else f'{value:.3f}' for value in others]
    return (f'{title:24}' + ''.join(f'{cell:>9}' for cell in cells_of(figures))
            + ''.join(f'{share:>8}' for share in shares))


def say(bar, text):
    """Print a line of the table on standard output, above the bar."""
    bar.clear()
    print(text, flush=True)
    bar.refresh()

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
"""The experiments and the page that is made of them, on pairs from files."""

from dataclasses import replace
from html.parser import HTMLParser
import json
import re

from color_stereo_ros.cli import evaluate
from color_stereo_ros.core import PatternSettings
from color_stereo_ros.evaluation import datasets, experiments, report
from color_stereo_ros.evaluation.numbers import write_json

import numpy as np

import pytest

from scenes import SCENES

pytestmark = pytest.mark.long
LIMITS = {'range.min_depth': 0.22, 'range.max_depth': 0.62}
PLAN = experiments.Plan(distances=(350,), materials=('white_cardboard',), complex=('prism',),
                        sweeps={}, repeats=1)


class Files:
    """Pairs from files in place of the simulated rig: one sweep, whatever is asked for."""

    seed = 1
    samples = 1

    def pair(self, name, pattern):
        folder = 'prism_hue1' if name == 'prism' else 'flat_350_hue1'
        scene = datasets.load_folder(SCENES / folder, {**LIMITS, 'pattern.type': pattern.type})
        return replace(scene, name=name)


@pytest.fixture(scope='module')
def run():
    laboratory = experiments.Laboratory(Files(), ('paper', 'sgbm'), PLAN)
    return laboratory, experiments.run_tasks(laboratory.tasks(), list)


def test_every_method_runs_on_every_pair_under_both_patterns(run):
    _, records = run
    for scene in ('flat_350', 'material_white_cardboard', 'prism'):
        found = {(r['method'], r['pattern'], bool(r['values']))
                 for r in records if r['scene'] == scene}
        own = PatternSettings().type
        assert found == {('paper', 'sweep', False), ('paper', 'sweep', True),
                         ('paper', own, False), ('sgbm', 'sweep', False), ('sgbm', own, False)}


def test_the_paper_as_printed_is_less_precise_than_with_a_square_window(run):
    _, records = run
    error = {bool(r['values']): r['figures']['mean_percent'] for r in records
             if r['scene'] == 'flat_350' and r['method'] == 'paper' and r['pattern'] == 'sweep'}
    assert 0.2 < error[True] < 1.0
    assert error[False] < error[True]


def test_the_page_is_self_contained_and_well_formed(run, tmp_path):
    laboratory, records = run
    path = tmp_path / 'report.html'
    report.write_report(path, laboratory, records, {'plan': 'test'})
    text = path.read_text(encoding='utf-8')
    assert not re.search(r'(src|href)="(?!data:|#)', text)
    assert [p.name for p in tmp_path.iterdir()] == ['report.html']
    checker = Balanced()
    checker.feed(text)
    assert checker.open == []


class Balanced(HTMLParser):
    """Keeps the stack of open elements."""

    def __init__(self):
        super().__init__()
        self.open = []

    def handle_starttag(self, tag, attrs):
        if tag not in ('meta', 'img', 'br', 'link', 'path', 'use', 'rect'):
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        """Leave an element that closes itself alone."""

    def handle_endtag(self, tag):
        if tag not in ('path', 'use', 'rect'):
            assert self.open.pop() == tag


def test_every_picture_of_the_page_has_a_description(run, tmp_path):
    laboratory, records = run
    report.write_report(tmp_path / 'report.html', laboratory, records, {})
    text = (tmp_path / 'report.html').read_text(encoding='utf-8')
    alternatives = re.findall(r'<img alt="([^"]*)"', text)
    labels = re.findall(r'<svg role="img" aria-label="([^"]*)"', text)
    assert len(alternatives) == text.count('<img') and len(labels) == text.count('<svg')
    assert alternatives and labels and all(alternatives) and all(labels)


def test_the_page_shows_the_papers_figures_beside_ours(run, tmp_path):
    laboratory, records = run
    path = tmp_path / 'report.html'
    report.write_report(path, laboratory, records, {})
    text = path.read_text(encoding='utf-8')
    for title in ('Table 3.1', 'Table 3.2', 'Fig. 3.1', 'Fig. 3.2', 'How far a pixel can be'):
        assert title in text
    assert '2.00 mm' in text and '1.46 mm' in text     # printed in the paper


def test_the_numbers_are_kept_as_json(run, tmp_path):
    _, records = run
    write_json(tmp_path / 'figures.json', records, {'seed': 1})
    kept = json.loads((tmp_path / 'figures.json').read_text())
    assert kept['facts'] == {'seed': 1}
    assert len(kept['records']) == len(records)
    assert kept['records'][0]['figures']['density'] == pytest.approx(
        records[0]['figures']['density'])


def test_the_profile_of_the_channels_adds_up_to_the_brightness_after_scaling(run):
    laboratory, _ = run
    scaled = laboratory.profile['after color correction (scaling)']
    lit = scaled.sum(axis=1) > 0
    np.testing.assert_allclose(scaled[lit].sum(axis=1), 255, rtol=1e-3)


def test_widening_the_search_range_widens_the_disparities():
    scene = datasets.load_folder(SCENES / 'flat_350_hue1', LIMITS)
    geometry = scene.calibration.geometry

    def width(settings):
        return geometry.focal_baseline * (1 / settings['range.min_depth']
                                          - 1 / settings['range.max_depth'])

    wider = experiments.widened(scene, 1.3).settings
    assert width(wider) == pytest.approx(1.3 * width(scene.settings), rel=1e-6)
    assert experiments.widened(scene, 1.0).settings == pytest.approx(scene.settings)


def test_folders_are_evaluated_from_the_command_line(tmp_path, capsys):
    args = ['evaluate', str(SCENES / 'flat_350_hue1'), '--methods', 'paper,bm', '--depth', '0.22',
            '0.62', '--json', str(tmp_path / 'figures.json'), '--repeats', '1', '--output',
            str(tmp_path / 'out')]
    from color_stereo_ros.cli.main import main
    assert main(args) == 0
    printed = capsys.readouterr().out
    assert printed.strip().startswith((tmp_path / 'out' / 'tables.txt').read_text().strip())
    assert (tmp_path / 'out' / 'figures.json').read_bytes() == (
        tmp_path / 'figures.json').read_bytes()
    lines = printed.splitlines()
    legend = lines[lines.index('Columns ("-": there is no such figure):') + 1:]
    assert [line[2:12].strip() for line in legend[:len(evaluate.COLUMNS)]] == [
        title for title, *_ in evaluate.COLUMNS]
    assert 'flat_350_hue1: 0.22 .. 0.62 m (given)' in lines[1]
    assert lines[3].startswith('paper') and lines[4].startswith('bm')
    kept = json.loads((tmp_path / 'figures.json').read_text())['records']
    assert kept[0]['figures']['correct'] > 0.9


@pytest.mark.parametrize('words, message', [
    (['--methods', 'papr'], "did you mean 'paper'"), (['--set', 'range.min_depth'],
                                                      'is no NAME=VALUE')])
def test_wrong_arguments_are_one_line(words, message, capsys):
    from color_stereo_ros.cli.main import main
    assert main(['evaluate', str(SCENES / 'flat_350_hue1'), *words]) == 2
    assert message in capsys.readouterr().err


def test_a_figure_that_is_not_there_is_a_dash():
    assert evaluate.cell({'planes': None}, 'planes.rms_px', '{:.3f}') == '-'
    assert evaluate.cell({'planes': {'rms_px': 0.1234}}, 'planes.rms_px', '{:.3f}') == '0.123'

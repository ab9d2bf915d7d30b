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
"""The bench: what it measures and how it tells; no test depends on how long something takes."""

import json
import os
from pathlib import Path
import shutil
import subprocess
import sys

import color_stereo_ros
from color_stereo_ros.bench.report import (
    goal_rows, goal_table, GOALS, NODE_RUNS, node_table, pair_table, part_table, plain,
    stage_table, start_table, TABLES, with_tables)
from color_stereo_ros.bench.scene import bench_calibration, bench_pair, bench_settings
from color_stereo_ros.bench.times import (
    all_contenders, Contender, interleaved, pair_contenders, summary, thread_counts)
from color_stereo_ros.cli import main as cli
from color_stereo_ros.core import ColorStereo, Status
from color_stereo_ros.core.triangulation import disparity_limits, search_interval

import numpy as np

import pytest

SMALL = 320, 240
ROOT = Path(__file__).resolve().parents[1]


def figures():
    """Return the figures of a run in which each contender took so many ms as its place says."""
    times = {item.name: {'median': 0.001 * (turn + 1), 'least': 0.0005 * (turn + 1),
                         'stages': {'colors': 0.0004, 'coarse': 0.0006}}
             for turn, item in enumerate(all_contenders())}
    rates = [{'rate': rate, 'sent': 200, 'answered': answered, 'cpu_ms': 33.0,
              'dropped': 200 - answered, 'out_of_order': 0, 'oldest_ms': 31.0, 'p50_ms': 18.0,
              'p99_ms': 36.0, 'reference_ms': 17.5, 'parts': {'node': 33.0, 'executor': 2.5}}
             for rate, answered in ((30.0, 200), (60.0, 180))]
    found = {'date': '2026-11-22', 'machine': {'cores': '2'}, 'rounds': 3, 'times': times,
             **{run: {'topic': 'points', 'ready': 1.0, 'first': 3.5, 'peak_mb': 250.0,
                      'rates': rates} for run in NODE_RUNS},
             'pair': {item.name: {'cpu': 0.0242, 'median': 0.025, 'least': 0.021}
                      for item in pair_contenders()},
             'starts': [{'ready': 1.0, 'first': first, 'peak_mb': 240.0, 'rates': []}
                        for first in (1.2, 3.9, 1.4)],
             'node_cold': {'ready': 39.0, 'first': 40.0, 'peak_mb': 300.0, 'rates': []}}
    found['goals'] = goal_rows(found)
    return found


@pytest.mark.parametrize('size, disparities', [
    ((320, 240), 64), ((640, 480), 64), ((640, 480), 128), ((640, 480), 256),
    ((1280, 960), 256)])
def test_the_depth_limits_give_exactly_the_disparities_asked_for(size, disparities):
    calibration = bench_calibration(size)
    settings = bench_settings(calibration, disparities)
    first, last = search_interval(disparity_limits(calibration.geometry, settings.range))
    assert last - first + 1 == disparities


def test_the_pair_of_the_bench_is_a_scene_that_can_be_measured():
    calibration = bench_calibration(SMALL)
    left, right = bench_pair(calibration)
    assert left.shape == right.shape == (240, 320, 3) and left.dtype == np.uint8
    result = ColorStereo(calibration, bench_settings(calibration, 64)).process(left, right)
    assert result.density > 0.7
    # px: from the back of the table, 0.066 of the width, to the top of the tube
    assert 18 < np.nanmin(result.disparity) and np.nanmax(result.disparity) < 40
    assert np.count_nonzero(result.status == Status.INCONSISTENT)  # it has occlusions


def test_the_pair_of_the_bench_is_the_same_each_time():
    calibration = bench_calibration(SMALL)
    assert np.array_equal(bench_pair(calibration), bench_pair(calibration))


def test_all_goals_have_their_contenders():
    rows = goal_rows(figures())
    assert len(rows) == len(GOALS) and all(row['figure'] is not None for row in rows)


def test_goals_are_judged_on_the_right_side_of_their_limits():
    met = {row['name']: row['met'] for row in figures()['goals']}
    assert met['range_node, pairs through real DDS at 30 Hz: answered of sent'] is True
    assert met['the same at 60 Hz'] is True
    assert met['the same at 60 Hz, `depth/image` alone'] is False
    assert met['the same, kernel cache cold'] is False
    assert met['first cloud after the start of range_node, kernel cache warm'] is True
    assert met['largest resident memory of range_node'] is True


def test_a_goal_that_was_not_measured_is_neither_met_nor_missed():
    rows = goal_rows({'times': {}})
    assert all(row['figure'] is None and row['met'] is None for row in rows)
    assert goal_table({'goals': rows}).count('not measured') == len(GOALS)


def test_a_bench_of_one_part_leaves_the_tables_of_the_others():
    page = '<!-- bench: goals -->\nold\n<!-- end -->\n<!-- bench: parts -->\nold\n<!-- end -->\n'
    written = with_tables(page, {**figures(), 'times': {}})
    assert written.startswith(page[:page.index('<!-- bench: parts')])
    assert '| ms an answer | node | executor | reference |' in written
    assert '\nold\n' not in with_tables(page, figures())


def test_tables_name_figure_goal_and_verdict():
    table = goal_table(figures())
    assert '| the same at 60 Hz | 90 % | >= 80 % | met |' in table
    assert '`depth/image` alone | 90 % | >= 95 % | **missed** |' in table
    assert '| colors | 0.40 |' in stage_table(figures())
    row = '| `points` | 60 | 180 of 200 | 20 | 18.0 | 36.0 | 31 | 33.0 | 17.5 |'
    assert row in node_table(figures())
    assert '| `depth/image`, 60 Hz | 33.00 | 2.50 | 17.5 |' in part_table(figures())
    assert '| cold | 39.0 | 40.0 | 300 |' in start_table(figures())
    name = 'third view 640 x 480, 128 disparities, 1 thread'
    assert f'| {name} | 24.2 | 25.0 | 21.0 |' in pair_table(figures())
    assert 'kernel cache cold' in plain(figures())


def test_the_tables_of_a_document_are_replaced_and_nothing_else():
    text = 'before\n<!-- bench: goals -->\nearlier figures\n<!-- end -->\nafter\n'
    new = with_tables(text, figures())
    assert new.startswith('before\n') and new.endswith('<!-- end -->\nafter\n')
    assert 'earlier figures' not in new and goal_table(figures()) in new
    assert with_tables(new, figures()) == new


def test_the_page_on_speed_has_every_table():
    text = (ROOT / 'docs' / 'speed.md').read_text(encoding='utf-8')
    assert all(f'<!-- bench: {name} -->' in text for name in TABLES)


def test_an_earlier_run_can_be_put_into_a_document(tmp_path, capsys):
    run, page = tmp_path / 'bench.json', tmp_path / 'page.md'
    run.write_text(json.dumps(figures()))
    page.write_text('<!-- bench: times -->\n<!-- end -->\n')
    assert cli.main(['bench', '--figures', str(run), '--docs', str(page)]) == 0
    assert '| bm 640 x 480, 128 disparities | 2.0 | 1.0 |' in page.read_text()
    assert 'missed' in capsys.readouterr().out


def test_thread_counts_begin_with_one_and_end_with_all_cores():
    counts = thread_counts()
    assert counts[0] == 1 and counts[-1] == len(os.sched_getaffinity(0))


def test_the_median_of_all_rounds_counts():
    answers = [{'seconds': s, 'cpu': 2 * s, 'stages': {'colors': s / 2}} for s in (5.0, 1.0, 2.0)]
    assert summary(answers) == {'median': 2.0, 'least': 1.0, 'cpu': 4.0, 'stages': {'colors': 1.0}}


@pytest.mark.processes
def test_processes_take_times_of_both_methods_and_of_opencv(tmp_path):
    contenders = [Contender('surface', SMALL, 64), Contender('paper', SMALL, 64),
                  Contender('bm', SMALL, 64), Contender('sgbm', SMALL, 64),
                  Contender('surface', SMALL, 64, '1 thread')]
    times = interleaved(contenders, 1, tmp_path)
    assert set(times) == set(contenders)
    assert all(found['median'] > 0 for found in times.values())
    assert 'coarse' in times[contenders[0]]['stages'] and not times[contenders[2]]['stages']


CACHE_CODE = """
import numpy as np
import color_stereo_ros
from color_stereo_ros.core.surface.view_kernels import box_sums
pixels = np.zeros((4, 4), np.uint32)
box_sums(pixels, np.empty((4, 4), np.uint32))
stats = box_sums.stats
print(color_stereo_ros.__file__, stats.cache_path, sum(stats.cache_hits.values()))
"""


def test_kernels_of_an_installation_that_cannot_be_written_are_kept_for_the_user(tmp_path):
    place = tmp_path / 'site' / 'color_stereo_ros'
    shutil.copytree(Path(color_stereo_ros.__file__).parent, place,
                    ignore=shutil.ignore_patterns('__pycache__'))
    # A file in place of the folder keeps root out, too, whom permissions do not stop.
    (place / 'core' / 'surface' / '__pycache__').write_text('')
    home = tmp_path / 'home'
    home.mkdir()
    environment = {name: value for name, value in os.environ.items()
                   if not name.startswith(('NUMBA_', 'XDG_'))}
    environment |= {'HOME': str(home), 'PYTHONPATH': str(place.parent)}
    hits = []
    for _ in range(2):
        ran = subprocess.run([sys.executable, '-c', CACHE_CODE], cwd=tmp_path, text=True,
                             env=environment, capture_output=True, timeout=300)
        assert ran.returncode == 0, ran.stderr
        source, cache, found = ran.stdout.split()
        assert Path(source).parent == place and Path(cache).is_relative_to(home)
        hits.append(int(found))
    assert hits == [0, 1]  # compiled by the first process, loaded by the second

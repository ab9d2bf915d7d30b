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
"""The gate `.ci/same_bytes`: what it measures, and that it sees what differs."""

from dataclasses import fields
from pathlib import Path
import subprocess
import sys

from color_stereo_ros.core import Settings
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / '.ci'))
from gate import combinations, comparison, scenes  # noqa: E402, I100
from gate.child import Child  # noqa: E402
from gate.inputs import Inputs, split_name  # noqa: E402
from gate.speed import run_figures, run_summary  # noqa: E402
from gate.trees import GateError, two_trees  # noqa: E402

COMBINATIONS = combinations.all_combinations()
METHODS = 'surface', 'paper'
PACKAGE = '''\
"""Stands in for the package: as quick as can be, and one pixel is easily changed."""
from dataclasses import dataclass, field
import numpy as np

class ColorStereoError(ValueError): pass

@dataclass
class Geometry:
    width: int = 4

@dataclass
class Camera:
    D = K = R = P = np.eye(3)

class StereoCalibration:
    left, right, right_from_left = Camera(), Camera(), (np.eye(3), np.ones(3))
    @classmethod
    def from_arrays(cls, **values):
        return cls()

class Settings:
    pattern = None
    def updated(self, values):
        return self

@dataclass
class Result:
    disparity: np.ndarray
    image: np.ndarray
    density = 1.0
    disparity_limits = (1.0, 2.0)
    geometry = Geometry()
    seconds = {'match': 0.1}
    depth = confidence = status = disparity_std = depth_std = np.zeros((2, 4), np.float32)
    def points(self):
        return self.image

class Pair:
    left_inside = right_inside = np.ones((2, 4), bool)
    geometry = Geometry()

class ColorStereo:
    def __init__(self, calibration, settings, rectified_input):
        self.calibration = calibration
    def rectify(self, left, right):
        pair = Pair()
        pair.left, pair.right = left, right
        return pair
    def process(self, left, right):
        disparity = left[..., 0].astype(np.float32)
        # change here
        return Result(disparity, left)

class CameraModel: pass

def make_pattern(settings):
    return np.full((40, 40, 3), 200, np.uint8)
'''


@pytest.fixture
def repository(tmp_path):
    """Return a git repository with a package that stands in for ours."""
    root = tmp_path / 'repository'
    core = root / 'color_stereo_ros' / 'core'
    core.mkdir(parents=True)
    (core.parent / '__init__.py').touch()
    (core / '__init__.py').write_text(PACKAGE)
    for command in ('init -q', 'add .', '-c user.name=x -c user.email=x@x commit -qm first'):
        subprocess.run(['git', *command.split()], cwd=root, check=True)
    return root


def change(repository, line):
    """Replace the line of the package that is there to be changed."""
    path = repository / 'color_stereo_ros/core/__init__.py'
    path.write_text(path.read_text().replace('# change here', line))


def compared(repository, folder, numbered):
    """Return the Verdict on HEAD and the working tree, and the lines that are printed."""
    folder.mkdir()
    lines = []
    checks = comparison.Comparison(two_trees(repository, 'HEAD', folder), Inputs(folder, folder),
                                   folder, lines.append)
    return checks.run(numbered, lambda: None), lines


def some_combination(sequence=('plane',)):
    """Return a numbered list of one small combination."""
    return [(7, combinations.Combination((20, 10), 'lines', 'usual', 1, sequence,
                                         (('matching.method', 'surface'),)))]


def test_there_are_hundreds_of_different_combinations():
    assert len(set(COMBINATIONS)) == len(COMBINATIONS) >= 200


def test_the_list_is_always_the_same():
    assert combinations.all_combinations() == COMBINATIONS


@pytest.mark.parametrize('method', METHODS)
@pytest.mark.parametrize('factor, choices', [
    ('pattern', combinations.PATTERNS), ('size', combinations.SIZES), ('rig', scenes.RIGS),
    ('threads', combinations.THREADS), ('sequence', combinations.SEQUENCES)])
def test_each_choice_is_made_with_both_methods(method, factor, choices):
    made = {getattr(each, factor) for each in COMBINATIONS if each.method == method}
    assert set(choices) <= made


@pytest.mark.parametrize('method', METHODS)
def test_rectified_pairs_are_announced_with_both_methods(method):
    assert any(each.rectified and each.method == method for each in COMBINATIONS)


def test_the_quick_list_makes_each_choice_but_of_settings():
    quick = combinations.quick_combinations()
    assert 30 <= len(quick) <= 50
    assert set(quick) <= set(COMBINATIONS)
    for factor in ('pattern', 'size', 'rig', 'threads', 'sequence'):
        made = {getattr(each, factor) for each in COMBINATIONS if each.size}
        assert made <= {getattr(each, factor) for each in quick}, factor


def test_sizes_are_odd_and_tiny_too():
    assert any(width % 2 and height % 2 for width, height in combinations.SIZES)
    assert min(width * height for width, height in combinations.SIZES) < 1000


def test_instances_are_used_again_after_nonsense():
    nonsense = [index for sequence in combinations.SEQUENCES for index, name in enumerate(sequence)
                if name in scenes.NONSENSE and index < len(sequence) - 1]
    assert nonsense
    assert {name for sequence in combinations.SEQUENCES for name in sequence} >= set(
        scenes.SCENES) | {'black', 'noise', 'white'}


@pytest.mark.parametrize('name', [f'{group.name}.{spec.name}' for group in fields(Settings)
                                  for spec in fields(getattr(Settings(), group.name))
                                  # calibration is a file of cameras of one size
                                  if spec.name not in ('width', 'height', 'calibration')])
def test_every_setting_is_changed_and_every_choice_is_made(name):
    group, _, key = name.partition('.')
    spec = next(each for each in fields(getattr(Settings(), group)) if each.name == key)
    made = {dict(each.settings).get(name, spec.default) for each in COMBINATIONS}
    assert len(made) > 1
    assert set(spec.metadata['choices'] or ()) <= made


def test_every_setting_can_be_made():
    for each in COMBINATIONS:
        Settings().updated(dict(each.settings))


def test_each_scene_gives_different_images():
    pattern = np.random.default_rng(1).integers(0, 256, (80, 100, 3), np.uint8)
    pairs = [scenes.plain(name, (60, 40), 'verged', pattern)
             for name in (*scenes.SCENES, *scenes.NONSENSE)]
    assert {pair.shape for pair in pairs} == {(2, 40, 60, 3)}
    assert len({pair.tobytes() for pair in pairs}) == len(pairs)


def test_names_of_pairs_are_known_scenes_and_variants():
    for name in {name for sequence in combinations.SEQUENCES for name in sequence}:
        scene, variant = split_name(name)
        assert scene in (*scenes.SCENES, *scenes.NONSENSE)
        assert variant in ('', *scenes.VARIANTS)


def test_the_same_trees_do_not_differ(repository, tmp_path):
    verdict, lines = compared(repository, tmp_path / 'gate', some_combination(('plane', 'wave')))
    assert (verdict.differences, lines) == ((), [])
    assert (verdict.combinations, verdict.results) == (1, 2)
    assert verdict.outputs > 40


def test_one_different_pixel_is_found_and_counted(repository, tmp_path):
    change(repository, 'disparity[3, 5] += 0.5')
    verdict, lines = compared(repository, tmp_path / 'gate', some_combination(('plane', 'wave')))
    assert [(each.combination, each.output, each.pixels, each.total, each.largest)
            for each in verdict.differences] == [
                (7, '1 plane/disparity', 1, 200, 0.5), (7, '2 wave/disparity', 1, 200, 0.5)]
    assert lines[0].startswith('[7] surface | lines | 20 x 10')
    assert '1 plane/disparity: 1 of 200 pixels differ, largest difference 0.5' in lines[1]


def test_results_that_the_next_pair_overwrites_are_found(repository, tmp_path):
    change(repository, 'self.kept = disparity = self.__dict__.get("kept", disparity); '
                       'disparity[:] = left[..., 0]')
    verdict, _ = compared(repository, tmp_path / 'gate', some_combination(('plane', 'wave')))
    assert [(each.output, each.note) for each in verdict.differences] == [
        ('1 plane/overwritten later', '[] before, ["disparity"] now')]


def test_a_new_error_is_a_difference(repository, tmp_path):
    change(repository, 'raise ColorStereoError("too dark")')
    verdict, _ = compared(repository, tmp_path / 'gate', some_combination())
    notes = {each.output: each.note for each in verdict.differences}
    assert notes['error'] == 'nothing before, "ColorStereoError: too dark" now'


def test_the_same_error_in_both_trees_is_told(repository, tmp_path):
    change(repository, 'raise ValueError(f"bad {object()}")')
    subprocess.run(['git', '-c', 'user.name=x', '-c', 'user.email=x@x', 'commit', '-qam', 'bad'],
                   cwd=repository, check=True)
    verdict, _ = compared(repository, tmp_path / 'gate', some_combination())
    assert verdict.differences == ()
    assert verdict.errors == ((7, 'ValueError: bad <object object>'),)


@pytest.mark.parametrize('before, after, pixels, largest, invalid', [
    ([[1.0, 2.0]], [[1.0, 2.0]], 0, 0.0, 0), ([[1.0, np.nan]], [[1.5, np.nan]], 1, 0.5, 0),
    ([[1.0, np.nan]], [[1.0, 3.0]], 1, 0.0, 1), ([[0.0, 1.0]], [[-0.0, 1.0]], 1, 0.0, 0)])
def test_differences_are_counted_by_bytes(before, after, pixels, largest, invalid):
    found = comparison.array_difference(1, 'x', np.float32(before), np.float32(after))
    assert (found.pixels, found.largest, found.invalid) == (pixels, largest, invalid)


def test_channels_of_one_pixel_count_once():
    before = np.zeros((4, 5, 3), np.uint8)
    after = before.copy()
    after[2, 3] = 9, 1, 5
    found = comparison.array_difference(1, 'image', before, after)
    assert (found.pixels, found.total, found.largest) == (1, 20, 9.0)


def test_another_type_is_a_difference():
    found = comparison.array_difference(1, 'x', np.zeros((2, 3)), np.zeros((2, 3), np.float32))
    assert found.note == 'float64 (2, 3) before, float32 (2, 3) now'


def test_each_process_imports_the_copy_of_its_tree(repository, tmp_path):
    change(repository, 'pass')
    for tree in two_trees(repository, 'HEAD', tmp_path):
        with Child(tree, 1) as child:
            place = Path(child.ask('where')['file'])
        assert place == tree.folder / 'color_stereo_ros/core/__init__.py'
        assert ('# change here' in place.read_text()) == (tree.name != 'this')


def test_files_that_git_ignores_or_that_are_gone_are_not_copied(repository, tmp_path):
    (repository / '.gitignore').write_text('*.log\n')
    (repository / 'new.py').touch()
    (repository / 'some.log').touch()
    (repository / 'color_stereo_ros/__init__.py').unlink()
    copy = two_trees(repository, 'HEAD', tmp_path)[1].folder
    assert {str(path.relative_to(copy)) for path in copy.rglob('*') if path.is_file()} == {
        '.gitignore', 'new.py', 'color_stereo_ros/core/__init__.py'}


def test_a_module_from_elsewhere_is_refused(repository, tmp_path):
    tree = two_trees(repository, 'HEAD', tmp_path)[0]
    (tree.folder / 'color_stereo_ros').rename(tree.folder / 'moved')
    with pytest.raises(GateError, match='color_stereo_ros'):
        with Child(tree, 1) as child:
            child.ask('where')


def test_an_unknown_revision_is_refused(repository, tmp_path):
    with pytest.raises(GateError, match="git knows no revision 'nowhere'"):
        two_trees(repository, 'nowhere', tmp_path)


def test_ratios_are_medians_and_noise_makes_the_band():
    seconds = {'before': [1.0, 2.0, 1.0], 'again': [1.0, 2.2, 1.1], 'after': [1.2, 2.2, 1.3]}
    run = run_figures(seconds)
    assert (run['ratio'], run['noise']) == pytest.approx((1.2, 1.1))
    summary = run_summary([run, {**run, 'ratio': 1.05, 'noise': 0.8}])
    assert summary['ratio'] == pytest.approx(1.125)
    assert summary['band'] == pytest.approx((0.8, 1.25))
    assert summary['within']


def test_the_command_prints_the_list():
    ran = subprocess.run([sys.executable, '-P', '-m', 'gate', '--list'], capture_output=True,
                         text=True, check=True, env={'PYTHONPATH': str(ROOT / '.ci')})
    assert ran.stdout.splitlines()[0] == f'[1] {COMBINATIONS[0]}'
    assert len(ran.stdout.splitlines()) == len(COMBINATIONS)

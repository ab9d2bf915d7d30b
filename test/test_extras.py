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
"""What each command and node needs, and what they say where it is missing or does not fit."""

import os
from pathlib import Path
import re
import subprocess
import sys

from color_stereo_ros.cli import main as cli
from color_stereo_ros.cli.process import CONTENT, SAMPLE
from color_stereo_ros.core.compiled.requirement import REQUIREMENT
from color_stereo_ros.demo.run import first_pair
from color_stereo_ros.files.image import read_image
from color_stereo_ros.recordings.writing import write_recording

import numpy as np

import pytest

from ros_rig import calibration, PAPER, scene

import yaml

ROOT = Path(__file__).resolve().parents[1]
SETUP = (ROOT / 'setup.py').read_text()
WITHOUT = """
import sys

class Nowhere:
    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0] in {missing!r}:
            raise ModuleNotFoundError(f'No module named {{name!r}}', name=name)

sys.meta_path.insert(0, Nowhere())
"""
COMMAND = """
from color_stereo_ros.cli.main import main
sys.exit(main(sys.argv[1:]))
"""
NODE = """
from color_stereo_ros.nodes.{} import main
sys.exit(main(sys.argv[1:]))
"""
NODES = ('range_node', 'lifecycle_range_node', 'pattern_node', 'sim_rig_node')
CARD = """
name: card
rig: {base: effector, cameras: {width: 64, height: 48, focal: 60}}
objects:
  - {shape: plane, position: [0, 0, 0.5], size: [2.0, 2.0]}
"""
SETTINGS = [f'--{name}={value}' for name, value in PAPER.items()]


def run(code, *words, cwd):
    """Run Python code with arguments in a process of its own."""
    environment = {**os.environ, 'PYTHONPATH': str(ROOT), 'COLOR_STEREO_SIM_VARIANT': 'scalar_rgb',
                   'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    return subprocess.run([sys.executable, '-c', code, *words], cwd=cwd, env=environment,
                          capture_output=True, text=True, timeout=300)


def modules_beside(*extras):
    """Return the modules of all extras but those named."""
    kept = {module for extra in extras for module in cli.EXTRAS[extra]}
    kept |= {'tqdm'} if {'sim', 'view'} & set(extras) else set()
    return {module for modules in cli.EXTRAS.values() for module in modules} - kept


@pytest.fixture(scope='module')
def inputs(tmp_path_factory):
    """Return a folder with a recording, a scene and a folder of images with truth."""
    folder = tmp_path_factory.mktemp('inputs')
    with write_recording(folder / 'recorded') as writer:
        writer.write_pair(10**9, *scene(), calibration())
    (folder / 'card.yaml').write_text(CARD)
    return folder


WORKS = {
    'settings': ((), ['settings']),
    'pattern': ((), ['pattern', 'p.png', '--pattern.width', '64', '--pattern.height', '64']),
    'process': ((), ['process', '--sample', '--output', 'processed']),
    'convert': (('tools',), ['convert', 'recorded', 'converted', *SETTINGS]),
    'export': (('tools',), ['export', 'recorded', 'exported', *SETTINGS]),
    'inspect': (('tools',), ['inspect', 'recorded', *SETTINGS]),
    'view': (('view',), ['view', '--sample', '--html', 'view.html']),
    'render': (('sim',), ['render', 'card.yaml', 'rendered', '--samples', '1', '--direct-only',
                          '--pattern.width', '64', '--pattern.height', '64']),
}


@pytest.mark.parametrize('name', WORKS)
def test_a_command_works_with_its_extras_alone(name, inputs):
    extras, words = WORKS[name]
    ran = run(WITHOUT.format(missing=modules_beside(*extras)) + COMMAND, *words, cwd=inputs)
    assert ran.returncode == 0, ran.stderr
    needs = cli.find_commands(constant='NEEDS')[name]
    assert set(re.findall(r'\[(\w+)\]', needs.partition(';')[0])) == set(extras)


MISSES = {
    'convert': ('tools', ['convert', 'recorded', 'converted', '--overwrite']),
    'export': ('tools', ['export', 'recorded', 'exported', '--overwrite']),
    'inspect': ('tools', ['inspect', 'recorded']),
    'sample': ('tools', ['sample', 'truth', 'packed']),
    'render': ('sim', ['render', 'card.yaml', 'not_rendered']),
    'render, bag': ('tools', ['render', 'card.yaml', 'not_rendered', '--bag']),
    'replay': ('tools', ['replay', 'recorded']),
    'replay, ROS': ('ros', ['replay', 'recorded']),
    'demo': ('tools', ['demo', '--samples', str(ROOT / 'sample')]),
    'demo, ROS': ('ros', ['demo', '--samples', str(ROOT / 'sample')]),
    'evaluate': ('tools', ['evaluate', '--quick']),
    'evaluate, experiments': ('sim', ['evaluate', '--quick']),
    'bench': ('tools', ['bench']),
    'trust': ('tools', ['trust']),
    'view': ('view', ['view', '--sample']),
    'view, recording': ('tools', ['view', 'recorded', '--html', 'view.html', '--overwrite']),
    'view, live': ('ros', ['view', '--live']),
    'project': ('project', ['project', '--level', '3']),
    'project, ROS': ('ros', ['project']),
}


@pytest.mark.parametrize('case', MISSES)
def test_a_command_without_an_extra_says_which_one_it_needs(case, inputs):
    extra, words = MISSES[case]
    if case == 'sample':
        pack(inputs / 'truth')
    ran = run(WITHOUT.format(missing=set(cli.EXTRAS[extra])) + COMMAND, *words, cwd=inputs)
    assert ran.returncode == 1
    assert 'Traceback' not in ran.stderr
    last = ran.stderr.splitlines()[-1]
    assert last.startswith('color_stereo: ') and last.count('pip install ') == 1
    assert last.endswith(f'pip install "color_stereo_ros[{extra}]"')
    assert f'[{extra}]' in cli.find_commands(constant='NEEDS')[case.partition(',')[0]]


def test_a_bare_installation_is_told_of_all_that_render_needs(inputs):
    ran = run(WITHOUT.format(missing=modules_beside()) + COMMAND, 'render', 'card.yaml', 'never',
              cwd=inputs)
    assert ran.returncode == 1
    assert 'color_stereo_ros[sim]' in ran.stderr and 'tools' not in ran.stderr


def pack(folder):
    """Make a folder that `color_stereo sample` takes."""
    from color_stereo_ros.files.image import write_image
    folder.mkdir(exist_ok=True)
    calibration().to_yaml(folder / 'left.yaml', folder / 'right.yaml')
    left, right = scene()
    write_image(folder / 'left.png', left)
    write_image(folder / 'right.png', right)
    shape = left.shape[:2]
    np.savez(folder / 'truth.npz', depth=np.ones(shape, np.float32), visible=np.ones(shape, bool))


def test_the_extras_install_the_modules_that_the_messages_name():
    for extra, modules in cli.EXTRAS.items():
        listed = re.search(rf"'{extra}': \[(.*?)\]", SETUP.replace('[fastrtps]', ''),
                           re.DOTALL).group(1)
        for module in set(modules) & {'rosbags', 'matplotlib', 'tqdm', 'mitsuba', 'rclpy', 'viser',
                                      'pygame', 'mcap', 'distributed'}:
            assert module in listed, (extra, module)
    assert 'tqdm' in re.search(r"'sim': \[(.*?)\]", SETUP).group(1)  # progress of `render`


NUMBAS = {
    'missing': (None, 'numba is not installed'),
    'another Python': ('raise ImportError("Numba needs Python 3.10 or greater. Got Python 3.9.")',
                       'Numba needs Python 3.10 or greater. Got Python 3.9.'),
    'refuses Python': ('raise RuntimeError("Cannot install on Python version 3.15.0; only '
                       'versions >=3.10,<3.15 are supported.")',
                       'Cannot install on Python version 3.15.0'),
}


@pytest.mark.parametrize('kind', NUMBAS)
@pytest.mark.parametrize('arguments', [(), ('--help',)], ids=['started', 'help'])
@pytest.mark.parametrize('module', ['command', *NODES])
def test_a_numba_that_is_missing_or_does_not_fit_ends_with_one_sentence(
        module, arguments, kind, tmp_path):
    stub, words = NUMBAS[kind]
    block = WITHOUT.format(missing={'numba'})
    if stub is not None:
        (tmp_path / 'numba').mkdir()
        (tmp_path / 'numba/__init__.py').write_text(stub)
        block = f'import sys\nsys.path.insert(0, {str(tmp_path)!r})\n'
    if module == 'command':
        ran = run(block + COMMAND, 'process', *arguments, cwd=tmp_path)
    else:
        ran = run(block + NODE.format(module), *arguments, cwd=tmp_path)
    said = [line for line in ran.stderr.splitlines() if 'numba' in line.lower()]
    assert ran.returncode == 1 and 'Traceback' not in ran.stderr
    assert len(said) == 1 and words in said[0]
    assert f"pip install '{REQUIREMENT}'" in said[0] and 'virtual environment' in said[0]


@pytest.mark.parametrize('module', NODES)
def test_a_node_without_ros_ends_with_one_sentence(module, tmp_path):
    ran = run(WITHOUT.format(missing=set(cli.EXTRAS['ros'])) + NODE.format(module), cwd=tmp_path)
    assert ran.returncode == 1 and ran.stderr.count('\n') == 1
    assert 'rclpy is not installed' in ran.stderr and 'setup.bash of ROS 2' in ran.stderr
    assert 'pip install "color_stereo_ros[ros]"' in ran.stderr


def test_the_sample_of_the_package_is_a_pair_of_the_sample_recordings_and_small():
    recorded = ROOT / 'sample/solids_hue2d'
    left, right, rig = first_pair(recorded / 'recording')
    np.testing.assert_array_equal(read_image(SAMPLE / 'left.webp'), left)
    np.testing.assert_array_equal(read_image(SAMPLE / 'right.webp'), right)
    packed = type(rig).from_yaml(SAMPLE / 'left.yaml', SAMPLE / 'right.yaml')
    np.testing.assert_allclose(packed.left.P, rig.left.P)
    np.testing.assert_allclose(packed.right.P, rig.right.P)
    assert yaml.safe_load((SAMPLE / 'settings.yaml').read_text()) == yaml.safe_load(
        (recorded / 'settings.yaml').read_text())
    assert sum(path.stat().st_size for path in SAMPLE.iterdir()) < 1_000_000


def test_the_sample_becomes_ranges_and_a_page_that_needs_no_network(tmp_path, capsys):
    output = tmp_path / 'out'
    assert cli.main(['process', '--sample', '--output', str(output)]) == 0
    said = capsys.readouterr()
    assert 'warning' not in said.err
    assert {path.name for path in output.iterdir()} == set(CONTENT)
    truth = np.load(ROOT / 'sample/solids_hue2d/truth.npz')
    depth = read_depth(output / 'depth.tiff')
    known = np.isfinite(depth) & truth['visible']
    assert known.sum() > 0.9 * truth['visible'].sum()
    assert np.median(abs(depth - truth['depth'])[known]) < 5e-4
    page = (output / 'index.html').read_text()
    assert page.count('<canvas') == 1 and 'drag to turn' in page and 'left.webp' in page
    assert not re.findall(r'(?:src|href)\s*=\s*"(?!data:)', page) and 'url(' not in page
    assert '$' not in re.sub(r'<script.*?</script>', '', page, flags=re.DOTALL)


def read_depth(path):
    """Return a depth file as it is."""
    import cv2
    return cv2.imread(str(path), cv2.IMREAD_UNCHANGED)


@pytest.mark.parametrize('words, says', [
    (['process'], 'name two images and --calibration LEFT RIGHT, or --sample'),
    (['process', 'left.png'], 'or --sample'),
    (['process', '--sample', 'left.png', 'right.png'], '--sample has images'),
])
def test_process_takes_a_pair_or_the_sample(words, says, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(words) == 2
    assert says in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_rosdep_gets_rosbags_by_its_key_where_pip_is_allowed():
    from xml.etree import ElementTree
    found = [element for element in ElementTree.parse(ROOT / 'package.xml').iter('exec_depend')
             if element.text == 'python3-rosbags-pip']
    assert [element.get('condition') for element in found] == ['$COLOR_STEREO_PIP == 1']
    assert 'COLOR_STEREO_PIP=1' in (ROOT / 'docs/installation.md').read_text()

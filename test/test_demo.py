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
"""The demonstration, replay and conversion: recordings through real topics."""

from base64 import b64decode
from dataclasses import replace
from pathlib import Path
import re
import signal
import subprocess
import sys
from types import SimpleNamespace

from color_stereo_ros.cli import main as cli
from color_stereo_ros.core import ColorStereo, Settings
from color_stereo_ros.core.false_color import (false_color, range_limits, STATUS_COLORS,
                                               status_picture, views_picture)
from color_stereo_ros.core.legends import (with_scale_bar, with_status_legend,
                                           with_views_legend)
from color_stereo_ros.core.status import Status
from color_stereo_ros.demo import page as page_module
from color_stereo_ros.demo import run as demo_module
from color_stereo_ros.evaluation.metrics import Truth
from color_stereo_ros.files.claim import held
from color_stereo_ros.files.image import write_image
from color_stereo_ros.nodes.live import LiveError
from color_stereo_ros.nodes.sensor.worker import COMPILING, READY
from color_stereo_ros.parameters.files import settings_text
from color_stereo_ros.recordings.reading import Recording
from color_stereo_ros.recordings.writing import write_recording

import cv2

import numpy as np

import pytest

from rclpy.serialization import deserialize_message

from ros_rig import calibration, DEPTH, DISPARITY, HEIGHT, NodeProcess, PAPER, Rig, scene, WIDTH

from sensor_msgs.msg import CameraInfo, Image, PointCloud2

from stereo_msgs.msg import DisparityImage

COMMAND = [sys.executable, '-m', 'color_stereo_ros.cli.main']
SECOND = 1_000_000_000
OUTPUTS = {'points': PointCloud2, 'depth/image': Image, 'depth/camera_info': CameraInfo,
           'disparity': DisparityImage, 'confidence/image': Image, 'depth_std/image': Image,
           'status/image': Image, 'status_picture': Image, 'range_image': Image}


@pytest.fixture
def scene_folder(tmp_path):
    """Return a folder with the tiny rig's card, as both cameras see it, and the truth."""
    folder = tmp_path / 'card'
    folder.mkdir()
    calibration().to_yaml(folder / 'left.yaml', folder / 'right.yaml')
    for side, image in zip(('left', 'right'), scene()):
        write_image(folder / f'{side}.png', image)
    visible = np.ones((HEIGHT, WIDTH), bool)
    visible[:, :DISPARITY] = False
    np.savez(folder / 'truth.npz', depth=np.full((HEIGHT, WIDTH), DEPTH, np.float32),
             visible=visible)
    return folder


@pytest.fixture
def recorded(tmp_path):
    """Return a recording of two pairs of the tiny rig."""
    with write_recording(tmp_path / 'recorded') as writer:
        for index in range(2):
            writer.write_pair(SECOND * (10 + index), *scene(seed=index), calibration())
    return tmp_path / 'recorded'


@pytest.fixture
def parameters(tmp_path):
    """Return a parameter file for the tiny rig."""
    path = tmp_path / 'parameters.yaml'
    path.write_text(settings_text(PAPER, '/**'))
    return path


def sample_options():
    return [text for name, value in PAPER.items() for text in (f'--{name}', str(value))]


def test_the_demo_leaves_pictures_points_and_a_page(tmp_path, scene_folder):
    assert cli.main(['sample', str(scene_folder), str(tmp_path / 'samples/card'), '--period',
                     '0.2', *sample_options()]) == 0
    output = tmp_path / 'output'
    ran = subprocess.run([*COMMAND, 'demo', '--samples', tmp_path / 'samples', '--output',
                          output], capture_output=True, text=True, timeout=300)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert ran.stdout.rstrip().endswith(str(output / 'index.html'))
    assert {path.name for path in (output / 'card').iterdir()} == {
        'range_image.png', 'status.png', 'depth_mm.png', 'depth_preview.png', 'surface.png',
        'points.ply'}
    page = (output / 'index.html').read_text()
    assert 'src="http' not in page and 'href="' not in page  # nothing is fetched from elsewhere
    assert len(re.findall('src="data:image/png;base64,', page)) == 7
    assert all(re.findall('<img alt="([^"]*)"', page))
    correct = re.search(r'visible pixels right within 1 %</td><td>([\d.]+) %', page).group(1)
    assert float(correct) > 80


def test_the_demo_says_what_is_missing_when_no_output_comes(tmp_path, scene_folder):
    assert cli.main(['sample', str(scene_folder), str(tmp_path / 'samples/card'),
                     *sample_options()]) == 0
    blind = tmp_path / 'samples/card/recording'
    with Recording(blind) as recording:
        kept = [message for message in recording.messages()
                if message.topic != '/right/image_raw' or message.time_ns % SECOND]
    with write_recording(blind, overwrite=True) as writer:
        for message in kept:
            if message.topic != '/left/image_raw' or not message.time_ns % SECOND:
                writer.write(message.topic, message.type, message.time_ns, message.data)
    ran = subprocess.run([*COMMAND, 'demo', '--samples', tmp_path / 'samples', '--output',
                          tmp_path / 'output', '--wait', '2'], capture_output=True, text=True,
                         timeout=120)
    assert ran.returncode == 1
    assert 'no complete output within 2 s (--wait SECONDS waits longer)' in ran.stderr
    assert 'depth/image' in ran.stderr
    assert ran.stdout.count('range_node is ready; its outputs are awaited') == 1
    assert 'Traceback' not in ran.stderr


class Log:
    """The log of a range_node that compiles for some looks at it, and is then ready."""

    def __init__(self, looks):
        self.looks = looks

    def log(self, name):
        """Return what was written until now."""
        self.looks -= 1
        return COMPILING if self.looks > 0 else f'{COMPILING} {READY} 9.0 s'

    def log_tail(self, name):
        """Return the end."""
        return READY

    def check(self):
        """Nothing has ended."""


class States(Log):
    """The log of a range_node that is in one state after the other, a look at each."""

    def __init__(self, states):
        self.states = iter(states)

    def log(self, name):
        """Return what was written until now; it stays ready."""
        return next(self.states, f'{COMPILING} {READY} 9.0 s')


@pytest.mark.parametrize('states, looks, message', [
    ([], 3, 'within 6 s'),                        # ready when first looked at
    ([''] * 10, 13, 'within 6 s'),                # the start is slow
    (['', COMPILING], 5, 'within 6 s'),           # it compiles while the demo looks
    (['', *[COMPILING] * 50], 54, 'within 6 s'),
    ([''] * 99, 40, 'range_node was not ready after 120 s')])
def test_the_wait_begins_when_the_node_is_ready(tmp_path, monkeypatch, states, looks, message):
    """Looks take 3 s and the demo waits 6 s, which is two looks after the first "ready"."""
    now = [0.0]

    def spin(node, condition, timeout, check):
        now[0] += timeout
        return False

    (tmp_path / 'card/recording').mkdir(parents=True)
    monkeypatch.setattr(demo_module, 'spin_until', spin)
    monkeypatch.setattr(demo_module.time, 'monotonic', lambda: now[0])
    demo = demo_module.Demo(tmp_path, tmp_path / 'output', 6.0)
    with pytest.raises(LiveError, match=message):
        demo._wait(None, States(states), 'card', None, SimpleNamespace(received={}), [])
    assert now[0] == 3.0 * looks


@pytest.mark.parametrize('comes', [True, False])
def test_the_time_in_which_kernels_compile_does_not_count(
        tmp_path, monkeypatch, capsys, comes):
    """Each look takes 3 s of a clock that the test turns; the demo may wait 6 s."""
    now = [0.0]

    def spin(node, condition, timeout, check):
        now[0] += timeout
        return condition()

    (tmp_path / 'card/recording').mkdir(parents=True)
    monkeypatch.setattr(demo_module, 'spin_until', spin)
    monkeypatch.setattr(demo_module.time, 'monotonic', lambda: now[0])
    demo = demo_module.Demo(tmp_path, tmp_path / 'output', 6.0)
    collector = SimpleNamespace(received={'points': 0})
    arguments = None, Log(80), 'card', lambda: comes and now[0] > 110, collector, ['pattern']
    if comes:
        demo._wait(*arguments)
    else:
        with pytest.raises(LiveError, match=r'within 6 s \(--wait SECONDS waits longer\)'):
            demo._wait(*arguments)
    assert now[0] > 110
    said = capsys.readouterr().out
    assert said.count('range_node is compiling its kernels') == 1
    assert said.count('\n') <= 3


def measured(name, method, shift):
    """Return a Measurement of a card, `shift` m behind the depth of the tiny rig."""
    pair = scene()
    result = ColorStereo(calibration(), Settings().updated(PAPER)).process(*pair)
    result = replace(result, depth=result.depth + np.float32(shift))
    truth = Truth(np.full((HEIGHT, WIDTH), DEPTH + shift, np.float32),
                  np.ones((HEIGHT, WIDTH), bool))
    return page_module.Measurement(
        name=name, method=method, left=pair[0], right=pair[1], pattern=pair[0],
        range_image=pair[0], status_picture=pair[0], result=result, points=result.points(),
        truth=truth, seconds=1.0)


def embedded(page):
    """Return the pictures of a page, RGB."""
    found = re.findall('src="data:image/png;base64,([^"]*)"', page)
    return [cv2.imdecode(np.frombuffer(b64decode(text), np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
            for text in found]


def test_one_page_has_one_color_for_one_depth():
    cards = [measured('near', 'surface', 0.0), measured('far', 'paper', 0.1)]
    limits = page_module.page_limits(cards)
    assert limits[0] < DEPTH + 0.01 and limits[1] > DEPTH + 0.09
    page = page_module.make_page(cards, '', '')  # one text above, a caption and an alt for each
    pictures = embedded(page)
    for index, card in enumerate(cards):
        depth = pictures[7 * index + 3]
        np.testing.assert_array_equal(depth[:, :WIDTH], false_color(card.result.depth, *limits))
        np.testing.assert_array_equal(pictures[7 * index + 4], status_picture(card.result.status))
    assert page.count('near = yellow ({:.3f} m), far = violet ({:.3f} m)'.format(*limits)) == 5


def test_the_page_shows_who_saw_a_pixel_where_the_projector_was_a_view():
    card = measured('card', 'surface', 0.0)
    views = np.where(card.result.status == Status.VALID, np.uint8(3), np.uint8(0))
    seen = replace(card, result=replace(card.result, views=views))
    plain, page = (page_module.make_page([item], '', '') for item in (card, seen))
    assert 'views/image' not in plain and 'Who saw a pixel' in page
    np.testing.assert_array_equal(embedded(page)[5], with_views_legend(views_picture(views)))


def test_the_page_explains_its_words_and_colors_where_they_stand():
    card = measured('card', 'surface', 0.0)
    page = page_module.make_page([card], '', '')
    for title, explanation, _ in page_module.ROWS:
        row = page[page.index(f'<td>{title}</td>'):]
        assert row.index(explanation) < row.index('</tr>', row.index('class="why"'))
    for code in np.unique(card.result.status):
        assert f'rgb{STATUS_COLORS[code]}' in page and Status(code).meaning in page


def test_the_page_fits_a_phone():
    """Nothing has a fixed width, and what cannot wrap scrolls in a box of its own."""
    page = page_module.make_page([measured('card', 'surface', 0.0)], '', '')
    style = re.search('<style>(.*?)</style>', page, re.DOTALL).group(1)
    assert '<meta name="viewport" content="width=device-width, initial-scale=1">' in page
    assert 'minmax(min(17rem, 100%), 1fr)' in style
    assert re.search(r'figure img, figure canvas {[^}]*max-width: 100%; height: auto', style)
    assert re.search(r'\.wide {[^}]*overflow-x: auto', style)
    assert re.search(r'pre {[^}]*overflow-x: auto', style)
    assert not re.search(r'(?<![-\w])(min-)?width: *\d{2,}(px|rem|em)', style)
    body = re.sub(r'<div class="wide">.*?</div>', '', page, flags=re.DOTALL)
    assert page.count('<table>') == 1 and '<table>' not in body


def test_the_default_method_comes_first(tmp_path):
    for name, method in (('a', 'paper'), ('b', 'surface'), ('c', 'paper'), ('d', 'surface')):
        (tmp_path / name).mkdir()
        (tmp_path / name / 'settings.yaml').write_text(
            settings_text({'matching.method': method}, '/**'))
    order = demo_module.default_first(sorted(tmp_path.iterdir()))
    assert [folder.name for folder in order] == ['b', 'd', 'a', 'c']


def processes_that_mention(path):
    """Return the command lines of all running processes that name a path."""
    found = []
    for entry in Path('/proc').glob('[0-9]*/cmdline'):
        try:
            words = entry.read_bytes().decode(errors='replace')
        except OSError:
            continue  # it has ended meanwhile
        if str(path) in words:
            found.append(words.replace('\0', ' '))
    return found


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_demo_leaves_no_process_behind(tmp_path, scene_folder, number):
    assert cli.main(['sample', str(scene_folder), str(tmp_path / 'samples/card'),
                     *sample_options()]) == 0
    demo = subprocess.Popen([*COMMAND, 'demo', '--samples', tmp_path / 'samples', '--output',
                             tmp_path / 'output'], stdout=subprocess.PIPE, text=True)
    assert 'starting' in demo.stdout.readline()
    demo.send_signal(number)
    assert demo.wait(30) == cli.INTERRUPTED
    demo.stdout.close()
    assert not processes_that_mention(tmp_path)


def test_the_demo_without_samples_is_refused(tmp_path, capsys):
    assert cli.main(['demo', '--samples', str(tmp_path), '--output', str(tmp_path / 'o')]) == 1
    assert 'holds no folder with a recording' in capsys.readouterr().err
    assert not (tmp_path / 'o').exists()


def test_the_demo_never_removes_a_folder_of_somebody_else(tmp_path, scene_folder, capsys):
    assert cli.main(['sample', str(scene_folder), str(tmp_path / 'samples/card')]) == 0
    (tmp_path / 'thesis').mkdir()
    (tmp_path / 'thesis/chapter.tex').touch()
    assert cli.main(['demo', '--samples', str(tmp_path / 'samples'), '--output',
                     str(tmp_path / 'thesis')]) == 1
    assert 'it is not replaced' in capsys.readouterr().err
    assert (tmp_path / 'thesis/chapter.tex').exists()


WITHOUT_ROS = """
import sys

class Refusal:
    def find_spec(self, name, path=None, target=None):
        package = name.partition('.')[0]
        if package.startswith(('rcl', 'rosidl', 'builtin_')) or package.endswith('_msgs'):
            raise ModuleNotFoundError(f'{name} is refused', name=package)

sys.meta_path.insert(0, Refusal())
from color_stereo_ros.cli.main import main
sys.exit(main(sys.argv[1:]))
"""


def test_conversion_without_ros_gives_exactly_what_the_node_publishes(
        tmp_path, recorded, parameters):
    subprocess.run([sys.executable, '-c', WITHOUT_ROS, 'convert', recorded, tmp_path / 'converted',
                    '--config', parameters, '--topics', *OUTPUTS], check=True)
    with Recording(tmp_path / 'converted') as recording:
        converted = {(message.topic, message.time_ns): message.data
                     for message in recording.messages()}
    assert len(converted) == 2 * len(OUTPUTS)

    node = NodeProcess(tmp_path / 'log.txt', arguments=['--params-file', str(parameters)])
    rig = Rig()
    for topic, kind in OUTPUTS.items():
        rig.listen(kind, topic)
    rig.wait_for_publishers()
    rig.wait_for_node()
    replay = subprocess.Popen([*COMMAND, 'replay', recorded, '--loop', '--rate', '4'])
    try:
        for topic in OUTPUTS:
            for stamp in (10 * SECOND, 11 * SECOND):
                message = rig.await_output(topic, stamp)
                assert message == deserialize_message(converted[f'/{topic}', stamp],
                                                      OUTPUTS[topic]), topic
    finally:
        replay.send_signal(signal.SIGTERM)
        status = replay.wait(20)
        rig.close()
        assert node.stop() == 0
    assert status == 0


def test_replay_publishes_the_recorded_messages(recorded):
    rig = Rig()
    rig.listen(Image, 'left/image_raw')
    replay = subprocess.Popen([*COMMAND, 'replay', recorded, '--rate', '10', '--wait', '30'])
    try:
        rig.spin_until(lambda: replay.poll() is not None, 'the end of replay')
        rig.spin(0.2)
        assert replay.returncode == 0
        assert rig.stamps('left/image_raw') == [10 * SECOND, 11 * SECOND]
        with Recording(recorded) as recording:
            first = next(iter(recording.messages(['/left/image_raw'])))
        assert rig.received['left/image_raw'][0] == deserialize_message(first.data, Image)
    finally:
        replay.kill()
        rig.close()


def test_replay_with_the_stamps_of_now_keeps_pairs_together(recorded):
    rig = Rig(namespace='/cell')
    for side in ('left', 'right'):
        rig.listen(Image, f'{side}/image_raw')
    replay = subprocess.Popen([*COMMAND, 'replay', recorded, '--rate', '10', '--stamps', 'now',
                               '--namespace', 'cell', '--wait', '30'])
    try:
        rig.spin_until(lambda: replay.poll() is not None, 'the end of replay')
        rig.spin(0.2)
        left, right = rig.stamps('left/image_raw'), rig.stamps('right/image_raw')
        assert left == right and len(left) == 2
        assert left[0] > 1_000_000 * SECOND
    finally:
        replay.kill()
        rig.close()


@pytest.mark.parametrize('arguments, message, status', [
    (['--rate', '0'], '--rate = 0.0 is not larger than 0', 2),
    (['--topics', '/nothing'], 'no topic /nothing; it holds /left/camera_info', 1)])
def test_replay_refuses_what_cannot_be_played(recorded, capsys, arguments, message, status):
    assert cli.main(['replay', str(recorded), *arguments]) == status
    assert message in capsys.readouterr().err


def test_a_half_written_recording_is_not_replayed(recorded, capsys):
    path = recorded / 'recorded.mcap'
    path.write_bytes(path.read_bytes()[:-100])
    assert cli.main(['replay', str(recorded)]) == 1
    error = capsys.readouterr().err
    assert 'damaged or only half written' in error and error.count('\n') == 1


def converted_from(tmp_path, messages, capsys):
    """Convert messages given as (topic, type, time, data); return status and error text."""
    with write_recording(tmp_path / 'input') as writer:
        for message in messages:
            writer.write(*message)
    options = sample_options()
    status = cli.main(['convert', str(tmp_path / 'input'), str(tmp_path / 'result'), *options])
    return status, capsys.readouterr()


def rows_of(recorded):
    with Recording(recorded) as recording:
        return [(message.topic, message.type, message.time_ns, message.data)
                for message in recording.messages()]


def test_conversion_goes_on_after_a_bad_image(tmp_path, recorded, capsys):
    rows = rows_of(recorded)
    at = next(index for index, row in enumerate(rows) if row[0] == '/left/image_raw')
    topic, kind, time, data = rows[at]
    rows[at] = (topic, kind, time, data.replace(b'rgb8', b'rgbx'))
    status, said = converted_from(tmp_path, rows, capsys)
    assert status == cli.PARTLY
    assert "encoding = 'rgbx' is not supported" in said.out + said.err
    assert '1 pairs measured, 1 refused' in said.out


def test_conversion_without_any_pair_leaves_no_result(tmp_path, recorded, capsys):
    late = [(topic, kind, time, data) for topic, kind, time, data in rows_of(recorded)
            if topic != '/left/image_raw' or time == 10 * SECOND]
    late = [row for row in late if row[0] != '/right/image_raw' or row[2] == 11 * SECOND]
    status, said = converted_from(tmp_path, late, capsys)
    assert status == 1
    assert 'no left and right image have stamps that fit together' in said.err
    assert not (tmp_path / 'result').exists()


def test_process_writes_what_it_lists(tmp_path, scene_folder, capsys):
    files = [str(scene_folder / name) for name in ('left.png', 'right.png')]
    yamls = [str(scene_folder / name) for name in ('left.yaml', 'right.yaml')]
    assert cli.main(['process', *files, '--calibration', *yamls, '--output',
                     str(tmp_path / 'out'), *sample_options()]) == 0
    listed = set(re.findall(r'^  (\S+)', capsys.readouterr().out, re.M))
    assert listed == {path.name for path in (tmp_path / 'out').iterdir()}
    assert {'depth.tiff', 'points.ply', 'range_image.png', 'status.png',
            'status_codes.png'} <= listed


def processed(folder, output, *options):
    """Run `process` on the card, return a function that reads one of its images, RGB or codes."""
    files = [str(folder / name) for name in ('left.png', 'right.png')]
    yamls = [str(folder / name) for name in ('left.yaml', 'right.yaml')]
    assert cli.main(['process', *files, '--calibration', *yamls, '--output', str(output),
                     *sample_options(), *options]) == 0

    def read(name):
        image = cv2.imread(str(output / name), cv2.IMREAD_UNCHANGED)
        return image[..., ::-1] if image.ndim == 3 else image
    return read


@pytest.mark.parametrize('colors, limits', [
    ('viridis', 'fixed'), ('viridis', 'automatic'), ('paper', 'fixed')])
def test_process_draws_the_depth_as_chosen_with_a_scale_bar(
        tmp_path, scene_folder, colors, limits):
    read = processed(scene_folder, tmp_path / 'out', '--output.range_colors', colors,
                     '--output.range_limits', limits)
    depth = read('depth.tiff')
    fixed = SimpleNamespace(min_depth=PAPER['range.min_depth'], max_depth=PAPER['range.max_depth'])
    ends = range_limits(depth, fixed, limits)
    assert (ends == (0.25, 0.8)) == (limits == 'fixed')
    np.testing.assert_array_equal(
        read('range_image.png'),
        with_scale_bar(false_color(depth, *ends, colors), *ends, colors))


def test_process_writes_the_status_as_codes_and_as_a_picture_with_a_legend(
        tmp_path, scene_folder):
    read = processed(scene_folder, tmp_path / 'out')
    codes = read('status_codes.png')
    np.testing.assert_array_equal(codes == Status.VALID, np.isfinite(read('depth.tiff')))
    np.testing.assert_array_equal(read('status.png'), with_status_legend(status_picture(codes)))


def test_process_with_a_yaml_that_is_no_calibration_says_so(tmp_path, scene_folder, capsys):
    files = [str(scene_folder / name) for name in ('left.png', 'right.png')]
    bad = scene_folder / 'bad.yaml'
    bad.write_text('just: words')
    assert cli.main(['process', *files, '--calibration', str(bad), str(bad), '--output',
                     str(tmp_path / 'out')]) == 1
    assert 'bad.yaml' in capsys.readouterr().err
    assert not (tmp_path / 'out').exists()


def test_of_two_demos_that_fill_one_folder_the_second_refuses(tmp_path, recorded, capsys):
    samples = tmp_path / 'samples' / 'card'
    samples.mkdir(parents=True)
    recorded.rename(samples / 'recording')
    with held(tmp_path / '.output.color_stereo_demo', tmp_path / 'output'):
        assert cli.main(['demo', '--samples', str(samples.parent), '--output',
                         str(tmp_path / 'output')]) == 1
    assert 'another process is writing into it' in capsys.readouterr().err
    assert not (tmp_path / 'output').exists()

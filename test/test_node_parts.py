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
"""The parts of range_node that need no communication."""

from contextlib import contextmanager
from dataclasses import replace
import errno
import importlib
import os
from pathlib import Path
import subprocess
import sys
import threading
from types import SimpleNamespace
from xml.etree import ElementTree

from color_stereo_ros.core import account, Alignment, RecordingError, Settings, trackers
from color_stereo_ros.core.doubts import Doubts
from color_stereo_ros.core.projector import Track
from color_stereo_ros.core.settings import flat
from color_stereo_ros.files.cloud import save_cloud
from color_stereo_ros.messages.calibration_watch import CalibrationWatch
from color_stereo_ros.messages.contents import CompressedImage, Header
from color_stereo_ros.messages.synchronizer import Pair
from color_stereo_ros.nodes import domains
from color_stereo_ros.nodes.complaints import Complaints
from color_stereo_ros.nodes.environment import defaults, fast_dds_is_known, LOCAL_PROFILE, PROFILE
from color_stereo_ros.nodes.sensor import memory, projector_search
from color_stereo_ros.nodes.sensor import worker as worker_module
from color_stereo_ros.nodes.sensor.outputs import Outputs
from color_stereo_ros.nodes.sensor.worker import Setup, Worker
from color_stereo_ros.nodes.usage import is_wanted
from color_stereo_ros.parameters.groups import RangeNodeSettings

import cv2

import numpy as np

import pytest

from ros_rig import calibration, image_message, info_message, PAPER, scene


class Clock:
    """A clock that the test turns."""

    def __init__(self):
        self.now = 50.0

    def __call__(self):
        return self.now


# ---- environment

FAST_DDS = 'rmw_fastrtps_cpp'
HERE = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}


def test_the_environment_gets_a_sending_thread_and_transports(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert defaults({}, FAST_DDS) == {'RMW_FASTRTPS_PUBLICATION_MODE': 'ASYNCHRONOUS',
                                      'FASTRTPS_DEFAULT_PROFILES_FILE': str(PROFILE)}
    assert PROFILE.is_file()


@pytest.mark.parametrize('name, absent', [
    ('FASTDDS_BUILTIN_TRANSPORTS', 'FASTRTPS_DEFAULT_PROFILES_FILE'),
    ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTRTPS_DEFAULT_PROFILES_FILE'),
    ('RMW_FASTRTPS_PUBLICATION_MODE', 'RMW_FASTRTPS_PUBLICATION_MODE')])
def test_what_the_user_sets_in_the_environment_stays(name, absent):
    found = defaults({name: 'theirs', **HERE}, FAST_DDS)
    assert name not in found and absent not in found


def test_a_profile_in_the_working_directory_stays_in_force(tmp_path, monkeypatch):
    (tmp_path / 'DEFAULT_FASTRTPS_PROFILES.xml').write_text('<profiles/>')
    monkeypatch.chdir(tmp_path)
    assert list(defaults(HERE, FAST_DDS)) == ['RMW_FASTRTPS_PUBLICATION_MODE']


def test_on_this_host_alone_the_profile_keeps_to_it_instead_of_the_middleware(
        tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = defaults(HERE, FAST_DDS)
    assert found['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'SYSTEM_DEFAULT'
    assert found['FASTRTPS_DEFAULT_PROFILES_FILE'] == str(LOCAL_PROFILE)


@pytest.mark.parametrize('environ', [
    {**HERE, 'FASTRTPS_DEFAULT_PROFILES_FILE': 'theirs'},
    {**HERE, 'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'},
    {**HERE, 'ROS_STATIC_PEERS': '192.0.2.7'},
    {**HERE, 'ROS_LOCALHOST_ONLY': '1'},
    {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'OFF'}])
def test_how_far_discovery_reaches_is_not_touched_where_a_profile_could_not_say_it(environ):
    assert 'ROS_AUTOMATIC_DISCOVERY_RANGE' not in defaults(environ, FAST_DDS)


def test_another_middleware_is_left_alone():
    assert defaults(HERE, 'rmw_cyclonedds_cpp') == {}


def test_a_fast_dds_that_may_not_read_the_profiles_keeps_to_the_host_as_told(tmp_path):
    assert list(defaults(HERE, FAST_DDS, reads_profiles=False)) == [
        'RMW_FASTRTPS_PUBLICATION_MODE']
    maps = tmp_path / 'maps'
    for text, known in (('/opt/lib/libfastrtps.so.2.14', True), ('/lib/libfastdds.so.3.2', False)):
        maps.write_text(text)
        assert fast_dds_is_known(maps) == known
    assert not fast_dds_is_known(tmp_path / 'missing')


def test_the_profile_for_this_host_is_the_general_one_with_its_own_peers():
    def elements(path):
        return [(element.tag.rpartition('}')[2], (element.text or '').strip())
                for element in ElementTree.parse(path).getroot().iter()]

    def lists(name, address):
        return [(name, ''), ('locator', ''), ('udpv4', ''), ('address', address)]

    general, local = elements(PROFILE), elements(LOCAL_PROFILE)
    for extra in ([('maxInitialPeersRange', '32')],
                  lists('metatrafficUnicastLocatorList', '0.0.0.0'),
                  lists('initialPeersList', '127.0.0.1')):
        start = local.index(extra[0])
        assert local[start:start + len(extra)] == extra
        del local[start:start + len(extra)]
    assert local == general


# ---- complaints

def test_the_same_text_is_said_once_in_a_while():
    said, clock = [], Clock()
    complain = Complaints(said.append, clock)
    for text in ('a', 'b', 'a', 'a'):
        complain(text)
    clock.now += 5.1
    complain('a')
    assert said == ['a', 'b', 'a']


def test_a_text_that_never_ends_is_repeated_all_the_same():
    said, clock = [], Clock()
    complain = Complaints(said.append, clock)
    for _ in range(60):
        clock.now += 0.2
        complain('a')
    assert len(said) == 3


def test_many_different_texts_are_forgotten_again():
    said = []
    complain = Complaints(said.append, Clock())
    for index in range(1000):
        complain(str(index))
    assert len(said) == 1000
    complain('0')
    assert len(said) == 1001


# ---- calibrations

@pytest.fixture
def watch():
    """Return a watch with both calibrations of the tiny rig, its clock and its changes."""
    clock, changes = Clock(), []
    result = CalibrationWatch(lambda: changes.append(1), clock)
    result.test_clock, result.test_changes = clock, changes
    for side in ('left', 'right'):
        result.add(side, info_message(getattr(calibration(), side)))
    return result


def test_both_calibrations_make_one(watch):
    assert watch.calibration.geometry.baseline == pytest.approx(0.06)
    assert (watch.error, watch.missing, watch.changes) == (None, [], 1)
    assert len(watch.test_changes) == 1


def test_a_repeated_message_changes_nothing(watch):
    before = watch.calibration
    for _ in range(5):
        for side in ('left', 'right'):
            watch.add(side, info_message(getattr(calibration(), side)))
    assert watch.calibration is before and len(watch.test_changes) == 1


def test_one_side_alone_is_no_calibration():
    watch = CalibrationWatch(lambda: None)
    watch.add('left', info_message(calibration().left))
    assert watch.calibration is None and watch.missing == ['right']


def test_a_change_of_one_side_waits_for_the_other_one(watch):
    new = calibration(baseline=0.1)
    watch.add('left', info_message(new.left, d=[0.1, 0, 0, 0, 0.0]))
    assert watch.calibration is None and watch.error is None
    watch.add('right', info_message(new.right))
    assert watch.calibration.geometry.baseline == pytest.approx(0.1)


def test_an_unchanged_other_side_ends_the_wait(watch):
    watch.add('left', info_message(calibration().left, d=[0.1, 0, 0, 0, 0.0]))
    watch.add('right', info_message(calibration().right))
    assert watch.calibration.left.D[0] == 0.1


def test_a_silent_other_side_is_not_awaited_for_ever(watch):
    watch.add('left', info_message(calibration().left, d=[0.1, 0, 0, 0, 0.0]))
    watch.tick()
    assert watch.calibration is None
    watch.test_clock.now += 0.6
    watch.tick()
    assert watch.calibration.left.D[0] == 0.1


def test_a_bad_calibration_replaces_a_good_one_by_its_reason(watch):
    watch.add('left', info_message(calibration().left, k=[0.0] * 9))
    watch.add('right', info_message(calibration().right))
    assert watch.calibration is None
    assert 'left K[0] = 0.0 px: the camera is not calibrated' in watch.error


def test_an_empty_frame_is_warned_of():
    watch = CalibrationWatch(lambda: None)
    for side in ('left', 'right'):
        msg = info_message(getattr(calibration(), side))
        msg.header.frame_id = ''
        watch.add(side, msg)
    assert watch.calibration is not None
    assert 'empty frame_id' in watch.warnings[0]


# ---- the worker

class Log:
    """A logger that keeps what is said."""

    def __init__(self):
        self.errors, self.lines = [], []

    def info(self, text):
        """Keep."""
        self.lines.append(text)

    def warning(self, text):
        """Ignore."""

    def error(self, text):
        """Keep."""
        self.errors.append(text)


def pair(arrival=0.0):
    """Return a pair of image messages."""
    left, right = (image_message(image) for image in scene())
    return Pair(left, right, 0, 0, arrival)


@pytest.fixture
def work():
    """Yield a function that runs pairs through a worker and returns what it did."""
    workers = []

    def run(pairs, on_publish=lambda *_: None):
        done, log, failures = threading.Event(), Log(), []
        settings = replace(RangeNodeSettings(), matching=Settings().updated(PAPER).matching)

        def publish(*arguments):
            on_publish(*arguments)
            done.set()

        def fail(_, text):
            failures.append(text)
            done.set()

        worker = Worker(Setup(calibration(), settings), publish, fail, log, Outputs.prepare)
        workers.append(worker)
        worker.start()
        for each in pairs:
            done.clear()
            worker.submit(each)
            assert done.wait(120.0)
        return worker, log, failures

    yield run
    for worker in workers:
        worker.stop()


def test_an_exception_costs_its_pair_and_not_the_worker(work, monkeypatch):
    calls = []

    class Fragile(worker_module.ColorStereo):
        """Breaks at its second pair."""

        def process(self, left, right):
            if left.any():
                calls.append(1)
            if left.any() and len(calls) == 2:
                raise RuntimeError('broken on purpose')
            return super().process(left, right)

    monkeypatch.setattr(worker_module, 'ColorStereo', Fragile)
    worker, log, failures = work([pair(), pair(), pair()])
    worker.stop()
    assert failures == ['RuntimeError: broken on purpose']
    assert 'Traceback' in log.errors[0] and len(log.errors) == 1
    assert (worker.account.measured, worker.account.failed) == (2, 1)


def test_a_compressed_pair_is_known_by_its_identity_when_it_is_published(work):
    published, one = [], pair()
    compressed = replace(one, **{
        side: CompressedImage(Header.of(getattr(one, side).header), 'rgb8; png compressed bgr8',
                              cv2.imencode('.png', image[..., ::-1])[1].tobytes())
        for side, image in zip(('left', 'right'), scene())})
    work([one, compressed], on_publish=lambda *arguments: published.append(arguments))
    (expected, *_), (result, same, _) = published
    assert same is compressed
    np.testing.assert_array_equal(result.disparity, expected.disparity)


def test_a_failure_to_publish_is_contained_as_well(work):
    def refuse(*_):
        raise OSError(errno.EIO, 'wire cut')

    worker, _, failures = work([pair()], on_publish=refuse)
    assert 'wire cut' in failures[0]
    assert worker.account.measured == 0


def test_a_worker_can_be_stopped_before_it_has_started(work):
    worker = Worker(Setup(None, RangeNodeSettings()), print, print, Log(), print)
    worker.stop()
    assert worker.dropped == 0


@pytest.mark.parametrize('changes, known, made', [
    ({}, True, True), ({}, False, False), (PAPER, True, False),
    ({'matching.third_view': 'off'}, True, False), ({'pattern.type': 'unknown'}, True, False)])
def test_the_features_of_the_pattern_are_made_before_the_first_pair(
        changes, known, made, monkeypatch):
    asked, done = [], threading.Event()
    monkeypatch.setattr(projector_search, 'tracker_of', lambda *given: asked.append(given))
    monkeypatch.setattr(projector_search, 'give_back', done.set)
    core = Settings().updated(changes)
    settings = replace(RangeNodeSettings(), matching=core.matching, pattern=core.pattern)
    rig = calibration() if known else None
    Worker(Setup(None, settings), print, print, Log(), print).configure(Setup(rig, settings))
    assert done.wait(10.0 if made else 0.0) == made
    assert [pattern for pattern, _ in asked] == [core.pattern] * made


@pytest.mark.parametrize('known', [Track(), Track.known(None)])
def test_a_pair_from_before_the_projector_was_found_starts_no_search(known, monkeypatch):
    searched = threading.Event()
    monkeypatch.setattr(projector_search, '_search', lambda *_: searched.set())
    search = projector_search.ProjectorSearch()
    search.look(SimpleNamespace(projector=known), SimpleNamespace(projector=Track()))
    assert searched.wait(10.0 if known.due else 0.1) == known.due


def test_a_first_search_waits_for_the_features_that_another_thread_makes(monkeypatch):
    begun, go, made = threading.Event(), threading.Event(), []

    def slow(settings):
        begun.set()
        go.wait(10.0)
        made.append(settings)
        return np.zeros((48, 64, 3), np.uint8)

    monkeypatch.setattr(trackers, 'make_pattern', slow)
    asked = Settings().updated({'pattern.seed': 4711}).pattern, calibration().geometry
    found = [None, None]

    def ask(place):
        found[place] = trackers.tracker_of(*asked)

    threads = [threading.Thread(target=ask, args=(place,)) for place in range(2)]
    for thread in threads:
        thread.start()
    assert begun.wait(10.0)
    go.set()
    for thread in threads:
        thread.join()
    assert found[0] is found[1] is not None and len(made) == 1


def test_free_memory_goes_back_to_the_system():
    blocks = [b'x' * 65536 for _ in range(1000)]
    kept = blocks[::50]  # the allocator gives back only what is free at its end
    del blocks
    before = resident()
    memory.give_back()
    assert before - resident() > 40 * 2 ** 20 and len(kept) == 20


def resident():
    """Return the resident memory of this process, bytes."""
    pages = int(Path('/proc/self/statm').read_text().split()[1])
    return pages * os.sysconf('SC_PAGE_SIZE')


@pytest.mark.parametrize('library', [OSError, TypeError, AttributeError])
def test_another_c_library_keeps_its_memory(library, monkeypatch):
    def load(name):
        raise library('none')

    monkeypatch.setattr(memory.ctypes, 'CDLL', load)
    memory.give_back()


class Helper:
    """A process that compiles, in name only."""

    def __init__(self):
        self.killed = False

    def kill(self):
        """Note it."""
        self.killed = True

    def wait(self):
        """Be gone."""


@pytest.mark.parametrize('method, cold, cached, helps', [
    ('surface', True, True, True), ('surface', False, True, False), ('paper', True, True, False),
    ('surface', True, False, False)])
def test_a_second_process_helps_to_compile_until_the_kernels_are_there(
        method, cold, cached, helps, monkeypatch):
    helpers = []

    def start():
        helpers.append(Helper())
        return helpers[-1]

    @contextmanager
    def told(tell):
        if cold:
            tell()
        yield

    monkeypatch.setattr(worker_module, 'told_of_compiling', told)
    monkeypatch.setattr(worker_module, 'is_cached', lambda: cached)
    monkeypatch.setattr(worker_module.warm_up, 'start_helper', start)
    settings = replace(RangeNodeSettings(),
                       matching=Settings().updated({'matching.method': method}).matching)
    ready = threading.Event()
    log = Log()
    worker = Worker(Setup(None, settings), print, print, log, lambda result: ready.set())
    worker.start()
    assert ready.wait(120.0)
    worker.stop()
    assert any(worker_module.COMPILING in text for text in log.lines) == cold
    assert [helper.killed for helper in helpers] == [True] * helps


def test_a_system_that_allows_no_further_process_costs_the_helper_only(monkeypatch):
    def refuse(*_, **__):
        raise BlockingIOError('no more processes')

    monkeypatch.setattr(subprocess, 'Popen', refuse)
    assert worker_module.warm_up.start_helper() is None


def test_the_helper_goes_through_all_stages():
    """Without the compiler: that takes a second instead of half a minute."""
    environment = {**os.environ, 'NUMBA_DISABLE_JIT': '1'}
    subprocess.run([sys.executable, '-m', 'color_stereo_ros.core.surface.warm_up'], check=True,
                   env=environment, cwd=Path(__file__).parents[1])


WARM = """
from color_stereo_ros.core import ColorStereo
from color_stereo_ros.core.surface import (
    coarse, neighbors, pair_model, pixels, planes, trust, views)
from color_stereo_ros.core.surface.warm_up import some_calibration
ColorStereo(some_calibration())
for module in (coarse, neighbors, pair_model, pixels, planes, trust, views):
    for name, kernel in vars(module).items():
        if hasattr(kernel, 'signatures'):
            assert kernel.signatures, name
            print(name)
"""


def test_some_pair_of_some_rig_goes_through_every_kernel():
    names = subprocess.run([sys.executable, '-c', WARM], check=True, capture_output=True,
                           text=True).stdout.split()
    assert len(names) > 10


# ---- doubts

class CountedStereo:
    """Measures black pairs; the other way round they have ranges."""

    def __init__(self, swapped_density):
        self.calls = 0
        self.density = swapped_density
        self.settings = Settings()
        self.alignment, self.health = Alignment.unknown((64, 48)), None

    def process(self, left, right, alignment, projector, health):
        """Count."""
        self.calls += 1
        return self


def looked_at(stereo, seconds, density, said, clock):
    """Look at 20 pairs a second for a while and return the Doubts."""
    doubts = Doubts(said.append, clock)
    left, right = scene()
    result = SimpleNamespace(density=density, status=np.zeros((4, 4), np.uint8), alignment=None,
                             rival_share=0.0, image=left)
    for _ in range(20 * seconds):
        clock.now += 0.05
        doubts.look(stereo, left, right, result)
    return doubts


def test_the_other_order_is_tried_ever_more_rarely():
    stereo = CountedStereo(0.0)
    doubts = looked_at(stereo, 60, 0.1, [], Clock())
    assert doubts.current == [] and 10 <= stereo.calls <= 20


def test_the_other_order_is_not_tried_while_there_are_ranges():
    stereo = CountedStereo(1.0)
    looked_at(stereo, 60, 0.5, [], Clock())
    assert stereo.calls == 0


def test_a_doubt_is_said_once_while_it_lasts():
    said = []
    doubts = looked_at(CountedStereo(0.9), 60, 0.1, said, Clock())
    assert said == doubts.current and len(said) == 1
    assert said[0].startswith('left and right image swapped?')


def test_gray_cameras_are_told_once_with_advice_and_are_no_doubt():
    said, clock = [], Clock()
    doubts = Doubts(said.append, clock)
    left, right = (np.repeat(image[..., 1:2], 3, axis=2) for image in scene())
    for _ in range(5):
        clock.now += 3.0
        doubts.look(CountedStereo(0.9), left, right, SimpleNamespace(
            density=1.0, status=np.zeros((4, 4), np.uint8), alignment=None, image=left,
            rival_share=0.0))
    assert doubts.pattern.gray and doubts.pattern.agrees is None and doubts.current == []
    assert said == [doubts.pattern.sentence]
    assert said[0].startswith('both cameras are gray: the brightness of the pattern is matched')
    assert said[0].endswith('pseudo_noise suits gray cameras better than hue_field')


def test_rows_that_disagree_are_told_once_whatever_the_number():
    said = []
    doubts = Doubts(said.append, Clock())
    left, right = scene()
    spread = 1e-4 * np.eye(7)
    for offset in (0.7, 0.72, 0.9):
        alignment = Alignment((64, 48), [offset, *np.zeros(6)], spread, np.zeros(7))
        doubts.look(CountedStereo(0.9), left, right, SimpleNamespace(
            density=1.0, status=np.zeros((4, 4), np.uint8), alignment=alignment, image=left,
            rival_share=0.0))
    assert len(said) == 1 and said[0].startswith('rows differ by 0.7 px (')


def test_small_structures_of_the_pattern_are_told_once(monkeypatch):
    sizes = iter((3.9, 4.2, 3.8, 5.0, 4.2))
    monkeypatch.setattr(account, 'feature_size_in', lambda image, pattern: next(sizes))
    said, held, clock = [], [], Clock()
    doubts = Doubts(said.append, clock)
    left, right = scene()
    for _ in range(5):
        clock.now += 2.0
        doubts.look(CountedStereo(0.9), left, right, SimpleNamespace(
            density=1.0, status=np.zeros((4, 4), np.uint8), alignment=None, image=left,
            rival_share=0.0))
        held.append(len(doubts.current))
    assert held == [1, 1, 1, 0, 0] and len(said) == 1
    assert 'set pattern.feature_size to 10 instead of 9' in said[0]


# ---- domains

CLAIM = 'from color_stereo_ros.nodes.domains import own_domain; print(own_domain(), flush=True)'


def test_processes_that_run_at_a_time_have_different_domains():
    processes = [subprocess.Popen([sys.executable, '-c', f'{CLAIM}; input()'], text=True,
                                  stdin=subprocess.PIPE, stdout=subprocess.PIPE)
                 for _ in range(3)]
    found = [int(process.stdout.readline()) for process in processes]
    for process in processes:
        process.communicate('\n')
    assert len(set(found)) == 3 and all(1 <= domain <= 100 for domain in found)


def test_a_domain_that_is_claimed_or_where_somebody_listens_is_not_given_out(monkeypatch):
    monkeypatch.setattr(domains, '_held', [])
    taken = {7400 + 250 * 7 + 249, 7400 + 250 * 3 + 10}
    bound = domains._bound
    monkeypatch.setattr(domains, '_bound', lambda port: None if port in taken else bound(0))
    monkeypatch.setattr(domains, 'LAST', 7)
    assert {domains.own_domain() for _ in range(40)} == {1, 2, 4, 5, 6}
    taken.update(range(7400, 7400 + 250 * 8))
    with pytest.raises(OSError, match='all ROS domains 1 .. 7 of this machine are in use'):
        domains.own_domain()
    for claim in domains._held:
        claim.close()


# ---- help

@pytest.mark.parametrize('words, wanted', [
    (['--help'], True), (['-h'], True), (['--ros-args', '-p', 'a:=1', '--', '-h'], True),
    (['--ros-args', '--help'], True), (['--ros-args', '-r', '-h'], False), ([], False),
    (['--ros-args', '-p', 'help:=1'], False)])
def test_help_is_told_from_the_arguments_of_ros(words, wanted):
    assert is_wanted(words) == wanted


@pytest.mark.parametrize('name', ['range_node', 'pattern_node', 'lifecycle_range_node',
                                  'sim_rig_node'])
def test_help_lists_topics_and_parameters_and_starts_no_node(name):
    code = (f'import sys; from color_stereo_ros.nodes.{name} import main; status = main(); '
            'print("rclpy" in sys.modules); sys.exit(status)')
    done = subprocess.run([sys.executable, '-c', code, '--help'], capture_output=True, text=True,
                          cwd=Path(__file__).parents[1], env={**os.environ, 'COLUMNS': '80'})
    assert (done.returncode, done.stderr) == (0, '')
    *lines, started = done.stdout.splitlines()
    assert started == 'False'
    module = importlib.import_module(f'color_stereo_ros.nodes.{name}')
    usage = module.usage()
    assert lines[0].startswith(f'usage: {name} ')
    for word in (*flat(usage.settings), *(row[0] for row in usage.published)):
        assert f'  {word}' in done.stdout, word
    assert all(len(line) <= 80 for line in lines[1:])


# ---- files of points

def cloud():
    """Return points with one unknown, and colors."""
    points = np.arange(24, dtype=np.float32).reshape(2, 4, 3)
    points[0, 1] = np.nan
    return points, np.arange(24, dtype=np.uint8).reshape(2, 4, 3)


def test_a_ply_file_holds_the_known_points(tmp_path):
    points, colors = cloud()
    assert save_cloud(tmp_path / 'a.ply', points, colors) == 7
    header, _, body = (tmp_path / 'a.ply').read_bytes().partition(b'end_header\n')
    assert b'element vertex 7' in header and b'binary_little_endian' in header
    vertices = np.frombuffer(body, [('xyz', '<f4', 3), ('rgb', 'u1', 3)])
    known = np.isfinite(points).all(axis=2)
    np.testing.assert_array_equal(vertices['xyz'], points[known])
    np.testing.assert_array_equal(vertices['rgb'], colors[known])


def test_a_pcd_file_holds_the_known_points(tmp_path):
    points, colors = cloud()
    assert save_cloud(tmp_path / 'a.pcd', points, colors) == 7
    header, _, body = (tmp_path / 'a.pcd').read_bytes().partition(b'DATA binary\n')
    assert b'POINTS 7' in header
    vertices = np.frombuffer(body, [('xyz', '<f4', 3), ('bgr', 'u1', 3), ('zero', 'u1')])
    known = np.isfinite(points).all(axis=2)
    np.testing.assert_array_equal(vertices['xyz'], points[known])
    np.testing.assert_array_equal(vertices['bgr'][:, ::-1], colors[known])


def test_another_suffix_is_refused(tmp_path):
    with pytest.raises(RecordingError, match="ends in '.xyz', expected .ply or .pcd"):
        save_cloud(tmp_path / 'a.xyz', *cloud())


def test_a_failed_write_keeps_the_old_file_and_leaves_no_other(tmp_path, monkeypatch):
    (tmp_path / 'a.ply').write_text('old')

    def full(_):
        raise OSError(errno.ENOSPC, 'No space left on device')

    monkeypatch.setattr(os, 'fsync', full)
    with pytest.raises(RecordingError, match='a.ply cannot be written: No space left on device'):
        save_cloud(tmp_path / 'a.ply', *cloud())
    assert [path.name for path in tmp_path.iterdir()] == ['a.ply']
    assert (tmp_path / 'a.ply').read_text() == 'old'

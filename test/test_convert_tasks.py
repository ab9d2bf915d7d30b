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
"""`color_stereo convert` by tasks: the same result whoever works, and nothing is lost."""

from contextlib import contextmanager
import logging
import os
from pathlib import Path
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time

from color_stereo_ros.cli import main as cli
from color_stereo_ros.core import Settings
from color_stereo_ros.core.settings import flat
from color_stereo_ros.messages.contents import Header
from color_stereo_ros.messages.outputs import Context, OUTPUTS
from color_stereo_ros.messages.synchronizer import Pair
from color_stereo_ros.messages.trimming import trimmed
from color_stereo_ros.nodes.sensor import worker
from color_stereo_ros.parameters.groups import RangeNodeSettings
from color_stereo_ros.recordings import engine, tasks, working
from color_stereo_ros.recordings.carrying import TaskStereo
from color_stereo_ros.recordings.measuring import make_stereo
from color_stereo_ros.recordings.pairing import Place, Places
from color_stereo_ros.recordings.reading import Recording
from color_stereo_ros.recordings.types import serialized
from color_stereo_ros.recordings.writing import write_recording
import numpy as np
import projected
import pytest
from scenes import hue_pair, parallel_rig

SECOND = 1_000_000_000
COUNT = 7
FEW = 2  # pairs of a task here
VALUES = 'points', 'depth/image', 'depth_std/image', 'confidence/image', 'status/image'
PAPER = ['--matching.method', 'paper', '--pattern.type', 'sweep', '--color.smoothing', '0',
         '--range.min_depth', '0.4', '--range.max_depth', '3']


def surface_options():
    """Return the options for the pairs of `projected`, third view included."""
    pattern = projected.PATTERN
    near, far = (projected.CALIBRATION.geometry.focal_baseline / disparity
                 for disparity in projected.LIMITS[::-1])
    return ['--pattern.width', str(pattern.width), '--pattern.height', str(pattern.height),
            '--pattern.feature_size', str(pattern.feature_size),
            '--range.min_depth', str(near), '--range.max_depth', str(far)]


@pytest.fixture(scope='module')
def lit(tmp_path_factory):
    """Return a recording of pairs with a projector, each with noise of its own."""
    path = tmp_path_factory.mktemp('tasks') / 'lit'
    with write_recording(path) as writer:
        for index in range(COUNT):
            writer.write_pair((1 + index) * SECOND, *projected.pair(noise=1 + index),
                              projected.CALIBRATION)
    return path


@pytest.fixture(scope='module')
def cards(tmp_path_factory):
    """Return a recording of small pairs for the paper's method."""
    path = tmp_path_factory.mktemp('tasks') / 'cards'
    with write_recording(path) as writer:
        for index in range(COUNT):
            writer.write_pair((1 + index) * SECOND, *hue_pair(6 + index), parallel_rig())
    return path


@pytest.fixture
def few(monkeypatch):
    """Let a task have few pairs."""
    monkeypatch.setattr(tasks, 'PAIRS', FEW)
    monkeypatch.setattr(tasks, 'WARM_UP', 1)
    monkeypatch.setattr(tasks, 'SETTLING', 2)


def decoded(path):
    """Return what a recording holds, in its order: topics, times, and every field as text."""
    with Recording(path) as recording:
        return [(message.topic, message.time_ns, fields(recording.decoded(message)))
                for message in recording.messages()]


def fields(content):
    """Return a decoded message as something that can be compared."""
    if isinstance(content, np.ndarray):
        return content.tobytes()
    if isinstance(content, list):
        return [fields(item) for item in content]
    if hasattr(content, '__dataclass_fields__'):
        return {name: fields(getattr(content, name)) for name in content.__dataclass_fields__}
    return content


def test_every_pair_is_in_one_task_and_warm_up_comes_before_it():
    rows = np.zeros(10, tasks.ROW)
    rows['recorded'] = range(10)
    rows['calibration'] = [0] * 7 + [1] * 3
    made = tasks.tasks_of(rows, 3)
    assert [list(task.rows['recorded']) for task in made] == [
        [0, 1, 2], [3, 4, 5], [6], [7, 8, 9]]
    assert [list(task.warm_up['recorded']) for task in made] == [[], [0, 1, 2], [3, 4, 5], []]
    assert [len(task.settling) for task in made] == [0, 7, 7, 0]
    assert [task.calibration for task in made] == [0, 0, 0, 1]
    assert len(tasks.tasks_of(rows, None)) == 2


def test_messages_of_one_time_have_different_places():
    class Message:

        def __init__(self, topic, time_ns):
            self.topic, self.time_ns = topic, time_ns
    places = Places()
    rows = [('a', 5), ('b', 5), ('a', 5), ('a', 6)]
    assert [places.of(Message(*row)) for row in rows] == [
        Place(5, 0), Place(5, 0), Place(5, 1), Place(6, 0)]


@pytest.mark.processes
def test_one_process_two_processes_and_a_resumed_run_give_the_same(tmp_path, lit, few,
                                                                   monkeypatch):
    options = [*surface_options(), '--topics', 'points', 'depth/image', 'depth_std/image',
               'confidence/image', 'status/image', 'views/image']
    for name, workers in (('one', '1'), ('two', '2')):
        assert cli.main(['convert', str(lit), str(tmp_path / name), *options,
                         '--workers', workers]) == 0
    one = decoded(tmp_path / 'one')
    assert len(one) >= 6 * COUNT
    assert decoded(tmp_path / 'two') == one
    stopped_after(monkeypatch, 2)
    words = ['convert', str(lit), str(tmp_path / 'resumed'), *options, '--workers', '1']
    assert cli.main(words) == cli.INTERRUPTED
    monkeypatch.undo()
    monkeypatch.setattr(tasks, 'PAIRS', FEW)
    monkeypatch.setattr(tasks, 'WARM_UP', 1)
    monkeypatch.setattr(tasks, 'SETTLING', 2)
    assert cli.main([*words, '--resume']) == 0
    assert decoded(tmp_path / 'resumed') == one
    assert sorted(path.name for path in tmp_path.iterdir()) == ['one', 'resumed', 'two']


def stopped_after(monkeypatch, count):
    """Let a run be interrupted after so many tasks."""
    measure, done = working.measure_task, []

    def measured(*arguments):
        if len(done) == count:
            raise KeyboardInterrupt
        done.append(None)
        return measure(*arguments)
    monkeypatch.setattr(engine, 'measure_task', measured)


def test_the_first_task_gives_what_a_node_gives_that_has_just_started(tmp_path, lit, few):
    options = [*surface_options(), '--topics', 'depth/image', '--workers', '1']
    assert cli.main(['convert', str(lit), str(tmp_path / 'tasks'), *options]) == 0
    converted = [content['data'] for _, _, content in decoded(tmp_path / 'tasks')
                 if 'data' in content][:FEW]
    stereo = make_stereo(projected.CALIBRATION, RangeNodeSettings(
        **{name: getattr(settings_of(options), name) for name in ('pattern', 'range')}))
    depths = [stereo.process(*projected.pair(noise=1 + index)).depth.tobytes()
              for index in range(FEW)]
    assert converted == depths


def test_a_later_task_gives_what_a_node_gives_in_the_state_in_which_it_begins(tmp_path, lit, few,
                                                                              monkeypatch):
    options = [*surface_options(), '--topics', *VALUES, '--workers', '1']
    assert cli.main(['convert', str(lit), str(tmp_path / 'tasks'), *options]) == 0
    settings = RangeNodeSettings(**{name: getattr(settings_of(options), name)
                                    for name in ('pattern', 'range')})
    with Recording(lit) as recording:
        topics = recording.stereo_topics()
        plan = tasks.plan_of(recording, topics, settings, print)
        carried = TaskStereo(topics, settings, plan.calibrations.__getitem__)
        task = tasks.tasks_of(plan.rows, FEW)[2]
        state = carried.before(recording, task)
        pairs = list(carried.pairs(recording, task.rows))
        alignment, projector, health = state.alignment, state.projector, state.health
    assert projector is not None and len(task.warm_up) == 1

    class Started(worker.ColorStereo):
        """Begins in the state of a task."""

        def __init__(self, *arguments, **options):
            super().__init__(*arguments, **options)
            self.adopt(alignment)
            self.adopt_projector(projector)
            self.adopt_health(health)

    monkeypatch.setattr(worker, 'ColorStereo', Started)
    expected = measured_by_a_node(settings, pairs)
    with Recording(tmp_path / 'tasks') as recording:
        found = {(message.topic, message.time_ns): bytes(message.data)
                 for message in recording.messages()}
    assert len(expected) == len(VALUES) * FEW
    assert [key for key in expected if found[key] != expected[key]] == []


def measured_by_a_node(settings, pairs):
    """Return topic and time to the bytes of what the thread of a node makes of FoundPairs."""
    results, done = [], threading.Event()

    def publish(result, *_):
        results.append(result)
        done.set()

    thread = worker.Worker(worker.Setup(projected.CALIBRATION, settings), publish, print,
                           logging.getLogger(), lambda result: None)
    thread.start()
    for pair in pairs:
        done.clear()
        thread.submit(Pair(pair.left.content, pair.right.content, pair.stamp, 0,
                           time.monotonic()))
        assert done.wait(120)
    thread.stop()
    found = {}
    for pair, result in zip(pairs, results, strict=True):
        context = Context.of(Header.of(pair.left.header), settings, pair.calibration)
        for topic in VALUES:
            content = OUTPUTS[topic].content(trimmed(result, context), context)
            found[f'/{topic}', pair.time_ns] = bytes(serialized(content))
    return found


def settings_of(options):
    """Return the core's settings of the options of a command line."""
    names = {option[2:]: value for option, value in zip(options[::2], options[1::2])}
    known = flat(Settings())
    return Settings().updated({name: type(known[name])(float(value))
                               for name, value in names.items() if name in known})


def test_a_run_that_was_stopped_is_neither_mixed_with_another_nor_forgotten(
        tmp_path, cards, few, monkeypatch, capsys):
    words = ['convert', str(cards), str(tmp_path / 'result'), *PAPER, '--workers', '1']
    with monkeypatch.context() as patched:
        stopped_after(patched, 2)
        assert cli.main(words) == cli.INTERRUPTED
    assert '--resume' in capsys.readouterr().err
    assert not (tmp_path / 'result').exists()
    assert cli.main(words) == 1
    assert '2 parts of an earlier run' in capsys.readouterr().err
    assert cli.main([*words, '--resume', '--color.smoothing', '1']) == 1
    assert 'of another run: color.smoothing was 0.0, now it is 1.0' in capsys.readouterr().err
    assert cli.main([*words, '--color.smoothing', '1', '--restart']) == 0
    assert [path.name for path in tmp_path.iterdir()] == ['result']


@pytest.mark.processes
def test_a_killed_worker_costs_its_task_and_nothing_else(tmp_path, cards, few, effort):
    words = ['convert', str(cards), str(tmp_path / 'alone'), *PAPER, '--workers', '1']
    assert cli.main(words) == 0
    expected = decoded(tmp_path / 'alone')
    for seed in range(effort.count(1, 100)):
        result = tmp_path / f'killed_{seed}'
        delay = np.random.default_rng(seed).uniform(0, 3)
        killer = threading.Thread(target=kill_a_worker, args=(delay,))
        killer.start()
        status = cli.main([*words[:2], str(result), *words[3:-1], '2'])
        killer.join()
        assert status == 0 and decoded(result) == expected


def test_three_machines_give_the_same_though_one_is_killed(tmp_path, cards, few, effort):
    words = ['convert', str(cards), str(tmp_path / 'alone'), *PAPER, '--workers', '1']
    assert cli.main(words) == 0
    expected = decoded(tmp_path / 'alone')
    with cluster(tmp_path / 'dask', 3) as (address, machines):
        for seed in range(effort.count(1, 20)):
            result = tmp_path / f'cluster_{seed}'
            delay = np.random.default_rng(seed).uniform(0, 2)
            killer = threading.Thread(target=kill_a_worker, args=(delay, machines[0].pid))
            killer.start()
            assert cli.main([*words[:2], str(result), *words[3:-2], '--scheduler', address]) == 0
            killer.join()
            assert decoded(result) == expected


def test_a_scheduler_exports_the_same_files(tmp_path, cards, few):
    words = ['export', str(cards), str(tmp_path / 'alone'), '--products', 'ply', 'npz', *PAPER]
    assert cli.main([*words, '--workers', '1']) == 0
    with cluster(tmp_path / 'dask', 2) as (address, _):
        words[2] = str(tmp_path / 'cluster')
        assert cli.main([*words, '--scheduler', address]) == 0
    alone, others = (sorted((tmp_path / name).iterdir()) for name in ('alone', 'cluster'))
    assert [path.name for path in alone] == [path.name for path in others]
    assert len(alone) == 2 * COUNT
    assert all(path.read_bytes() == other.read_bytes() for path, other in zip(alone, others))


def test_the_memory_of_a_worker_does_not_grow_with_the_pairs(tmp_path, effort, figures,
                                                             monkeypatch):
    count, settled = effort.count(1000, 2000), 200  # fewer: one step of the heap is a slope
    pair = hue_pair(8)
    with write_recording(tmp_path / 'long') as writer:
        for index in range(count):
            writer.write_pair((1 + index) * SECOND // 10, *pair, parallel_rig())
    measure, used = working.measure_task, []

    def measured(run, task, tick):
        account = measure(run, task, tick)
        pages = int(Path('/proc/self/statm').read_text(encoding='ascii').split()[1])
        used.append(((task.index + 1) * tasks.PAIRS, pages * os.sysconf('SC_PAGE_SIZE') / 1e3))
        return account

    monkeypatch.setattr(engine, 'measure_task', measured)
    assert cli.main(['convert', str(tmp_path / 'long'), str(tmp_path / 'result'), *PAPER,
                     '--workers', '1']) == 0
    pairs, kilobytes = np.array([row for row in used if row[0] > settled]).T
    figures('convert: memory of a worker', np.polyfit(pairs, kilobytes, 1)[0], 'kB a pair',
            over=count, at_most=10.0)


@pytest.mark.parametrize('command', ['convert', 'export'])
def test_an_interrupt_of_all_processes_is_one_line(tmp_path, command):
    pair = hue_pair(8)
    with write_recording(tmp_path / 'long') as writer:
        for index in range(20 * tasks.PAIRS):
            writer.write_pair((1 + index) * SECOND, *pair, parallel_rig())
    with subprocess.Popen(
            [sys.executable, '-m', 'color_stereo_ros.cli.main', command,
             str(tmp_path / 'long'), str(tmp_path / 'result'), *PAPER, '--workers', '2'],
            start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
            text=True) as process:
        end = time.monotonic() + 60
        while not measuring(process.pid) and time.monotonic() < end:
            time.sleep(0.05)
        time.sleep(2)  # they are in the middle of their work, or will soon be
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
        said = process.communicate(timeout=60)[1]
    assert process.returncode == cli.INTERRUPTED
    assert 'Traceback' not in said and said.rstrip().endswith('color_stereo: interrupted')
    if command == 'export':
        assert [path for path in tmp_path.rglob('.*') if path.parent != tmp_path] == []


@contextmanager
def cluster(folder, machines):
    """Start a scheduler and workers with folders of their own; yield its address and them."""
    folder.mkdir()
    address = f'tcp://127.0.0.1:{free_port()}'
    commands = [['dask_scheduler', '--host', address, '--no-dashboard', '--no-show'], *(
        ['dask_worker', address, '--nthreads', '1', '--no-dashboard', '--local-directory',
         str(folder / str(index))] for index in range(machines))]
    started = [subprocess.Popen([sys.executable, '-m', f'distributed.cli.{name}', *words],
                                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
               for name, *words in commands]
    try:
        await_listener(address)
        yield address, started[1:]
    finally:
        for process in reversed(started):  # a worker whose scheduler has gone may wait for it
            process.terminate()
            process.wait(30)


def await_listener(address):
    """Wait until somebody listens at an address."""
    end = time.monotonic() + 60
    while time.monotonic() < end:
        with socket.socket() as caller:
            if not caller.connect_ex(('127.0.0.1', int(address.rpartition(':')[2]))):
                return
        time.sleep(0.1)


def free_port():
    """Return a port of this machine that nobody listens at."""
    with socket.socket() as listener:
        listener.bind(('127.0.0.1', 0))
        return listener.getsockname()[1]


def kill_a_worker(delay, parent=None):
    """Kill one of the processes that measure, some time after the first one has begun."""
    end = time.monotonic() + 60
    while not (found := measuring(parent)) and time.monotonic() < end:
        time.sleep(0.05)
    time.sleep(delay)
    for process in measuring(parent)[:1] or found[:1]:
        try:
            os.kill(process, signal.SIGKILL)
        except ProcessLookupError:
            pass


def measuring(parent=None):
    """Return the processes of Dask that measure below another one, usually this one."""
    above = parent or os.getpid()
    parents = {}
    for folder in Path('/proc').glob('[0-9]*'):
        try:
            state = (folder / 'stat').read_text().rpartition(')')[2]
            parents[int(folder.name)] = int(state.split()[1])
        except (OSError, ValueError):
            continue
    return [child for child, parent in parents.items()
            if parent == above and b'spawn_main' in command_of(child)]


def command_of(process):
    """Return the command line of a process, empty if it has ended."""
    try:
        return Path(f'/proc/{process}/cmdline').read_bytes()
    except OSError:
        return b''


def test_a_result_is_one_recording_of_several_files(tmp_path, cards, few):
    assert cli.main(['convert', str(cards), str(tmp_path / 'result'), *PAPER,
                     '--workers', '1']) == 0
    assert sorted(path.name for path in (tmp_path / 'result').iterdir()) == [
        'metadata.yaml', *(f'result_{index}.mcap' for index in range(4))]
    with Recording(tmp_path / 'result') as recording:
        assert recording.counts == {'/points': COUNT, '/depth/image': COUNT,
                                    '/depth/camera_info': COUNT}
        times = [message.time_ns for message in recording.messages(['/depth/image'])]
    assert times == [(1 + index) * SECOND for index in range(COUNT)]


@pytest.mark.parametrize('words, said', [
    (['--workers', '0'], '--workers 0: expected 1 or more'),
    pytest.param(['--scheduler', 'tcp://127.0.0.1:1'], 'no Dask scheduler answers there',
                 marks=pytest.mark.processes)])
def test_impossible_workers_are_refused(tmp_path, cards, capsys, words, said):
    assert cli.main(['convert', str(cards), str(tmp_path / 'result'), *PAPER, *words])
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize('command', ['convert', 'export', 'view'])
def test_a_place_that_takes_no_result_is_told_before_the_work(cards, capsys, command):
    place = '/proc/results'  # nobody may write there, not even root
    words = [place] if command != 'view' else ['--html', place]
    assert cli.main([command, str(cards), *words, *PAPER[:8]]) == cli.FAILURE
    said = capsys.readouterr().err
    assert said.startswith(f'color_stereo: {place}: ') and said.count('\n') == 1
    assert 'color_stereo_' not in said


@pytest.mark.parametrize('command', ['convert', 'export'])
def test_a_recording_is_never_replaced_by_its_own_result(tmp_path, cards, capsys, command):
    bag = tmp_path / 'bag'
    shutil.copytree(cards, bag)
    before = sorted(path.name for path in bag.iterdir())
    named = bag / 'cards.mcap' if command == 'convert' else bag
    assert cli.main([command, str(named), str(bag), *PAPER, '--overwrite']) == 2
    assert 'is the recording itself, or holds it' in capsys.readouterr().err
    assert sorted(path.name for path in bag.iterdir()) == before

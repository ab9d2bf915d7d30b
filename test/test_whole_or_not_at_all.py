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
"""Nothing foreign is replaced, two processes do not share a name, and nothing unfinished stays."""

import os
from pathlib import Path
import signal
import subprocess
import sys

from color_stereo_ros.cli import main as cli
from color_stereo_ros.core import RecordingError
from color_stereo_ros.files import atomic
from color_stereo_ros.files.atomic import folder_written_whole, write_text, written_whole
from color_stereo_ros.files.claim import claimed
import pytest

SCENE = Path(__file__).parent / 'data' / 'scenes' / 'flat_350_hue1'
WRITER = """
import sys, time
from pathlib import Path
from color_stereo_ros.cli import main as cli
from color_stereo_ros.files.atomic import folder_written_whole, written_whole
from color_stereo_ros.files.claim import claimed

def folder(path):
    with folder_written_whole(path, replace=True) as unfinished:
        unfinished.mkdir()
        (unfinished / 'half').write_text('half')
        wait()

def file(path):
    with written_whole(path) as partial:
        partial.write_text('half')
        wait()

def claim(path):
    with claimed(path, 'test', ['a.txt']):
        wait()

def wait():
    print('ready', flush=True)
    time.sleep(600)

class Args:
    run = staticmethod(lambda args: globals()[sys.argv[1]](Path(sys.argv[2])))

cli.parsed = lambda argv: Args
sys.exit(cli.main())
"""


@pytest.fixture
def writing():
    """Return a function that starts a process which waits while it writes a result."""
    started = []

    def start(kind, path):
        process = subprocess.Popen([sys.executable, '-c', WRITER, kind, str(path)],
                                   stdout=subprocess.PIPE, text=True)
        started.append(process)
        assert process.stdout.readline() == 'ready\n'
        return process

    yield start
    for process in started:
        process.kill()
        process.wait()
        process.stdout.close()


def names_in(folder):
    """Return the names of what is in a folder, hidden ones included."""
    return sorted(path.name for path in folder.iterdir())


KINDS = 'folder', 'file', 'claim'


@pytest.mark.parametrize('number', [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
@pytest.mark.parametrize('kind', KINDS)
def test_a_signal_leaves_nothing_unfinished(tmp_path, writing, kind, number):
    process = writing(kind, tmp_path / 'result')
    process.send_signal(number)
    assert process.wait(60) == (130 if number == signal.SIGINT else 128 + number)
    assert names_in(tmp_path) == []


@pytest.mark.parametrize('kind', ['folder', 'file'])
@pytest.mark.parametrize('next_name', ['result', 'another'])
def test_what_a_killed_process_left_is_removed_at_the_next_run(tmp_path, writing, kind, next_name):
    process = writing(kind, tmp_path / 'result')
    process.kill()
    process.wait()
    left, = tmp_path.iterdir()
    assert left.name.startswith(atomic.ROOM)
    with folder_written_whole(tmp_path / next_name) as unfinished:
        unfinished.mkdir()
    assert names_in(tmp_path) == [next_name]


def test_the_room_of_a_living_process_stays(tmp_path, writing):
    writing('folder', tmp_path / 'first')
    before = names_in(tmp_path)
    with folder_written_whole(tmp_path / 'second') as unfinished:
        unfinished.mkdir()
    assert names_in(tmp_path) == sorted([*before, 'second'])


def test_the_old_result_comes_back_after_a_kill_between_the_two_renames(tmp_path):
    room = tmp_path / f'{atomic.ROOM}x'
    (room / 'old' / 'result').mkdir(parents=True)
    (room / 'old' / 'result' / 'a.txt').write_text('old')
    (room / 'new' / 'result').mkdir(parents=True)
    with folder_written_whole(tmp_path / 'another') as unfinished:
        unfinished.mkdir()
    assert (tmp_path / 'result' / 'a.txt').read_text() == 'old'
    assert names_in(tmp_path) == ['another', 'result']


def test_foreign_hidden_folders_are_never_swept(tmp_path):
    for name in ('.result.backup', '.git', '.color_stereo'):
        (tmp_path / name).mkdir()
    (tmp_path / 'thesis').mkdir()
    (tmp_path / f'{atomic.ROOM}link').symlink_to(tmp_path / 'thesis')
    before = names_in(tmp_path)
    with folder_written_whole(tmp_path / 'result') as unfinished:
        unfinished.mkdir()
    assert names_in(tmp_path) == sorted([*before, 'result'])


def test_of_two_processes_that_write_one_folder_the_second_refuses(tmp_path, writing):
    writing('folder', tmp_path / 'result')
    with pytest.raises(RecordingError, match='result: another process is writing it'):
        with folder_written_whole(tmp_path / 'result', replace=True):
            pass


def test_of_two_processes_that_fill_one_folder_the_second_refuses(tmp_path, writing, capsys):
    process = writing('claim', tmp_path / 'result')
    with pytest.raises(RecordingError, match='another process is writing into it'):
        with claimed(tmp_path / 'result', 'test', ['a.txt'], overwrite=True):
            pass
    process.kill()
    process.wait()
    with claimed(tmp_path / 'result', 'test', ['a.txt']):
        pass


def test_a_lock_that_a_shell_holds_on_the_folder_above_is_no_obstacle(tmp_path, monkeypatch):
    monkeypatch.setattr(atomic, 'PATIENCE', 0.05)
    holder = atomic.open_and_lock(tmp_path)  # as `flock FOLDER color_stereo ...` does
    write_text(tmp_path / 'a.txt', 'text')
    os.close(holder)
    assert names_in(tmp_path) == ['a.txt']


def test_a_file_that_another_one_wrote_in_the_meantime_is_not_replaced(tmp_path):
    path = tmp_path / 'a.txt'
    with pytest.raises(RecordingError, match='exists already; --overwrite replaces it'):
        with written_whole(path, replace=False) as partial:
            partial.write_text('mine')
            path.write_text('theirs')
    assert path.read_text() == 'theirs' and names_in(tmp_path) == ['a.txt']


def test_a_link_that_leads_nowhere_is_not_replaced_unasked(tmp_path):
    (tmp_path / 'a.txt').symlink_to(tmp_path / 'nowhere')
    with pytest.raises(RecordingError, match='exists already'):
        write_text(tmp_path / 'a.txt', 'text', replace=False)


def process_words(output, *more):
    """Return the words of `color_stereo process` for a small scene."""
    files = [str(SCENE / name) for name in ('left.png', 'right.png')]
    yamls = [str(SCENE / name) for name in ('left.yaml', 'right.yaml')]
    return ['process', *files, '--calibration', *yamls, '--output', str(output), *more]


COMMANDS = {
    'pattern': (lambda folder: ['pattern', str(folder / 'p.png'), '--pattern.width', '64',
                                '--pattern.height', '16'], 'p.png'),
    'process': (process_words, 'points.ply'),
    'evaluate': (lambda folder: ['evaluate', str(SCENE), '--methods', 'bm', '--repeats', '1',
                                 '--output', str(folder)], 'figures.json'),
    'evaluate --json': (lambda folder: ['evaluate', str(SCENE), '--methods', 'bm', '--repeats',
                                        '1', '--json', str(folder / 'f.json')], 'f.json'),
    'sample': (lambda folder: ['sample', str(SCENE), str(folder)], 'settings.yaml'),
}


@pytest.mark.parametrize('name', COMMANDS)
def test_a_command_replaces_nothing_foreign_without_overwrite(tmp_path, capsys, name):
    words_in, file = COMMANDS[name]
    (tmp_path / file).write_text('thesis')
    words = words_in(tmp_path)
    assert cli.main(words) == cli.FAILURE
    said = capsys.readouterr().err
    assert str(tmp_path / file) in said and '--overwrite' in said and said.count('\n') == 1
    assert names_in(tmp_path) == [file] and (tmp_path / file).read_text() == 'thesis'
    assert cli.main([*words, '--overwrite']) == 0
    assert (tmp_path / file).read_bytes()[:6] != b'thesis'


def test_process_replaces_its_own_files_and_leaves_others_alone(tmp_path):
    output = tmp_path / 'out'
    assert cli.main(process_words(output)) == 0
    (output / 'notes.txt').write_text('mine')
    (output / 'points.ply').write_text('old')
    assert cli.main(process_words(output)) == 0
    assert (output / 'points.ply').read_bytes().startswith(b'ply')
    assert (output / 'notes.txt').read_text() == 'mine'


def test_the_folder_of_a_killed_run_is_known_as_its_own(tmp_path, writing):
    output = tmp_path / 'result'
    process = writing('claim', output)
    (output / 'a.txt').write_text('half of the result')
    process.kill()
    process.wait()
    with claimed(output, 'test', ['a.txt', 'b.txt']):
        pass
    with pytest.raises(RecordingError, match='a.txt: exists already'):
        with claimed(output, 'test', ['a.txt', 'b.txt']):
            pass
    assert names_in(output) == ['a.txt']


def test_a_failed_process_leaves_no_folder(tmp_path, capsys):
    words = process_words(tmp_path / 'out')
    words[1] = str(tmp_path / 'missing.png')
    assert cli.main(words) == cli.FAILURE
    assert names_in(tmp_path) == []


FULL = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))
from color_stereo_ros.cli import main as cli
sys.exit(cli.main(sys.argv[1:]))
"""


@pytest.mark.parametrize('name', ['pattern', 'process', 'convert', 'export', 'sample'])
def test_a_full_disk_names_the_result(tmp_path, name):
    sample = Path(__file__).parents[1] / 'sample' / 'solids_hue1'
    words, named = {
        'pattern': (['pattern', str(tmp_path / 'p.png')], tmp_path / 'p.png'),
        'process': (process_words(tmp_path), tmp_path / 'depth_mm.png'),
        'convert': (['convert', str(sample / 'recording'), str(tmp_path / 'r'), '--config',
                     str(sample / 'settings.yaml'), '--matching.method', 'paper'], tmp_path / 'r'),
        'export': (['export', str(sample / 'recording'), str(tmp_path), '--config',
                    str(sample / 'settings.yaml'), '--matching.method', 'paper', '--frames', '0',
                    '--products', 'png'], tmp_path / '1767225600.000000000_depth.png'),
        'sample': (['sample', str(SCENE), str(tmp_path / 's')], tmp_path / 's' / 'recording'),
    }[name]
    ran = subprocess.run([sys.executable, '-c', FULL, *words], capture_output=True, text=True,
                         check=False)
    assert ran.returncode == cli.FAILURE, ran.stderr
    assert ran.stderr.splitlines()[-1] == f'color_stereo: {named}: File too large'
    assert not named.exists()
    assert not [path for path in tmp_path.rglob('*') if path.name.startswith(atomic.ROOM)]

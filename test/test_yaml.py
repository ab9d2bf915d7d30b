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
"""YAML files: what no person wrote is refused at once, in one line."""

from pathlib import Path
import resource
import subprocess
import sys

from color_stereo_ros.cli import main as cli
from color_stereo_ros.core import Settings, SettingsError
from color_stereo_ros.files.yaml import about_number, load_yaml, parse_yaml, UnreadableError
import pytest
from scenes import SCENES

FLAT = SCENES / 'flat_350_hue1'
TENFOLD = ''.join(f'a{level}: &a{level} [{", ".join([f"*a{level - 1}"] * 10)}]\n'
                  for level in range(1, 12))
MASSES = {
    'references to references': 'a0: &a0 [x]\n' + TENFOLD,
    'merged references': 'a0: &a0 {x: 1}\n' + TENFOLD.replace('[', '{<<: [').replace(']', ']}'),
    'brackets': '[' * 20000,
    'closed brackets': '[' * 20000 + ']' * 20000,
    'mappings': '{a: ' * 20000,
    'mixed levels': '{[a, ' * 20000,
    'indented lists': '- ' * 20000,
    'complex keys': '? ' * 20000,
    'indented mappings': '\n'.join(' ' * level + 'a:' for level in range(1200)),
    'a list of itself': '&a [*a]',
    'a mapping of itself': 'a: &a\n  b: *a\n',
    'keys': '\n'.join(f'key_{index}: 1' for index in range(300_000)),
    'keys in one line': '{' + ', '.join(f'k{index}: 1' for index in range(60_000)) + '}',
    'a long file': '#' * 2_000_000,
    'an endless number': 'a: ' + '9' * 5000,
    'an impossible date': 'a: 2024-99-99',
    'a wrong kind of scalar': 'a: !!bool x',
    'a long tag': 'a: !' + 'x' * 100_000,
    'code': 'a: !!python/object/apply:os.system [x]',
    'several documents': 'a: 1\n---\na: 2\n'}


@pytest.mark.parametrize('kind', MASSES)
@pytest.mark.parametrize('use', ['calibration', 'settings'])
def test_what_no_person_wrote_is_refused_in_one_line(tmp_path, capfd, kind, use):
    path = tmp_path / 'odd.yaml'
    path.write_text(MASSES[kind])
    words = ['process', FLAT / 'left.png', FLAT / 'right.png', '--output', tmp_path / 'out']
    words += ['--calibration', path if use == 'calibration' else FLAT / 'left.yaml',
              FLAT / 'right.yaml']
    if use == 'settings':
        words += ['--config', path]
    assert cli.main([str(word) for word in words]) == {'calibration': 1, 'settings': 2}[use]
    said = capfd.readouterr().err
    assert 'odd.yaml' in said and said.count('\n') == 1 and len(said) < 400, said
    assert 'Traceback' not in said and 'Error' not in said


def test_no_file_takes_much_memory(tmp_path):
    for index, text in enumerate(MASSES.values()):
        (tmp_path / f'{index}.yaml').write_text(text)
    code = ('import sys\nfrom pathlib import Path\n'
            'from color_stereo_ros.files.yaml import load_yaml, UnreadableError\n'
            'for path in Path(sys.argv[1]).iterdir():\n'
            '    try:\n        load_yaml(path)\n    except UnreadableError:\n        pass\n'
            '    else:\n        raise SystemExit(str(path))\n')

    def limit():
        resource.setrlimit(resource.RLIMIT_DATA, (100_000_000, 100_000_000))

    subprocess.run([sys.executable, '-c', code, str(tmp_path)], check=True, preexec_fn=limit)


@pytest.mark.parametrize('text, words', [
    ('a: 1\nb: 2\na: 3\n', "has the key 'a' twice, see line 3"),
    ('{a: 1, b: {c: 1, c: 1}}', "has the key 'c' twice, see line 1")])
def test_a_key_that_is_there_twice_is_named_with_its_line(text, words):
    with pytest.raises(UnreadableError, match=words):
        parse_yaml(text)


def test_references_and_merged_mappings_of_a_person_are_read():
    text = 'base: &base {x: 1, y: 2}\nnear: {<<: *base, x: 3}\nfar: *base\n---\n'
    assert parse_yaml(text) == {
        'base': {'x': 1, 'y': 2}, 'near': {'x': 3, 'y': 2}, 'far': {'x': 1, 'y': 2}}


def test_a_file_of_the_usual_size_is_read(tmp_path):
    path = tmp_path / 'long.yaml'
    path.write_text('path:\n' + '- {position: [0, 0, 0.1], rotation: [0, 10, 0]}\n' * 500)
    assert len(load_yaml(path)['path']) == 500


def test_a_device_is_not_read_to_its_end():
    with pytest.raises(UnreadableError, match='has more than 1000000 bytes'):
        load_yaml(Path('/dev/zero'))


@pytest.mark.parametrize('value, written', [
    ('1e-1', '1.0e-1'), ('5e2', '5.0e+2'), ('1.5e3', '1.5e+3'), ('-2e-3', '-2.0e-3')])
def test_a_number_that_yaml_takes_for_a_text_is_said_with_its_right_form(value, written):
    assert parse_yaml(f'a: {value}') == {'a': value}
    assert parse_yaml(f'a: {written}') == {'a': float(value)}
    with pytest.raises(SettingsError, match=r'range.min_depth = .* is a str, expected float: '
                       f'YAML 1.1 takes {value} for a text, write {written}'.replace('+', '[+]')):
        Settings().updated({'range.min_depth': value})


@pytest.mark.parametrize('value', ['near', '1.2.3e4', '', 1e-1, None])
def test_other_values_get_no_such_hint(value):
    assert about_number(value) == ''


def test_an_endless_number_is_outside_the_range():
    with pytest.raises(SettingsError, match='range.min_depth = inf m is outside'):
        Settings().updated({'range.min_depth': 10 ** 400})

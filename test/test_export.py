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
"""`color_stereo export`: files for other programs hold what was measured, under true names."""

import struct

from color_stereo_ros.cli import main as cli
from color_stereo_ros.core import ImageError, RecordingError, SettingsError
from color_stereo_ros.core.false_color import false_color
from color_stereo_ros.files.camera_info import read_camera_info
from color_stereo_ros.files.film import film
from color_stereo_ros.messages.outputs import counted
from color_stereo_ros.recordings import tasks
from color_stereo_ros.recordings.exporting import chosen_frames, Export, stems, Wanted
from color_stereo_ros.recordings.products import PRODUCTS
from color_stereo_ros.recordings.reading import Recording
from color_stereo_ros.recordings.writing import write_recording
import cv2
import numpy as np
import projected
import pytest
from scenes import hue_pair, parallel_rig
from test_convert_tasks import COUNT, few, lit, PAPER, SECOND, surface_options  # noqa: F401

STAMP = 1_712_345_678_123_456_789
HEIGHT, WIDTH = 24, 64
KINDS = {'float': 'f', 'uchar': 'B'}


@pytest.fixture(scope='module')
def cards(tmp_path_factory):
    """Return a recording of small pairs of planes, each at another depth."""
    path = tmp_path_factory.mktemp('export') / 'cards'
    with write_recording(path) as writer:
        for index in range(4):
            writer.write_pair(STAMP + index * SECOND, *hue_pair(7 + index), parallel_rig())
    return path


@pytest.fixture(scope='module')
def exported(cards, tmp_path_factory):
    """Return a folder with every product of two pairs."""
    folder = tmp_path_factory.mktemp('export') / 'out'
    assert cli.main(['export', str(cards), str(folder), *PAPER, '--frames', '0,3', '--depth-scale',
                     '10000', '--products', *PRODUCTS]) == 0
    return folder


def named(folder, ending, index=0):
    """Return a file of a pair."""
    return folder / f'{1712345678 + index}.123456789_{ending}'


def values(folder, index=0):
    """Return what the NumPy file of a pair holds."""
    with np.load(named(folder, 'result.npz', index)) as found:
        return dict(found)


def read_ply(path):
    """Return header lines and a dict of columns of a binary PLY file."""
    head, _, body = path.read_bytes().partition(b'end_header\n')
    lines = head.decode('ascii').splitlines()
    assert lines[:2] == ['ply', 'format binary_little_endian 1.0']
    count, = (int(line.split()[2]) for line in lines if line.startswith('element vertex'))
    columns = [line.split()[1:] for line in lines if line.startswith('property')]
    record = struct.Struct('<' + ''.join(KINDS[kind] for kind, _ in columns))
    assert len(body) == count * record.size
    rows = list(record.iter_unpack(body))
    return lines, {name: np.array([row[place] for row in rows])
                   for place, (_, name) in enumerate(columns)}


def read_pcd(path):
    """Return the header as a dict of words, and a dict of columns of a binary PCD file."""
    head, _, body = path.read_bytes().partition(b'DATA binary\n')
    header = {words[0]: words[1:] for line in head.decode('ascii').splitlines()
              if (words := line.split())[0] != '#'}
    assert set(header['SIZE']) == {'4'} and set(header['COUNT']) == {'1'}
    count = int(header['POINTS'][0])
    assert count == int(header['WIDTH'][0]) * int(header['HEIGHT'][0])
    codes = ''.join({'F': 'f', 'U': 'I'}[kind] for kind in header['TYPE'])
    rows = list(struct.iter_unpack(f'<{codes}', body))
    assert len(rows) == count
    return header, {name: np.array([row[place] for row in rows])
                    for place, name in enumerate(header['FIELDS'])}


def test_names_carry_the_stamp_and_nothing_else_is_there(exported):
    single = [item.ending for _, item in PRODUCTS.items() if not item.film]
    expected = {named(exported, ending, index).name for ending in single for index in (0, 3)}
    assert {path.name for path in exported.iterdir()} == expected | {'range_image.mp4'}
    assert len(set(single)) == len(single)


def test_the_numpy_file_holds_the_measurement(exported):
    found = values(exported)
    assert found['stamp'] == STAMP and str(found['frame_id']) == 'left_camera_optical_frame'
    assert found['depth'].shape == (HEIGHT, WIDTH) and found['color'].shape == (HEIGHT, WIDTH, 3)
    known = np.isfinite(found['depth'])
    assert known.mean() > 0.5
    # focal length 80 px, baseline 0.1 m, disparity 7 px, and 10 px in the last pair
    assert np.median(found['depth'][known]) == pytest.approx(8 / 7, rel=0.01)
    assert np.nanmedian(values(exported, 3)['depth']) == pytest.approx(0.8, rel=0.01)
    np.testing.assert_array_equal(known, found['status'] == 0)
    np.testing.assert_allclose(found['K'], [[80, 0, 31.5], [0, 80, 11.5], [0, 0, 1]])


def points_of(found):
    """Return the points of a NumPy file by the pinhole model, float64 (H, W, 3)."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    K, depth = found['K'], found['depth'].astype(float)
    return np.stack([(columns - K[0, 2]) / K[0, 0] * depth, (rows - K[1, 2]) / K[1, 1] * depth,
                     depth], axis=2)


def check_columns(columns, found, chosen, normals):
    """Assert that the columns of a cloud are the chosen pixels of a NumPy file."""
    for axis, name in enumerate('xyz'):
        np.testing.assert_allclose(columns[name], points_of(found)[..., axis][chosen], rtol=1e-6,
                                   atol=1e-7)
    for axis, name in enumerate(normals):
        np.testing.assert_array_equal(columns[name].astype(np.float32),
                                      found['normals'][..., axis][chosen])
    for name in ('confidence', 'depth_std'):
        np.testing.assert_array_equal(columns[name].astype(np.float32), found[name][chosen])


@pytest.mark.parametrize('organized', [False, True])
def test_a_ply_file_holds_points_normals_colors_and_certainty(exported, organized):
    found = values(exported)
    lines, columns = read_ply(named(exported, 'organized.ply' if organized else 'points.ply'))
    known = np.isfinite(found['depth'])
    chosen = np.ones_like(known) if organized else known
    assert ('obj_info num_cols 64' in lines) == ('obj_info num_rows 24' in lines) == organized
    assert list(columns) == ['x', 'y', 'z', 'nx', 'ny', 'nz', 'red', 'green', 'blue',
                             'confidence', 'depth_std']
    check_columns(columns, found, chosen, ('nx', 'ny', 'nz'))
    for channel, name in enumerate(('red', 'green', 'blue')):
        np.testing.assert_array_equal(columns[name], found['color'][..., channel][chosen])
    np.testing.assert_array_equal(np.isnan(columns['z']), ~known[chosen])


@pytest.mark.parametrize('organized', [False, True])
def test_a_pcd_file_holds_the_same(exported, organized):
    found = values(exported)
    header, columns = read_pcd(named(exported, 'organized.pcd' if organized else 'points.pcd'))
    known = np.isfinite(found['depth'])
    chosen = np.ones_like(known) if organized else known
    size = [str(WIDTH), str(HEIGHT)] if organized else [str(known.sum()), '1']
    assert header['WIDTH'] + header['HEIGHT'] == size and header['VERSION'] == ['0.7']
    normals = ('normal_x', 'normal_y', 'normal_z')
    assert list(columns) == ['x', 'y', 'z', 'rgb', *normals, 'confidence', 'depth_std']
    check_columns(columns, found, chosen, normals)
    red, green, blue = np.moveaxis(found['color'][chosen].astype(int), -1, 0)
    np.testing.assert_array_equal(columns['rgb'], red << 16 | green << 8 | blue)
    np.testing.assert_array_equal(np.isnan(columns['x']), ~known[chosen])


def read(path):
    """Return an image file as it is, colors in RGB."""
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    return image[..., ::-1] if image.ndim == 3 else image


def test_images_hold_depth_certainty_and_colors(exported):
    found = values(exported)
    depth = read(named(exported, 'depth.tiff'))
    assert depth.dtype == np.float32
    np.testing.assert_array_equal(depth, found['depth'])
    np.testing.assert_array_equal(read(named(exported, 'depth_std.tiff')), found['depth_std'])
    tenths = read(named(exported, 'depth.png'))
    assert tenths.dtype == np.uint16
    np.testing.assert_allclose(tenths, np.nan_to_num(found['depth']) * 1e4, atol=0.51)
    np.testing.assert_array_equal(tenths == 0, np.isnan(found['depth']))
    np.testing.assert_array_equal(read(named(exported, 'color.png')), found['color'])
    np.testing.assert_allclose(read(named(exported, 'confidence.png')) / 255,
                               found['confidence'], atol=0.002)


def test_pictures_for_people_keep_the_pixels_and_add_a_legend(exported):
    found = values(exported)
    picture = read(named(exported, 'range_image.png'))
    np.testing.assert_array_equal(picture[:, :WIDTH], false_color(found['depth'], 0.4, 3.0))
    status = read(named(exported, 'status.png'))
    assert picture.shape[1] > WIDTH and status.shape[1] > WIDTH
    light = (status[:, :WIDTH] == 235).all(axis=2)
    np.testing.assert_array_equal(light, found['status'] == 0)


def test_the_camera_of_the_images_can_be_read_by_ros(exported):
    fields = read_camera_info(named(exported, 'camera.yaml'))
    assert (fields['width'], fields['height']) == (WIDTH, HEIGHT)
    np.testing.assert_allclose(np.reshape(fields['K'], (3, 3)), values(exported)['K'])


def frames_of(path):
    """Return the frames of a film in RGB, and how many it has a second."""
    reader = cv2.VideoCapture(str(path))
    frames = []
    while (found := reader.read())[0]:
        frames.append(found[1][..., ::-1])
    return frames, reader.get(cv2.CAP_PROP_FPS)


def test_the_film_shows_all_chosen_pairs_with_fixed_limits(exported):
    frames, rate = frames_of(exported / 'range_image.mp4')
    assert len(frames) == 2 and rate == pytest.approx(1 / 3, abs=1e-3)
    for frame, index in zip(frames, (0, 3)):
        found = values(exported, index)
        inner = cv2.erode(np.isfinite(found['depth']).astype(np.uint8), np.ones((9, 9))) > 0
        expected = false_color(found['depth'], 0.4, 3.0)
        assert inner.any() and frame.shape[0] == HEIGHT and frame.shape[1] % 2 == 0
        # MPEG-4 keeps colors of areas to some levels
        error = np.abs(frame[:, :WIDTH].astype(int) - expected)[inner]
        assert np.median(error) < 8


def test_odd_sizes_and_rates_are_filmed_and_other_sizes_refused(tmp_path):
    picture = np.full((25, 33, 3), (200, 120, 40), np.uint8)
    with film(tmp_path / 'a.mp4', 12.5) as add:
        for _ in range(3):
            add(picture)
    frames, rate = frames_of(tmp_path / 'a.mp4')
    assert len(frames) == 3 and rate == pytest.approx(12.5) and frames[0].shape == (26, 34, 3)
    with pytest.raises(ImageError, match='picture of 32 x 25 px does not fit behind those of 33'):
        with film(tmp_path / 'b.mp4', 1.0) as add:
            add(picture)
            add(picture[:, 1:])
    with pytest.raises(RecordingError, match='there is no picture for it'):
        with film(tmp_path / 'c.mp4', 1.0):
            pass
    assert [path.name for path in tmp_path.iterdir()] == ['a.mp4']


def test_unknown_and_far_depths_have_no_number():
    depth = np.array([[np.nan, 0.001, 6.5535, 6.6]], np.float32)
    np.testing.assert_array_equal(counted(depth, 1e4), [[0, 10, 65535, 0]])


@pytest.mark.parametrize('text, expected', [
    ('', [0, 1, 2, 3, 4, 5, 6]), ('0', [0]), ('-1,0', [0, 6]), ('2:4', [2, 3]), ('5:', [5, 6]),
    (':3', [0, 1, 2]), ('1:6:2, 3', [1, 3, 5]), ('-2:', [5, 6]), ('4:100', [4, 5, 6])])
def test_frames_are_chosen_as_python_slices(text, expected):
    assert chosen_frames(text, 7) == expected


@pytest.mark.parametrize('text, said', [
    ('7', 'there is no pair 7, the recording has 7: 0 .. 6'), ('-8', 'there is no pair -8'),
    ('a', "'a' is no index and no slice"), ('1,', "'' is no index"),
    ('9:', 'names none of the 7 pairs'), ('::0', 'a step of 0'), ('0:3:-1', 'no slice')])
def test_impossible_frames_are_refused(text, said):
    with pytest.raises(SettingsError, match=said):
        chosen_frames(text, 7)


def test_pairs_of_one_stamp_have_different_names():
    rows = np.zeros(4, tasks.ROW)
    rows['left_stamp'] = [0, 5, 5, 5]
    assert stems(rows) == ['0.000000000', '0.000000005', '0.000000005_2', '0.000000005_3']


@pytest.mark.processes
def test_a_pair_is_measured_as_convert_measures_it(tmp_path, lit, few):  # noqa: F811
    assert cli.main(['convert', str(lit), str(tmp_path / 'converted'), *surface_options(),
                     '--topics', 'depth/image', '--workers', '1']) == 0
    assert cli.main(['export', str(lit), str(tmp_path / 'out'), *surface_options(),
                     '--frames', '3,4', '--products', 'npz']) == 0
    with Recording(tmp_path / 'converted') as recording:
        depths = {message.time_ns: recording.decoded(message).data.tobytes()
                  for message in recording.messages(['/depth/image'])}
    assert len(depths) == COUNT
    for index in (3, 4):
        with np.load(tmp_path / 'out' / f'{1 + index}.000000000_result.npz') as found:
            assert found['depth'].tobytes() == depths[(1 + index) * SECOND]
            assert found['color'].shape == projected.pair(noise=1)[0].shape


@pytest.mark.processes
def test_several_processes_write_the_same_files(tmp_path, cards, few):  # noqa: F811
    for name, workers in (('one', '1'), ('two', '2')):
        assert cli.main(['export', str(cards), str(tmp_path / name), *PAPER, '--workers', workers,
                         '--products', *PRODUCTS]) == 0
    one, two = ({path.name: path for path in (tmp_path / name).iterdir()}
                for name in ('one', 'two'))
    assert set(one) == set(two) and len(one) == 4 * (len(PRODUCTS) - 1) + 1
    assert [name for name in one if contents(one[name]) != contents(two[name])] == []


def contents(path):
    """Return what a file holds; an archive notes when it was made."""
    if path.suffix == '.npz':
        with np.load(path) as found:
            return {name: found[name].tobytes() for name in found}
    return path.read_bytes()


def test_only_tasks_with_chosen_pairs_are_measured_and_up_to_these(
        cards, few, tmp_path):  # noqa: F811
    from color_stereo_ros.parameters.groups import RangeNodeSettings
    with Recording(cards) as recording:
        export = Export(recording, tmp_path, recording.stereo_topics(), RangeNodeSettings(),
                        Wanted(frames='2'))
        export.pair(print)
        task, = export.tasks()
    assert task.names == {0: '1712345680.123456789'} and len(task.rows) == export.pairs == 1
    assert len(task.warm_up) == 1 and len(task.settling) == 2


def test_points_turn_with_output_frame_and_leave_a_region_out(tmp_path, cards):
    words = ['export', str(cards), str(tmp_path / 'out'), *PAPER, '--frames', '0', '--products',
             'ply', 'npz', '--output.region', '-inf inf -inf 0 -inf inf']
    assert cli.main(words) == 0
    _, columns = read_ply(named(tmp_path / 'out', 'points.ply'))
    assert columns['y'].max() <= 0 and len(columns['y'])
    assert np.isnan(values(tmp_path / 'out')['depth'][HEIGHT // 2:]).all()


def test_foreign_files_stay_and_own_ones_are_replaced(tmp_path, cards, capsys):
    words = ['export', str(cards), str(tmp_path), *PAPER, '--frames', '0', '--products', 'tiff',
             'status']
    foreign = named(tmp_path, 'depth.tiff')
    foreign.write_text('thesis')
    assert cli.main(words) == 1
    assert 'is not of an earlier `color_stereo export`; --overwrite' in capsys.readouterr().err
    assert foreign.read_text() == 'thesis' and len(list(tmp_path.iterdir())) == 1
    assert cli.main([*words, '--overwrite']) == 0
    assert cli.main(words) == 0
    assert len(list(tmp_path.iterdir())) == 2 and read(foreign).dtype == np.float32
    assert '2 files of 1 pairs, 0 refused; the recording has 4 pairs' in capsys.readouterr().out


def test_a_refused_pair_has_no_files_and_the_status_tells(tmp_path, capsys):
    with write_recording(tmp_path / 'recorded') as writer:
        writer.write_pair(SECOND, *hue_pair(8), parallel_rig())
        small = [image[:, :-2].copy() for image in hue_pair(8)]
        writer.write_pair(2 * SECOND, *small, parallel_rig())
    words = ['export', str(tmp_path / 'recorded'), str(tmp_path / 'out'), *PAPER, '--products',
             'tiff']
    assert cli.main(words) == cli.PARTLY
    assert '1 pairs refused' in capsys.readouterr().err
    assert [path.name for path in (tmp_path / 'out').iterdir()] == ['1.000000000_depth.tiff']
    assert cli.main([*words[:2], str(tmp_path / 'none'), *words[3:], 'mp4', '--frames', '1']) == 1
    assert 'no pair could be measured: all 1 pairs' in capsys.readouterr().err
    assert not (tmp_path / 'none').exists()


@pytest.mark.parametrize('words, said', [
    (['--depth-scale', '0'], '--depth-scale 0: expected a number above 0'),
    (['--fps', '1000'], '--fps 1000: expected 0.1 .. 120'),
    (['--frames', '4'], 'there is no pair 4, the recording has 4: 0 .. 3')])
def test_impossible_wishes_are_refused(tmp_path, cards, capsys, words, said):
    assert cli.main(['export', str(cards), str(tmp_path / 'out'), *PAPER, *words]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / 'out').exists()


def test_a_recording_of_results_asks_for_the_images(tmp_path, cards, capsys):
    assert cli.main(['convert', str(cards), str(tmp_path / 'results'), *PAPER, '--workers',
                     '1']) == 0
    assert cli.main(['export', str(tmp_path / 'results'), str(tmp_path / 'out')]) == 1
    assert 'name the recording of the images they were made from' in capsys.readouterr().err

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
"""What the page of `color_stereo view` computes: places, distances, planes, words, cost curves."""

import sys
from types import SimpleNamespace

from color_stereo_ros.cli import main as cli
from color_stereo_ros.cli.demo import somebody_sits_there
from color_stereo_ros.cli.process import SAMPLE
from color_stereo_ros.core import ColorStereo, SettingsError, StereoCalibration
from color_stereo_ros.core.settings import updated
from color_stereo_ros.files.image import write_image
from color_stereo_ros.parameters.groups import RangeNodeSettings
from color_stereo_ros.viewer.frame import Frame
from color_stereo_ros.viewer.measuring import (
    distance, fitted_plane, inside_box, inside_polygon, point_on_ray)
from color_stereo_ros.viewer.page import patch
from color_stereo_ros.viewer.pictures import (
    legends_of, NAMES, pattern_colors, pictures_of, POINT_COLORS)
from color_stereo_ros.viewer.sources import FileFrames
from color_stereo_ros.viewer.telling import about_frame, about_pixel
from color_stereo_ros.viewer.wall import Wall
import numpy as np
import pytest
from scenes import hue_pair, paper_settings, parallel_rig
from surface_pairs import plane_pair, rig, surface_settings


@pytest.fixture(scope='module')
def frame():
    """Return a measured plane with a disparity of 8 px."""
    left, right = hue_pair(8)
    calibration = parallel_rig()
    result = ColorStereo(calibration, paper_settings()).process(left, right)
    return Frame('plane', result, calibration, left, right)


def test_pixels_find_their_match_and_the_way_back(frame):
    x, y = frame.match(40, 12)
    assert (x, y) == pytest.approx((32, 12), abs=0.2)
    assert frame.left_pixel(x, y) == (40, 12)
    assert frame.left_pixel(-30, 12) is None


def test_raw_places_follow_the_lens_and_come_back():
    calibration = StereoCalibration.from_yaml(SAMPLE / 'left.yaml', SAMPLE / 'right.yaml')
    frame = Frame('', SimpleNamespace(geometry=calibration.geometry, health=None), calibration)
    for side in (0, 1):
        for pixel in ((100, 80), (400, 300)):
            place = frame.raw_place(side, *pixel)
            assert np.hypot(*np.subtract(place, pixel)) > 0.2
            assert frame.rectified_pixel(side, *place) == pixel
    halves = [frame.raw_place(0, x, 200) for x in (100, 100.5, 101)]
    np.testing.assert_allclose(halves[1], np.mean([halves[0], halves[2]], axis=0))
    rectified = Frame('', frame.result, calibration, rectified_input=True)
    assert rectified.raw_place(1, 20.5, 30) == (20.5, 30)
    assert rectified.rectified_pixel(0, 20.4, 30) == (20, 30)


def test_the_wall_finds_the_pixel_that_it_shows(frame):
    wall = Wall(frame.result.geometry, 1.0)
    for name in NAMES:
        spot = wall.spot(name, 20, 7)
        origin = np.array([0.3, -0.2, -0.5])
        hit = wall.pixel_of(origin, spot - origin)
        assert hit[0] == name and hit[1:] == pytest.approx((20, 7))
    assert wall.pixel_of((0, 0, 0), (0, 0, 1)) is None  # the points are in the middle
    assert wall.pixel_of((0, 0, 2), (0, 0, 1)) is None  # nothing is behind


def test_a_camera_sees_all_that_it_is_to_look_at(frame):
    wall = Wall(frame.result.geometry, 1.0)
    for aspect in (0.8, 2.5):
        position, look_at = wall.camera('all', aspect)
        camera = SimpleNamespace(position=position, rotation=np.eye(3), aspect=aspect,
                                 fov=np.radians(50))
        corners = np.array([wall.spot(name, x, y) for name in NAMES for x in (0, 63)
                            for y in (0, 23)])
        assert inside_box(corners, camera, (0, 0), (1, 1)).all()
        assert look_at[2] == 1.0 and position[2] < 1.0


def test_the_point_under_the_mouse_is_the_front_one():
    points = np.full((4, 5, 3), np.nan, np.float32)
    points[2, 3] = 0.1, 0.0, 1.0
    points[1, 1] = 0.2, 0.0, 2.0  # behind it
    points[0, 0] = 0.3, 0.0, 1.0  # beside it
    assert point_on_ray(points, (0, 0, 0), (0.1, 0, 1)) == (3, 2)
    assert point_on_ray(points, (0, 0, 0), (-0.1, 0, 1)) is None
    assert point_on_ray(points, (0, 0, 0), (-0.1, 0, -1)) is None


def test_distances_carry_the_errors_of_both_depths():
    points = np.zeros((1, 3, 3), np.float32)
    points[0] = (0, 0, 1.0), (0, 0, 1.5), (0.3, 0, 1.0)
    result = SimpleNamespace(depth_std=np.array([[3e-3, 4e-3, 0.0]]))
    along = distance(result, points, (0, 0), (1, 0))
    assert (along.value, along.std) == pytest.approx((0.5, 5e-3))
    across = distance(result, points, (0, 0), (2, 0))
    assert (across.value, across.std) == pytest.approx((0.3, 0.0), abs=1e-7)


def test_a_plane_has_the_tilt_and_the_scatter_it_was_made_with():
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-0.1, 0.1, (2, 5000))
    slope = np.tan(np.radians(30.0))
    points = np.column_stack([x, y, 0.5 + slope * x])
    points += rng.normal(0, 1e-4, (5000, 1)) * [np.sin(np.radians(30)), 0,
                                                -np.cos(np.radians(30))]
    plane = fitted_plane(points)
    assert plane.tilt == pytest.approx(30.0, abs=0.05)
    assert plane.rms == pytest.approx(1e-4, rel=0.05)
    assert plane.normal[2] < 0 and plane.count == 5000
    with pytest.raises(SettingsError, match='9 points have a range there'):
        fitted_plane(points[:9])


def test_a_polygon_holds_what_lies_within_its_corners():
    inside = inside_polygon([(2, 1), (6, 1), (2, 5)], (9, 7))
    assert inside.shape == (7, 9)
    expected = [(column, row) for row in range(7) for column in range(9)
                if row >= 1 and column >= 2 and column + row <= 7]
    assert [tuple(place) for place in np.argwhere(inside)[:, ::-1]] == expected


def test_every_picture_and_every_color_of_points_is_drawn(frame):
    pictures = pictures_of(frame, 2)
    assert list(pictures) and set(pictures) == set(NAMES)
    assert {image.shape for _, image in pictures.values()} == {(12, 32, 3)}
    assert {image.dtype for _, image in pictures.values()} == {np.dtype(np.uint8)}
    for colors in POINT_COLORS.values():
        assert colors(frame).shape == (24, 64, 3) and colors(frame).dtype == np.uint8
    assert set(legends_of(frame)) == {'depth', 'status', 'views'}
    unseen = Frame('', frame.result, frame.calibration)
    assert set(NAMES) - set(pictures_of(unseen)) == {'left', 'right'}


def test_the_colors_of_the_pattern_have_no_brightness():
    image = np.array([[[200, 100, 50], [80, 40, 20], [4, 2, 1]]], np.uint8)
    colors = pattern_colors(image)[0]
    np.testing.assert_array_equal(colors[0], (255, 128, 64))
    np.testing.assert_array_equal(colors[1], (255, 128, 64))
    assert colors[2].max() < 50  # dark: no color is made of noise


def test_the_words_hold_what_is_known_of_a_pixel(frame):
    text = about_pixel(frame, 40, 12)
    assert '| left, rectified | column 40, row 12 |' in text
    assert 'right within 1 px' in text and 'the right camera' in text
    depth = 1e3 * frame.result.depth[12, 40]
    assert f'**{depth:.2f}** ±' in text
    row, column = np.argwhere(frame.result.status > 0)[0]
    assert 'none: **' in about_pixel(frame, int(column), int(row))
    assert '% of the pixels have a range' in about_frame(frame)


def test_a_patch_shows_the_place_in_its_middle():
    image = np.zeros((40, 60, 3), np.uint8)
    image[10, 20] = 255, 0, 0
    shown = patch(image, (20.0, 10.0))
    red = np.argwhere((shown == (255, 0, 0)).all(axis=2))
    np.testing.assert_allclose((red.min(axis=0) + red.max(axis=0)) / 2,
                               (np.array(shown.shape[:2]) - 1) / 2, atol=1)


def test_the_cost_curve_has_its_least_cost_at_the_disparity():
    width, height, disparity = 96, 72, 14.0
    images = plane_pair(width, height, disparity)
    calibration = rig(width, height)
    stereo = ColorStereo(calibration, surface_settings(4, 30))
    result = stereo.process(*images)
    curve = stereo.cost_curve(*images, (60, 36), result.alignment)
    step = np.diff(curve.disparity)
    assert (step == step[0]).all() and step[0] > 0
    for costs in (curve.window, curve.path):
        assert abs(curve.disparity[np.argmin(costs)] - disparity) <= step[0]
    assert curve.path.min() == 0 and 0 <= curve.window.min() and curve.window.max() <= 1
    # the search is repeated, what is measured stays
    again = stereo.process(*images, result.alignment, result.projector, result.health)
    np.testing.assert_array_equal(again.status, stereo.process(
        *images, result.alignment, result.projector, result.health).status)
    text = about_pixel(Frame('', result, calibration, *images), 60, 36, curve)
    assert '| coarse search |' in text and '| next best |' in text


def test_methods_without_a_coarse_search_have_no_curve():
    images = hue_pair(8)
    assert ColorStereo(parallel_rig(), paper_settings()).cost_curve(*images, (40, 12)) is None


def test_a_folder_of_images_is_measured_pair_by_pair(tmp_path):
    for number, disparity in ((1, 6), (2, 8)):
        for side, image in zip(('left', 'right'), hue_pair(disparity)):
            write_image(tmp_path / f'{side}_{number}.png', image)
    settings = updated(RangeNodeSettings(), {
        'matching.method': 'paper', 'pattern.type': 'sweep', 'range.max_depth': 3.0})
    frames = FileFrames.of_folder(tmp_path, parallel_rig(), settings)
    assert len(frames) == 2 and frames.name(1) == 'left_2, pair 1 of 2'
    medians = [np.nanmedian(frames.frame(index).result.disparity) for index in (1, 0)]
    assert medians == pytest.approx([8, 6], abs=0.1)
    assert frames.frame(0) is frames.frame(0)
    assert frames.curve(0, 40, 12) is None


@pytest.mark.parametrize('words, said', [
    ([], 'name one of a recording or folder, --sample and --live'),
    (['here', '--sample'], 'not a recording or folder and --sample'),
    (['--live', '--html', 'x.html'], 'record the topics first'),
    (['--sample', '--frames', '0'], '--frames chooses the pairs of --html FILE'),
    (['--sample', '--port', '70000'], 'outside 0 .. 65535')])
def test_command_lines_that_name_no_source_are_refused(words, said, capsys):
    assert cli.main(['view', *words]) == 2
    assert said in capsys.readouterr().err


def test_a_folder_without_a_calibration_says_what_it_lacks(tmp_path, capsys):
    assert cli.main(['view', str(tmp_path)]) == 1
    assert 'it lacks left.yaml and right.yaml' in capsys.readouterr().err


@pytest.mark.parametrize('terminals, environment, expected', [
    ((True, True), {}, True), ((False, True), {}, False), ((True, False), {}, False),
    ((True, True), {'CI': 'true'}, False)])
def test_a_demo_ends_in_the_viewer_where_somebody_sits(terminals, environment, expected,
                                                       monkeypatch):
    monkeypatch.delenv('CI', raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    for name, terminal in zip(('stdin', 'stdout'), terminals):
        monkeypatch.setattr(sys, name, SimpleNamespace(isatty=lambda terminal=terminal: terminal))
    assert somebody_sits_there() == expected


def test_a_file_that_is_there_is_replaced_only_when_asked(tmp_path, capsys):
    path = tmp_path / 'mine.html'
    path.write_text('mine', encoding='utf-8')
    assert cli.main(['view', '--sample', '--html', str(path)]) == 1
    assert '--overwrite replaces it' in capsys.readouterr().err
    assert path.read_text(encoding='utf-8') == 'mine'

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
"""A box and every second pixel: what is left is that of the whole result, bit for bit."""

from color_stereo_ros.core import ColorStereo, SettingsError
from color_stereo_ros.core.results import POINT_FIELDS
from color_stereo_ros.core.status import Status
from color_stereo_ros.messages.outputs import Context, OUTPUTS
from color_stereo_ros.messages.trimming import trimmed
from color_stereo_ros.parameters.groups import OutputSettings, RangeNodeSettings

import cv2
from known_results import HEADER, known_result
import numpy as np
import pytest
from surface_pairs import plane_pair, rig, surface_settings

ARRAYS = 'depth', 'disparity', 'disparity_std', 'confidence', 'status', 'views'
EXACT = 'depth', 'depth_std', 'confidence', 'status', 'views', 'image'
TURN = cv2.Rodrigues(np.array([0.05, -0.2, 0.02]))[0]
FIELDS = ' '.join(POINT_FIELDS)


def context(rotation=None, **settings):
    """Return a Context with some settings of the output."""
    more = {} if rotation is None else {'rotation': rotation}
    return Context(HEADER, RangeNodeSettings(output=OutputSettings(**settings)), **more)


@pytest.fixture(scope='module', params=[(96, 64), (95, 61)])
def result(request):
    """Return a measured result on a verged rig, of an even and of an odd size."""
    width, height = request.param
    stereo = ColorStereo(rig(width, height, 5.5), surface_settings(12, 40, 5.5))
    return stereo.process(*plane_pair(width, height, 24.0, 0.05, -0.04))


def same(first, second):
    """Tell whether two arrays hold the same bits."""
    return first.shape == second.shape and first.dtype == second.dtype and (
        np.ascontiguousarray(first).tobytes() == np.ascontiguousarray(second).tobytes())


def test_without_box_and_decimation_the_result_stays(result):
    assert trimmed(result, context()) is result


@pytest.mark.parametrize('step', [2, 4])
def test_decimated_arrays_are_a_subset_bit_for_bit(result, step):
    part = trimmed(result, context(decimation=step))
    for name in EXACT:
        assert same(getattr(part, name), getattr(result, name)[::step, ::step]), name
    assert same(part.normals(), result.normals()[::step, ::step])
    assert same(part.points(), result.points()[::step, ::step])
    for name in ('disparity', 'disparity_std'):
        assert same(getattr(part, name) * np.float32(step), getattr(result, name)[::step, ::step])
    assert np.isfinite(part.depth).any() and np.isfinite(part.normals()).any()


@pytest.mark.parametrize('frame', ['rectified', 'camera'])
@pytest.mark.parametrize('step', [2, 4])
def test_the_points_of_a_decimated_cloud_are_those_of_the_whole_one(result, step, frame):
    def points(**settings):
        used = context(TURN, frame=frame, point_fields=FIELDS, **settings)
        content = OUTPUTS['points'].content(trimmed(result, used), used)
        return np.frombuffer(content.data, np.uint8).reshape(content.height, content.width, 36)

    assert same(points(decimation=step), points()[::step, ::step])


@pytest.mark.parametrize('step', [2, 4])
def test_the_camera_info_of_decimated_pixels_gives_the_same_points(result, step):
    used = context(decimation=step)
    part = trimmed(result, used)
    info = OUTPUTS['depth/camera_info'].content(part, used)
    assert (info.height, info.width) == part.depth.shape == result.depth[::step, ::step].shape
    fx, cx, fy, cy = info.p[0], info.p[2], info.p[5], info.p[6]
    assert (info.k[0], info.k[2], info.k[4], info.k[5]) == (fx, cx, fy, cy)
    v, u = np.mgrid[:info.height, :info.width]
    z = part.depth.astype(np.float64)
    expected = np.stack([(u - cx) * z / fx, (v - cy) * z / fy, z], axis=-1)
    np.testing.assert_allclose(result.points()[::step, ::step], expected, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize('step', [2, 4])
def test_the_disparity_message_of_decimated_pixels_gives_the_same_depth(result, step):
    used = context(decimation=step)
    part = trimmed(result, used)
    msg = OUTPUTS['disparity'].content(part, used)
    pixels = np.frombuffer(msg.image.data, np.float32).reshape(msg.image.height, msg.image.width)
    known = pixels >= msg.min_disparity
    np.testing.assert_array_equal(known, np.isfinite(part.depth))
    np.testing.assert_allclose(msg.f * msg.t / pixels[known], part.depth[known], rtol=1e-6)
    assert msg.f == pytest.approx(result.geometry.focal_x / step)


@pytest.mark.parametrize('rotation, frame', [(None, 'rectified'), (TURN, 'rectified'),
                                             (TURN, 'camera')])
def test_outside_of_the_box_everything_is_unknown_and_inside_nothing_changes(
        result, rotation, frame):
    low = -0.05 if frame == 'rectified' else -0.4
    used = context(rotation, region=f'{low} inf -0.08 0.06 0 9', frame=frame)
    part = trimmed(result, used)
    cloud = OUTPUTS['points'].content(result, used)
    points = np.frombuffer(cloud.data, np.float32).reshape(*result.depth.shape, 4)
    low = np.float32(low)
    inside = (points[..., 0] >= low) & (points[..., 1] >= np.float32(-0.08)) & (
        points[..., 1] <= np.float32(0.06))
    known = np.isfinite(result.depth)
    assert 100 < (known & inside).sum() < known.sum() - 100
    for name in (*EXACT, 'disparity', 'disparity_std'):
        whole, cut = getattr(result, name), getattr(part, name)
        assert same(cut[inside | ~known], whole[inside | ~known]), name
    assert same(part.normals()[inside], result.normals()[inside])
    gone = known & ~inside
    for name in ('depth', 'disparity', 'disparity_std', 'depth_std'):
        assert np.isnan(getattr(part, name)[gone]).all()
    assert np.isnan(part.normals()[gone]).all() and np.isnan(part.points()[gone]).all()
    assert (part.status[gone] == Status.OUT_OF_RANGE).all()
    assert not part.confidence[gone].any() and not part.views[gone].any()
    assert part.depth.shape == result.depth.shape and same(part.image, result.image)


def test_both_at_once_are_the_subset_of_the_box(result):
    box = '-0.05 0.05 -1 1 0 9'
    cut = trimmed(result, context(region=box))
    both = trimmed(result, context(region=box, decimation=2))
    for name in EXACT:
        assert same(getattr(both, name), getattr(cut, name)[::2, ::2]), name
    assert same(both.normals(), cut.normals()[::2, ::2])


def test_the_whole_result_is_not_touched():
    result = known_result()
    before = {name: getattr(result, name).tobytes() for name in ARRAYS}
    part = trimmed(result, context(region='-0.01 0.01 -1 1 0 1', decimation=2))
    part.normals()
    assert {name: getattr(result, name).tobytes() for name in ARRAYS} == before
    assert np.isfinite(result.normals()).any()


def test_every_output_of_a_trimmed_result_has_its_size(result):
    used = context(decimation=2, region='-1 1 -1 1 0 2', point_fields=FIELDS)
    part = trimmed(result, used)
    for topic, output in OUTPUTS.items():
        content = output.content(part, used)
        content = getattr(content, 'image', content)
        if hasattr(content, 'height'):
            assert content.height == part.depth.shape[0], topic
            assert topic == 'status_picture' or content.width == part.depth.shape[1], topic


def test_optional_fields_lie_behind_the_others_in_their_fixed_order(result):
    names = 'depth_std confidence, normal_y'
    used = context(point_fields=names)
    msg = OUTPUTS['points'].content(result, used)
    plain = OUTPUTS['points'].content(result, context())
    assert [(field.name, field.offset, field.datatype, field.count) for field in msg.fields] == [
        (name, 4 * place, 7, 1) for place, name in enumerate(
            ('x', 'y', 'z', 'rgb', 'normal_y', 'confidence', 'depth_std'))]
    height, width = result.depth.shape
    assert (msg.point_step, msg.row_step) == (28, 28 * width)
    # sensor_msgs_py.point_cloud2: a record of the fields at their offsets, point_step apart
    records = np.frombuffer(msg.data, np.dtype({
        'names': [field.name for field in msg.fields], 'formats': ['<f4'] * 7,
        'offsets': [field.offset for field in msg.fields], 'itemsize': msg.point_step}))
    records = records.reshape(height, width)
    xyz = np.stack([records[name] for name in 'xyz'], axis=-1)
    assert same(xyz, result.points())
    assert same(records['rgb'], np.frombuffer(plain.data, np.float32).reshape(
        height, width, 4)[..., 3])
    assert same(records['normal_y'], result.normals()[..., 1])
    assert same(records['confidence'], result.confidence)
    assert same(records['depth_std'], result.depth_std)


def test_a_compact_cloud_has_the_optional_fields_of_the_known_points(result):
    whole = OUTPUTS['points'].content(result, context(point_fields=FIELDS))
    msg = OUTPUTS['points'].content(result, context(point_fields=FIELDS, compact_points=True))
    known = np.isfinite(result.depth)
    assert (msg.height, msg.width, msg.point_step) == (1, known.sum(), 36)
    points = np.frombuffer(whole.data, np.uint8).reshape(*known.shape, 36)
    assert same(np.frombuffer(msg.data, np.uint8).reshape(-1, 36), points[known])


@pytest.mark.parametrize('settings, words', [
    ({'decimation': 3}, 'output.decimation = 3, expected 1, 2 or 4'),
    ({'decimation': 5}, 'output.decimation = 5 is outside 1 .. 4'),
    ({'point_fields': 'confidence range_std'}, "'range_std' is not one of normal_x, normal_y"),
    ({'region': '0 1 0 1 0'}, 'is no box, expected x_min x_max'),
    ({'region': '0 1 0 1 1 0'}, 'each minimum below its maximum'),
    ({'region': '0 1 0 1 nan 1'}, 'is no box'), ({'region': 'near'}, "'near' is no box")])
def test_settings_that_say_nothing_are_refused(settings, words):
    with pytest.raises(SettingsError) as refused:
        OutputSettings(**settings)
    assert words in str(refused.value)

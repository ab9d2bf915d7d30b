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
"""The projector as a third view over real DDS: found beside the pairs, used, told, surviving."""

from color_stereo_ros.nodes.pattern_source import latched

from diagnostic_msgs.msg import DiagnosticStatus

import numpy as np

from projected import CALIBRATION, LIMITS, pair, PATTERN, projector, truth

import pytest

from ros_rig import answering, floats, image_message, values_of

from sensor_msgs.msg import CameraInfo, Image

FOCAL_BASELINE = CALIBRATION.geometry.focal_baseline
DISPARITY, LIT, VISIBLE = truth()
DEPTH = FOCAL_BASELINE / DISPARITY
TOPICS = {'depth/image': Image, 'views/image': Image, 'depth_std/image': Image,
          'confidence/image': Image}
LEFT = 'views/image'


@pytest.fixture(scope='module')
def running(tmp_path_factory):
    """Yield a rig under a projector, whose node has found it."""
    parameters = {
        'range.min_depth': FOCAL_BASELINE / LIMITS[1],
        'range.max_depth': FOCAL_BASELINE / LIMITS[0],
        'pattern.width': PATTERN.width, 'pattern.height': PATTERN.height,
        'pattern.feature_size': PATTERN.feature_size, 'output.diagnostics_period': 0.1,
        'sync.warn_after': 1.0, 'matching.third_view': 'automatic'}
    with answering(tmp_path_factory.mktemp('projector') / 'log.txt', parameters, {}, None) as rig:
        for topic, kind in TOPICS.items():
            rig.listen(kind, topic)
        rig.wait_for_publishers()
        rig.calibration = CALIBRATION
        rig.images = dict(zip(('left', 'right'), pair()))
        rig.feed(found, 'the projector')
        yield rig


@pytest.fixture
def rig(running):
    """Yield the rig with both cameras open, and the node as it was started."""
    running.images = dict(zip(('left', 'right'), pair()))
    running.set_parameters(input__survive_right_loss=False)
    running.feed(found, 'the projector')
    return running


def found(parts):
    """Return whether the diagnostics say that the projector is found."""
    text = values_of(parts['pattern']).get('projector', '')
    return text.startswith('projector found: 57 x 44 degrees, .06 m above the left camera')


def views_of(message):
    """Return the bits of a views/image."""
    assert message.encoding == 'mono8'
    return np.frombuffer(message.data, np.uint8).reshape(message.height, message.width)


def right_share(depth):
    """Return the share of the lit pixels whose depth is right within 1 %."""
    with np.errstate(invalid='ignore'):
        return np.mean((np.abs(depth / DEPTH - 1) < 0.01)[LIT])


def covered(rig):
    """Send a pair whose right camera is covered, and return its stamp."""
    black = image_message(np.full_like(rig.images['right'], 4))
    return rig.send_pair(right=black)


def test_the_third_view_fills_what_the_right_camera_does_not_see(rig):
    stamp = rig.send_pair()
    views = views_of(rig.await_output('views/image', stamp))
    depth = floats(rig.await_output('depth/image', stamp))
    assert np.array_equal(views > 0, np.isfinite(depth))
    alone = LIT & ~VISIBLE
    assert np.mean(views[alone] & 2 > 0) > 0.9 and np.mean(views[VISIBLE] == 3) > 0.9
    assert right_share(depth) > 0.97


def test_the_projector_is_a_camera_for_those_who_come_late(rig):
    infos = []
    rig.node.create_subscription(CameraInfo, 'projector/camera_info', infos.append, latched())
    rig.spin_until(lambda: infos, 'projector/camera_info')
    info, true = infos[-1], projector()
    assert (info.width, info.height) == (PATTERN.width, PATTERN.height)
    assert info.header.frame_id == 'projector_optical_frame'
    K, R, P = (np.reshape(each, shape) for each, shape in (
        (info.k, (3, 3)), (info.r, (3, 3)), (info.p, (3, 4))))
    for point in ([0.0, 0.0, 0.5], [0.08, -0.05, 0.42], [-0.09, 0.06, 0.55]):
        ray = R.T @ np.linalg.solve(P[:, :3], P @ [*point, 1.0])
        u, v, w = K @ ray
        np.testing.assert_allclose((u / w, v / w), true.project(np.array(point)), atol=0.5)


def test_a_covered_right_camera_is_survived_when_asked_for(rig):
    rig.set_parameters(input__survive_right_loss=True)
    stamp = covered(rig)
    depth = floats(rig.await_output('depth/image', stamp))
    views = views_of(rig.await_output('views/image', stamp))
    assert set(np.unique(views)) == {0, 2} and right_share(depth) > 0.9
    spread = floats(rig.await_output('depth_std/image', stamp))
    score = np.abs(depth - DEPTH) / spread
    assert np.nanpercentile(score[LIT], 68) < 1.4
    parts = rig.diagnose(lambda p: 'measure without it' in p['range images'].message, 'the loss')
    assert parts['range images'].level == DiagnosticStatus.WARN
    assert parts['range images'].message.startswith('the right camera is covered or dark: left')


def test_a_covered_right_camera_gives_no_ranges_by_default(rig):
    stamp = covered(rig)
    assert not np.isfinite(floats(rig.await_output('depth/image', stamp))).any()
    assert not views_of(rig.await_output('views/image', stamp)).any()


def test_a_right_camera_that_dies_is_survived_and_may_come_back(rig):
    rig.set_parameters(input__survive_right_loss=True)

    def alone():
        rig.send_image('left', rig.tick())
        rig.spin(0.1)
        return rig.received[LEFT] and set(np.unique(views_of(rig.received[LEFT][-1]))) == {0, 2}

    rig.spin_until(alone, 'results of the left camera alone')
    stamp = rig.tick()
    rig.send_image('left', stamp)
    assert right_share(floats(rig.await_output('depth/image', stamp))) > 0.9
    parts = rig.diagnose(lambda p: 'the right camera is silent' in p['range images'].message,
                         'the loss')
    assert parts['range images'].level == DiagnosticStatus.WARN
    rig.await_output('views/image', rig.send_pair())  # its left image does not wait yet
    stamp = rig.send_pair()
    assert (views_of(rig.await_output('views/image', stamp)) == 3).any()


def test_a_projector_that_moves_under_the_left_camera_alone_is_told(rig):
    rig.set_parameters(input__survive_right_loss=True)
    rig.images = dict(zip(('left', 'right'), pair(shift=(0.02, 0.0, 0.0))))
    stamp = covered(rig)
    assert not np.isfinite(floats(rig.await_output('depth/image', stamp))).any()
    parts = rig.diagnose(lambda p: 'projector lost' in p['pattern'].message, 'the move')
    assert parts['pattern'].level == DiagnosticStatus.WARN

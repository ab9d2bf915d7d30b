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
"""/diagnostics over real DDS: the node says what it does and why it does not."""

from color_stereo_ros.core.status import Status

from diagnostic_msgs.msg import DiagnosticStatus

import numpy as np

import pytest

from ros_rig import calibration, DISPARITY, scene, silent_rig, values_of

from scenes import hue_pair

from sensor_msgs.msg import Image

from std_msgs.msg import String


@pytest.fixture(scope='module')
def running(tmp_path_factory):
    """Yield a rig without any listener, and its node."""
    with silent_rig(tmp_path_factory.mktemp('diagnostics'), **{'pattern.type': 'sweep'}) as rig:
        yield rig


@pytest.fixture
def rig(running):
    """Yield the rig as it was at the start."""
    running.calibration = calibration()
    running.images = dict(zip(('left', 'right'), scene()))
    running.received.clear()
    return running


def test_without_any_image_it_says_that_none_has_arrived(rig):
    parts = rig.diagnose(lambda p: 'has arrived yet' in p['inputs'].message, 'silence')
    assert parts['inputs'].level == DiagnosticStatus.WARN
    assert 'no left and no right image has arrived yet' in parts['inputs'].message
    assert parts['calibration'].message == 'no left and no right camera_info has arrived yet'


def test_without_a_subscriber_it_says_that_it_waits_for_one(rig):
    parts = rig.feed(lambda p: p['inputs'].message == 'pairs arrive'
                     and p['range images'].message != 'getting ready', 'pairs')
    assert parts['range images'].message.startswith('waiting for a subscriber on /points, ')
    assert int(values_of(parts['range images'])['skipped for want of a subscriber']) >= 0
    assert parts['calibration'].message == 'calibrated'


def test_with_a_subscriber_it_gives_rate_latency_and_shares(rig):
    subscription = rig.listen(Image, 'depth/image')
    parts = rig.feed(lambda p: p['range images'].message == 'measuring'
                     and float(values_of(p['range images'])['rate (Hz)']) > 1.0, 'measuring')
    rig.node.destroy_subscription(subscription)
    values = values_of(parts['range images'])
    assert 0.0 < float(values['latency p50 (ms)']) <= float(values['latency p99 (ms)'])
    shares = [float(value) for name, value in values.items() if name.startswith('share ')]
    assert len(shares) == len(Status) and sum(shares) == pytest.approx(1.0, abs=1e-3)
    assert float(values['share valid']) > 0.5
    assert values['subscribed'] == 'depth/image'


def test_the_summary_comes_first_and_says_in_one_line_how_the_sensor_is(rig):
    subscription = rig.listen(Image, 'depth/image')
    rig.images = dict(zip(('left', 'right'), hue_pair(float(DISPARITY), 64, 48)))
    parts = rig.feed(lambda p: p['summary'].message.startswith('measuring: ')
                     and 'of sweep' in p['summary'].message, 'a summary')
    rig.node.destroy_subscription(subscription)
    assert list(parts)[0] == 'summary' and parts['summary'].level == DiagnosticStatus.OK
    text, values = parts['summary'].message, values_of(parts['summary'])
    assert ' Hz, ' in text and '% of the pixels' in text and ' ms; ' in text
    for words in (values['exposure'], values['pattern'], values['rows']):
        assert words in text
    assert 'white card at 200' in values['exposure'] or 'exposure is good' in values['exposure']
    assert values['pattern'] == 'colors change along rows only, as those of sweep do'
    assert values_of(parts['pattern'])['seen'] == values['pattern']
    assert float(values_of(parts['range images'])['memory of the node (MB)']) > 10


def dark(images):
    """
    Return images of a dark scene.

    They are not identical: that is a doubt of its own, and the log says a text at most every 5 s.

    """
    return {side: np.full_like(image, level) for level, (side, image) in enumerate(images.items())}


def test_the_summary_names_what_is_to_be_looked_after_with_its_part(rig):
    subscription = rig.listen(Image, 'depth/image')
    rig.images = dark(rig.images)
    parts = rig.feed(lambda p: 'few pixels' in p['summary'].message, 'darkness')
    rig.node.destroy_subscription(subscription)
    assert parts['summary'].level == DiagnosticStatus.WARN
    assert 'range images: hardly any pixel has a range' in parts['summary'].message


def test_a_pattern_of_another_kind_is_told(rig):
    assert rig.set_parameters(pattern__type='hue_field').successful
    rig.images = dict(zip(('left', 'right'), hue_pair(float(DISPARITY), 64, 48)))
    subscription = rig.listen(Image, 'depth/image')
    parts = rig.feed(lambda p: 'looks like' in p['pattern'].message, 'another pattern')
    rig.node.destroy_subscription(subscription)
    assert rig.set_parameters(pattern__type='sweep').successful
    assert parts['pattern'].level == DiagnosticStatus.WARN
    assert parts['pattern'].message == (
        'hue_field is set, but colors change along rows only: the image looks like sweep, '
        'bright_sweep, sine, walsh or lines')


def test_the_inputs_are_accounted_for(rig):
    parts = rig.feed(lambda p: p['inputs'].message == 'pairs arrive'
                     and values_of(p['inputs'])['frame period (ms)'] == '100', 'the frame period')
    values = values_of(parts['inputs'])
    assert values['skew, largest (ms)'] == '0'
    assert values['tolerance (ms)'] == '45'
    assert values['/left/image_raw'] == '1 publishers, subscribed reliable'


def test_the_calibration_is_told(rig):
    parts = rig.feed(lambda p: p['calibration'].message == 'calibrated', 'the calibration')
    values = values_of(parts['calibration'])
    assert values['size (px)'] == '64 x 48'
    assert float(values['baseline (m)']) == pytest.approx(0.06)


def test_a_dark_scene_is_told_with_its_reason(rig):
    subscription = rig.listen(Image, 'depth/image')
    rig.images = dark(rig.images)
    parts = rig.feed(lambda p: 'few pixels' in p['range images'].message, 'darkness')
    rig.node.destroy_subscription(subscription)
    assert parts['range images'].level == DiagnosticStatus.WARN
    assert 'too little pattern light' in parts['range images'].message


def gray(images):
    """Return the images as a camera without color sees them."""
    return {side: np.repeat(image.mean(axis=2, keepdims=True).astype(np.uint8), 3, axis=2)
            for side, image in images.items()}


@pytest.mark.parametrize('change, level', [
    (gray, DiagnosticStatus.OK),
    (lambda images: {side: image + np.uint8(120) for side, image in dark(images).items()},
     DiagnosticStatus.WARN)])
def test_gray_cameras_are_a_warning_only_while_there_are_few_ranges(rig, change, level):
    assert rig.set_parameters(matching__method='surface', pattern__type='hue_field').successful
    subscription = rig.listen(Image, 'depth/image')
    rig.images = change(rig.images)
    parts = rig.feed(lambda p: 'gray' in values_of(p['pattern']).get('seen', '')
                     and p['pattern'].level == level, 'gray cameras')
    told = values_of(parts['pattern'])['seen']
    assert (told in parts['pattern'].message) == (level == DiagnosticStatus.WARN)
    rig.spin_until(lambda: told in rig.process.text(), 'the log')  # the same text once in 5 s
    rig.images = dict(zip(('left', 'right'), scene()))
    rig.feed(lambda p: 'gray' not in values_of(p['pattern']).get('seen', 'gray'), 'colors')
    assert rig.set_parameters(matching__method='paper', pattern__type='sweep').successful
    rig.node.destroy_subscription(subscription)


@pytest.mark.parametrize('change, words', [
    (lambda images: {**images, 'left': gray(images)['left']},
     'the left image is gray, the other one is not: a mono camera'),
    (lambda images: dict.fromkeys(images, images['left']), 'left and right image are identical'),
    (lambda images: {'left': images['right'], 'right': images['left']},
     'left and right image swapped? The other way round'),
    (lambda images: {side: image // 64 for side, image in images.items()},
     'hardly any pixel has a range; ')])
def test_an_odd_pair_is_doubted_in_the_diagnostics_and_once_in_the_log(rig, change, words):
    # (the paper's method finds ranges in anything so small)
    assert rig.set_parameters(matching__method='surface', pattern__type='hue_field').successful
    subscription = rig.listen(Image, 'depth/image')
    rig.feed(lambda p: p['range images'].message == 'measuring', 'good pairs')
    before = len(rig.process.text())
    rig.images = change(rig.images)
    parts = rig.feed(lambda p: words in p['range images'].message, words)
    assert parts['range images'].level == DiagnosticStatus.WARN
    timer = rig.node.create_timer(0.1, rig.send_pair)
    rig.spin_until(lambda: words in rig.process.text()[before:], 'the log')
    rig.spin(1.5)
    rig.node.destroy_timer(timer)
    assert rig.process.text()[before:].count(words) == 1
    rig.images = dict(zip(('left', 'right'), scene()))
    rig.feed(lambda p: p['range images'].message == 'measuring', 'good pairs again')
    assert rig.set_parameters(matching__method='paper', pattern__type='sweep').successful
    rig.node.destroy_subscription(subscription)


def test_the_period_of_the_diagnostics_changes_while_running(rig):
    def stamps(period):
        assert rig.set_parameters(output__diagnostics_period=period).successful
        return [rig.diagnose(lambda p: True, 'any') for _ in range(3)]

    assert stamps(0.3) and stamps(0.1)
    assert rig.get_parameter('output.diagnostics_period') == 0.1


def test_another_pattern_is_warned_of_once_and_stays_in_the_diagnostics(rig):
    from color_stereo_ros.core import make_pattern, PatternSettings
    from color_stereo_ros.nodes.pattern_source import describe, latched
    publisher = rig.node.create_publisher(String, 'pattern/info', latched())
    other = PatternSettings(type='sine', width=64, height=48)
    publisher.publish(String(data=describe(other, make_pattern(other))))
    parts = rig.diagnose(lambda p: "pattern.type = 'sine' is shown" in p['pattern'].message,
                         'the mismatch')
    assert parts['pattern'].level == DiagnosticStatus.WARN
    own = PatternSettings(type='sweep')
    for _ in range(3):
        publisher.publish(String(data=describe(own, make_pattern(own))))
    rig.diagnose(lambda p: p['pattern'].message == 'the pattern shown is the one that is set',
                 'the match')
    image = make_pattern(own).copy()
    image[0, 0] ^= 1
    publisher.publish(String(data=describe(own, image)))
    rig.diagnose(lambda p: 'other pixels' in p['pattern'].message, 'other pixels')
    publisher.publish(String(data=describe(own, make_pattern(own), 'white')))
    rig.diagnose(lambda p: "pattern.frame = 'white' is shown" in p['pattern'].message, 'a frame')
    publisher.publish(String(data='no json'))
    rig.diagnose(lambda p: 'cannot be read' in p['pattern'].message, 'bad text')
    rig.node.destroy_publisher(publisher)
    assert rig.process.text().count("'sine' is shown") == 1

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
"""
Bad input and bad circumstances over real DDS.

Each row: what is sent, what must be said, that nothing else is lost, and that the next good pair
comes through with the right depth.

"""

from array import array
import json
import resource
import signal
import subprocess
import sys
import time

from color_stereo_ros.core import ColorStereo, Settings

from diagnostic_msgs.msg import DiagnosticStatus

import numpy as np

import pytest

from rclpy.qos import (QoSDurabilityPolicy, QoSProfile, QoSReliabilityPolicy)

from ros_rig import (answering, calibration, HEIGHT, image_message, info_message, NodeProcess,
                     PAPER, Rig, ROOT, scene, values_of, WIDTH)

from rosgraph_msgs.msg import Clock

from sensor_msgs.msg import CompressedImage, Image, PointCloud2, RegionOfInterest

from std_msgs.msg import String

from std_srvs.srv import Trigger

DEPTH = 'depth/image'
PARAMETERS = {**PAPER, 'output.diagnostics_period': 0.1, 'sync.warn_after': 1.0}
SECOND = 1_000_000_000
NAN, INF = float('nan'), float('inf')


def depth_of(rig):
    """Return the bytes of the depth that the core measures in the rig's images."""
    stereo = ColorStereo(rig.calibration, Settings().updated(PAPER))
    return stereo.process(rig.images['left'], rig.images['right']).depth.tobytes()


@pytest.fixture(scope='module')
def running(tmp_path_factory):
    """Yield a rig and the one node that most rows share."""
    folder = tmp_path_factory.mktemp('faults')
    saved = folder / 'saved'
    saved.mkdir()
    with answering(folder / 'log.txt', {**PARAMETERS, 'output.save_directory': saved},
                   {DEPTH: Image}, DEPTH) as rig:
        rig.truth = depth_of(rig)
        rig.saved = saved
        yield rig


@pytest.fixture
def rig(running):
    """Yield the rig; before and after each row a good pair must come through."""
    rig = running
    restore(rig)
    assert_good(rig)
    yield rig
    restore(rig)
    assert_good(rig)


def restore(rig):
    """Put the cameras right."""
    rig.calibration = calibration()
    rig.images = dict(zip(('left', 'right'), scene()))
    rig.stamp = max(rig.stamp, time.time_ns())
    rig.spin(0.02)


def assert_good(rig):
    """Send good pairs until the calibration is taken, and then one that must be right."""
    rig.received[DEPTH].clear()

    def is_taken():
        rig.send_pair()
        rig.spin(0.1)
        return any(bytes(depth.data) == rig.truth for depth in rig.received[DEPTH])

    rig.spin_until(is_taken, 'a depth image of the good calibration')
    assert bytes(rig.good_pair(DEPTH).data) == rig.truth
    rig.received[DEPTH].clear()


def send_good(rig, count=1):
    """Send good pairs, each answered before the next, and return their stamps."""
    stamps = []
    for _ in range(count):
        stamps.append(rig.send_pair())
        rig.await_output(DEPTH, stamps[-1])
    return stamps


def assert_told(rig, part, level, *words):
    """Wait until the diagnostics say words about a part."""
    parts = rig.diagnose(lambda p: all(word in p[part].message for word in words), words)
    assert parts[part].level == level


# ---- malformed images: what differs from a good left image, and what must be said

def changed(**changes):
    """Return a function that makes the changed image."""
    return lambda rgb: image_message(rgb, **changes)


def cropped(rows, columns):
    """Return a function that makes a smaller image."""
    return lambda rgb: image_message(np.ascontiguousarray(rgb[:rows, :columns]))


def relabeled(encoding, **changes):
    """Return a function that makes an rgb8 image which says that it is something else."""
    def make(rgb):
        msg = image_message(rgb, **changes)
        msg.encoding = encoding
        return msg
    return make


IMAGE_FAULTS = {
    'mono8 of 3 bytes': (changed(encoding='mono8', step=WIDTH), 'data is too long'),
    '8UC1': (changed(encoding='8UC1'), "encoding = '8UC1' does not tell what"),
    '32FC1': (changed(encoding='32FC1'), "encoding = '32FC1' does not tell what"),
    '8UC3': (changed(encoding='8UC3'), "'8UC3' does not tell the order"),
    'yuv422': (changed(encoding='yuv422'), "encoding = 'yuv422' is not supported"),
    'rgb16': (changed(encoding='rgb16'), "encoding = 'rgb16' is not supported"),
    'no encoding': (changed(encoding=''), "encoding = '' is empty"),
    'gibberish encoding': (changed(encoding='\n%s{}'), 'is not supported'),
    'long encoding': (changed(encoding='x' * 10000), 'is not supported'),
    'bgra8 on 3 bytes': (relabeled('bgra8'), f'step = {WIDTH * 3} bytes is too small'),
    'step too small': (changed(step=WIDTH * 3 - 1), f'step = {WIDTH * 3 - 1} bytes is too small'),
    'step zero': (changed(step=0), 'step = 0 bytes is too small'),
    'step too large': (changed(step=WIDTH * 3 + 1), 'data is truncated'),
    'step huge': (changed(step=2**32 - 1), 'data is truncated'),
    'height zero': (changed(height=0), 'the image is empty'),
    'width zero': (changed(width=0), 'the image is empty: width = 0 px'),
    'height too large': (changed(height=HEIGHT + 1), 'data is truncated'),
    'height too small': (changed(height=HEIGHT - 1), 'data is too long'),
    'height huge': (changed(height=2**32 - 1), 'the image is too large'),
    'width huge': (changed(width=2**32 - 1), 'the image is too large'),
    'no data': (changed(data=array('B')), 'data is truncated: 0 bytes'),
    'one byte missing': (lambda rgb: image_message(
        rgb, data=array('B', rgb.tobytes()[:-1])), 'data is truncated: 9215 bytes'),
    'one byte too many': (lambda rgb: image_message(
        rgb, data=array('B', rgb.tobytes() + b'x')), 'data is too long: 9217 bytes'),
    'bayer on 3 bytes': (relabeled('bayer_rggb8', step=WIDTH), 'data is too long'),
    'bayer of 2 rows': (lambda rgb: Image(
        height=2, width=2, encoding='bayer_rggb8', step=2, data=array('B', bytes(4))),
        '2 x 2 px is too small'),
}


@pytest.mark.parametrize('side', ['left', 'right'])
@pytest.mark.parametrize('kind', IMAGE_FAULTS)
def test_a_malformed_image_is_refused_with_its_value(rig, kind, side):
    make, words = IMAGE_FAULTS[kind]
    before = send_good(rig)
    rig.send_pair(**{side: make(rig.images[side])})
    assert_told(rig, 'inputs', DiagnosticStatus.ERROR, f'{side} image refused: ', words)
    after = send_good(rig)
    assert rig.stamps(DEPTH) == before + after


WRONG_SIZES = {'fewer rows': cropped(HEIGHT - 1, WIDTH), 'fewer columns': cropped(HEIGHT, 40),
               'a single pixel': cropped(1, 1)}


@pytest.mark.parametrize('side', ['left', 'right'])
@pytest.mark.parametrize('kind', WRONG_SIZES)
def test_an_image_of_another_size_than_calibrated_is_refused(rig, kind, side):
    before = send_good(rig)
    rig.send_pair(**{side: WRONG_SIZES[kind](rig.images[side])})
    assert_told(rig, 'range images', DiagnosticStatus.ERROR, f'{side} image', 'as calibrated')
    assert rig.stamps(DEPTH) == before


def test_the_size_changes_in_mid_stream_and_back(rig):
    send_good(rig)
    size = (80, 56)
    rig.calibration = calibration(size)
    rig.images = dict(zip(('left', 'right'), scene(size)))
    rig.send_infos()
    rig.diagnose(lambda p: values_of(p['calibration']).get('size (px)') == '80 x 56', 'new size')
    msg = rig.good_pair(DEPTH)
    assert (msg.width, msg.height) == size
    assert bytes(msg.data) == depth_of(rig)


def test_the_encoding_changes_with_every_pair(rig):
    for encoding in ('rgb8', 'bgr8', 'rgba8', 'bgra8', 'rgb8'):
        stamp = rig.send_pair(**{side: image_message(image, encoding)
                                 for side, image in rig.images.items()})
        assert bytes(rig.await_output(DEPTH, stamp).data) == rig.truth


# ---- malformed calibrations: side, what differs, and what must be said

def entry(field, index, value):
    """Return a change of one entry of a matrix."""
    def change(camera):
        values = list(getattr(camera, field.upper()).ravel())
        values[index] = value
        return {field: values}
    return change


def fields(**changes):
    """Return a change of whole fields."""
    return lambda camera: changes


INFO_FAULTS = {
    'K[0] = 0, uncalibrated': ('left', entry('k', 0, 0.0), 'left K[0] = 0.0 px: the camera is '
                               'not calibrated'),
    'K[4] = 0': ('right', entry('k', 4, 0.0), 'right K[4] = 0.0 px'),
    'K[0] negative': ('left', entry('k', 0, -60.0), 'left K[0] = -60.0 px'),
    'K[2] NaN': ('left', entry('k', 2, NAN), 'left K[2] = nan is not a finite number'),
    'K[8] = 0': ('left', entry('k', 8, 0.0), 'is no camera matrix'),
    'K[3] not zero': ('right', entry('k', 3, 5.0), 'is no camera matrix'),
    'K all zero': ('right', fields(k=[0.0] * 9), 'right K[0] = 0.0 px: the camera is not'),
    'D NaN': ('left', fields(d=[NAN] + [0.0] * 4), 'left D[0] = nan is not a finite number'),
    'D infinite': ('right', fields(d=[0.0] * 4 + [INF]), 'right D[4] = inf'),
    'D too long': ('left', fields(d=[0.0] * 8 + [0.1]), 'left D[8] = 0.1, but distortion_model '
                   'plumb_bob has 5 coefficients'),
    'distortion model unknown': ('left', fields(distortion_model='kannala'),
                                 "left distortion_model = 'kannala' is unknown"),
    'distortion model empty': ('right', fields(distortion_model=''),
                               "right distortion_model = '' is unknown"),
    'R zero': ('left', fields(r=[0.0] * 9), 'left R = [0.0, 0.0'),
    'R NaN': ('right', entry('r', 4, NAN), 'right R[4] = nan is not a finite number'),
    'R scaled': ('left', fields(r=[2.0, 0, 0, 0, 2.0, 0, 0, 0, 2.0]), 'is not a rotation'),
    'R mirrored': ('right', fields(r=[1.0, 0, 0, 0, 1.0, 0, 0, 0, -1.0]), 'is not a rotation'),
    'P[0] = 0': ('left', entry('p', 0, 0.0), 'left P[0] = 0.0 px'),
    'P all zero': ('right', fields(p=[0.0] * 12), 'right P[0] = 0.0 px'),
    'P[5] negative': ('left', entry('p', 5, -1.0), 'left P[5] = -1.0 px'),
    'P[2] infinite': ('left', entry('p', 2, INF), 'left P[2] = inf is not a finite number'),
    'P[1] skewed': ('left', entry('p', 1, 1.0), 'a rectified camera has no skew'),
    'P[10] = 0': ('right', entry('p', 10, 0.0), 'right P[8..11]'),
    'no baseline': ('right', entry('p', 3, 0.0), 'right P[3] = 0.0 px m: the pair has no base'),
    'positive P[3]': ('right', entry('p', 3, 4.0), 'right P[3] = 4.0 px m is positive'),
    'baseline in mm': ('right', entry('p', 3, -3600.0 * 5), 'given in millimeters?'),
    'baseline tiny': ('right', entry('p', 3, -1e-6), 'right P[3] means a baseline of'),
    'P[3] NaN': ('right', entry('p', 3, NAN), 'right P[3] = nan is not a finite number'),
    'P[7] not zero': ('right', entry('p', 7, -4.0), 'right P[7] = -4.0 px m: cameras above'),
    'left P[3] not zero': ('left', entry('p', 3, -4.0), 'left P[3] = -4.0 px m, expected 0: are '
                           'left and right camera swapped?'),
    'the same P[3]': ('left', entry('p', 3, -3.6), 'no baseline between them'),
    'vertical': ('right', lambda camera: {'p': [*camera.P.ravel()[:3], 0.0, *camera.P.ravel()[4:7],
                                                -3.6, 0.0, 0.0, 1.0, 0.0]},
                 'Vertical stereo is not supported: turn both cameras'),
    'too small': ('left', fields(width=3), 'left width = 3 px is not an image size'),
    'focal lengths differ': ('right', entry('p', 0, 70.0), 'a rectified pair has one focal'),
    'rows differ': ('right', entry('p', 6, 3.0), 'a rectified pair has one principal row cy'),
    'width zero': ('left', fields(width=0), 'left width = 0 px'),
    'height zero': ('right', fields(height=0), 'right height = 0 px'),
    'sizes differ': ('right', fields(width=WIDTH + 2), 'expected equal sizes'),
    'binning': ('left', fields(binning_x=2), 'left binning_x = 2 is not supported'),
    'binning of rows': ('right', fields(binning_y=4), 'right binning_y = 4 is not supported'),
    'window': ('left', fields(roi=RegionOfInterest(x_offset=8, y_offset=0, width=32, height=48)),
               'left roi = 32 x 48 px at (8, 0) is not supported'),
}


@pytest.mark.parametrize('kind', INFO_FAULTS)
def test_an_impossible_calibration_is_refused_with_its_value(rig, kind):
    side, change, words = INFO_FAULTS[kind]
    before = send_good(rig)
    camera = getattr(rig.calibration, side)
    rig.send_info(side, info_message(camera, **change(camera)))
    rig.send_info({'left': 'right', 'right': 'left'}[side])
    assert_told(rig, 'calibration', DiagnosticStatus.ERROR, words)
    rig.send_pair(infos=False)
    rig.spin(0.05)
    assert rig.stamps(DEPTH) == before, 'a pair was measured without a calibration'


def shifted(by):
    """Return a change of P[3]: the projection belongs to another reference camera."""
    return lambda camera: {'p': [*camera.P.ravel()[:3], camera.P[0, 3] + by,
                                 *camera.P.ravel()[4:]]}


INFO_VARIANTS = {
    'D too short': (False, fields(d=[0.0, 0.0])),
    'D with zeros at the end': (False, fields(d=[0.0] * 14)),
    'rounding dust in K': (False, entry('k', 3, 1e-14)),
    'rounding dust in P': (False, entry('p', 7, -1e-14)),
    'a third camera as the reference': (False, shifted(-7.2)),
    'rectified, no model': (True, fields(distortion_model='', d=[])),
    'rectified, no K': (True, fields(k=[0.0] * 9)),
    'rectified, no R': (True, fields(r=[0.0] * 9))}


@pytest.mark.parametrize('kind', INFO_VARIANTS)
def test_a_calibration_that_is_written_in_another_way_gives_the_same_depth(rig, kind):
    rectified, change = INFO_VARIANTS[kind]
    assert rig.set_parameters(input__rectified=rectified).successful
    for side in ('left', 'right'):
        camera = getattr(rig.calibration, side)
        rig.send_info(side, info_message(camera, **change(camera)))
    rig.diagnose(lambda p: p['calibration'].message == 'calibrated', 'calibrated')
    stamp = rig.send_pair(infos=False)
    assert bytes(rig.await_output(DEPTH, stamp).data) == depth_of(rig)
    back_to_raw(rig)


def back_to_raw(rig):
    """Send the whole calibration and let the node rectify again."""
    rig.send_infos()
    rig.diagnose(lambda p: p['calibration'].message == 'calibrated', 'calibrated')
    assert_good(rig)
    assert rig.set_parameters(input__rectified=False).successful


def test_a_calibration_of_p_alone_is_taken_as_soon_as_the_input_is_rectified(rig):
    for side in ('left', 'right'):
        rig.send_info(side, info_message(getattr(rig.calibration, side), k=[0.0] * 9))
    assert_told(rig, 'calibration', DiagnosticStatus.ERROR, 'rectified already need P alone')
    assert rig.set_parameters(input__rectified=True).successful
    rig.diagnose(lambda p: p['calibration'].message == 'calibrated', 'calibrated')
    stamp = rig.send_pair(infos=False)
    assert bytes(rig.await_output(DEPTH, stamp).data) == depth_of(rig)
    refused = rig.set_parameters(input__rectified=False)
    assert not refused.successful and 'left K[0] = 0.0 px' in refused.reason
    back_to_raw(rig)


def test_points_in_the_frame_of_the_camera_need_r(rig):
    assert rig.set_parameters(input__rectified=True).successful
    for side in ('left', 'right'):
        rig.send_info(side, info_message(getattr(rig.calibration, side), r=[0.0] * 9))
    rig.diagnose(lambda p: p['calibration'].message == 'calibrated', 'calibrated')
    refused = rig.set_parameters(output__frame='camera')
    assert not refused.successful and 'output.frame = camera needs R' in refused.reason
    back_to_raw(rig)


def test_swapped_cameras_are_told(rig):
    left, right = (info_message(getattr(rig.calibration, side)) for side in ('left', 'right'))
    rig.send_info('left', right)
    rig.send_info('right', left)
    assert_told(rig, 'calibration', DiagnosticStatus.ERROR, 'swapped?')


def test_depth_limits_that_do_not_fit_the_calibration_are_told(rig):
    rig.calibration = calibration(baseline=3.0)
    rig.send_infos()
    rig.diagnose(lambda p: values_of(p['calibration']).get('baseline (m)') == '3', 'calibration')
    rig.send_pair()
    assert_told(rig, 'range images', DiagnosticStatus.ERROR, 'outside an image of 64 columns')


def test_a_recalibration_is_taken_and_never_mixed_with_the_old_one(rig):
    send_good(rig)
    rig.calibration = calibration(verged=0.1)
    rig.send_info('left')
    rig.diagnose(lambda p: 'waiting for the other one' in p['calibration'].message, 'waiting')
    rig.send_pair(infos=False)
    rig.spin(0.05)
    assert len(rig.stamps(DEPTH)) == 1
    rig.send_info('right')
    rig.diagnose(lambda p: p['calibration'].message == 'calibrated', 'calibrated')
    assert bytes(rig.good_pair(DEPTH).data) == depth_of(rig)


def test_a_calibration_of_one_camera_alone_is_taken_after_a_moment(rig):
    camera = rig.calibration.left
    rig.send_info('left', info_message(camera, d=[0.01, 0.0, 0.0, 0.0, 0.0]))
    rig.diagnose(lambda p: p['calibration'].message == 'calibrated', 'calibrated')


@pytest.mark.parametrize('frame, words', [('base_link', 'does not say "optical"')])
def test_a_suspicious_frame_is_warned_of_but_used(rig, frame, words):
    for side in ('left', 'right'):
        msg = info_message(getattr(rig.calibration, side))
        msg.header.frame_id = frame
        rig.send_info(side, msg)
    assert_told(rig, 'calibration', DiagnosticStatus.WARN, words)
    stamp = rig.send_pair(infos=False)
    rig.await_output(DEPTH, stamp)


def test_an_image_with_another_frame_than_its_calibration_is_warned_of_but_used(rig):
    msg = image_message(rig.images['left'])
    msg.header.frame_id = 'somewhere_optical'
    output = rig.await_output(DEPTH, rig.send_pair(left=msg))
    assert output.header.frame_id == 'somewhere_optical'
    assert_told(rig, 'calibration', DiagnosticStatus.WARN, "frame_id 'somewhere_optical', left "
                "camera_info 'left_camera_optical_frame'")
    for side in ('left', 'right'):
        info = info_message(getattr(rig.calibration, side))
        info.header.frame_id = 'somewhere_optical'
        rig.send_info(side, info)
    # whichever comes last: the warning goes with its cause, not with the next image
    rig.diagnose(lambda p: p['calibration'].message == 'calibrated', 'calibrated')


# ---- stamps

def test_equal_stamps_are_measured_every_time(rig):
    stamp = rig.tick()
    for count in range(1, 4):
        rig.send_pair(stamp=stamp)
        rig.spin_until(lambda: len(rig.stamps(DEPTH)) == count, 'an output for each pair')
    assert rig.stamps(DEPTH) == [stamp] * 3


def test_stamps_of_zero_are_measured_and_told(rig):
    rig.send_pair(stamp=0)
    rig.await_output(DEPTH, 0)
    assert_told(rig, 'inputs', DiagnosticStatus.WARN, 'the stamps are zero')


def test_a_left_stamp_in_the_far_future_costs_only_itself(rig):
    before = send_good(rig)
    rig.send_image('left', rig.stamp + 10**17)
    after = send_good(rig, 3)
    assert rig.stamps(DEPTH) == before + after


def test_a_pair_from_the_far_future_is_measured_and_forgotten(rig):
    future = rig.send_pair(stamp=rig.stamp + 10**17)
    rig.await_output(DEPTH, future)
    after = send_good(rig, 3)
    assert rig.stamps(DEPTH) == [future] + after


def test_a_looped_recording_is_measured_in_every_pass(rig):
    start = rig.stamp
    stamps = [start + index * SECOND // 4 for index in range(1, 9)]
    for _ in range(3):
        for stamp in stamps:
            rig.send_pair(stamp=stamp)
            rig.spin_until(lambda: rig.stamps(DEPTH)[-1:] == [stamp], 'the pair')
    rig.stamp = stamps[-1]  # what follows is later
    assert rig.stamps(DEPTH) == stamps * 3


def test_a_late_image_is_counted_and_gives_no_stale_output(rig):
    before = send_good(rig, 3)
    late = int(values_of(rig.diagnose(lambda p: True, 'counts')['inputs'])['left late'])
    rig.send_image('left', before[0])
    rig.diagnose(lambda p: values_of(p['inputs'])['left late'] == str(late + 1), 'the late image')
    after = send_good(rig)
    assert rig.stamps(DEPTH) == before + after


def test_images_that_interleave_find_their_partners(rig):
    stamps = [rig.tick() for _ in range(4)]
    for side, index in (('left', 0), ('left', 1), ('right', 0), ('left', 2), ('right', 1),
                        ('right', 2), ('right', 3), ('left', 3)):
        rig.send_image(side, stamps[index])
        rig.spin(0.05)
    rig.await_output(DEPTH, stamps[-1])
    assert rig.stamps(DEPTH) == stamps


def test_stamps_too_far_apart_are_told_with_their_difference(rig):
    deadline = time.monotonic() + 1.3
    while time.monotonic() < deadline:
        stamp = rig.tick()
        rig.send_image('left', stamp)
        rig.send_image('right', stamp + rig.period // 2)
        rig.spin(0.05)
    assert_told(rig, 'inputs', DiagnosticStatus.WARN, 'their stamps differ by 50.0 ms')
    assert rig.stamps(DEPTH) == []


def test_a_small_skew_is_paired_and_told(rig):
    stamps = []
    for _ in range(5):
        stamps.append(rig.tick())
        rig.send_image('left', stamps[-1])
        rig.send_image('right', stamps[-1] + 7_000_000)
        rig.await_output(DEPTH, stamps[-1])
    assert rig.stamps(DEPTH) == stamps
    rig.diagnose(lambda p: float(values_of(p['inputs'])['skew, largest (ms)']) >= 7.0, 'skew')


# ---- cameras that fail

@pytest.mark.parametrize('dead, alive', [('left', 'right'), ('right', 'left')])
def test_a_dead_camera_is_named(rig, dead, alive):
    before = send_good(rig, 2)
    deadline = time.monotonic() + 1.3
    while time.monotonic() < deadline:
        rig.send_image(alive, rig.tick())
        rig.spin(0.05)
    assert_told(rig, 'inputs', DiagnosticStatus.WARN,
                f'no {dead} image any more, {alive} images do arrive')
    assert rig.stamps(DEPTH) == before


def test_two_dead_cameras_are_named(rig):
    send_good(rig)
    assert_told(rig, 'inputs', DiagnosticStatus.WARN, 'no left and no right image any more')


@pytest.mark.parametrize('slow', ['left', 'right'])
def test_a_camera_at_half_rate_loses_nothing_that_it_sent(rig, slow):
    stamps = []
    for index in range(20):
        stamp = rig.tick()
        for side in ('left', 'right'):
            if side != slow or index % 2 == 0:
                rig.send_image(side, stamp)
        if index % 2 == 0:
            stamps.append(stamp)
            rig.await_output(DEPTH, stamp)
    assert rig.stamps(DEPTH) == stamps


def test_of_a_stream_with_5_percent_loss_every_whole_pair_is_measured(rig, effort, figures):
    rng = np.random.default_rng(5)
    rounds = effort.count(100, 3000)
    whole = []
    for _ in range(rounds):
        stamp, kept = rig.tick(), rng.random(2) >= 0.05
        for side in np.array(['left', 'right'])[kept]:
            rig.send_image(str(side), stamp)
        if kept.all():
            whole.append(stamp)
            rig.await_output(DEPTH, stamp)
    assert 0.8 < len(whole) / rounds < 1
    assert rig.stamps(DEPTH) == whole
    figures('range_node: whole pairs of a stream with 5 % loss measured', len(whole), 'pairs',
            over=rounds)


def test_of_a_burst_the_latest_pair_wins_and_the_others_are_counted(rig):
    def counts():
        values = values_of(rig.diagnose(lambda p: True, 'counts')['inputs'])
        return int(values['pairs']), int(values['pairs dropped for newer ones'])

    pairs, dropped = counts()
    stamps = [rig.send_pair(infos=False) for _ in range(30)]
    rig.await_output(DEPTH, stamps[-1])
    rig.spin(0.3)
    pairs_after, dropped_after = counts()
    measured = rig.stamps(DEPTH)
    assert measured == sorted(measured) and measured[-1] == stamps[-1]
    assert pairs_after - pairs == len(measured) + dropped_after - dropped


def test_images_without_a_calibration_are_not_measured(tmp_path):
    node = NodeProcess(tmp_path / 'log.txt', parameters=PARAMETERS,
                       arguments=['-r', '__ns:=/bare'])
    rig = Rig('/bare')
    rig.listen(Image, DEPTH)
    rig.wait_for_node()
    rig.wait_for_publishers()
    node.wait_until_ready()
    rig.send_pair(infos=False)
    node.wait_until_said('images arrive, but no left and no right camera_info')
    assert_told(rig, 'calibration', DiagnosticStatus.WARN, 'no left and no right camera_info')
    assert rig.stamps(DEPTH) == []
    rig.send_infos()
    rig.diagnose(lambda p: p['calibration'].message == 'calibrated', 'calibrated')
    rig.good_pair(DEPTH)
    assert node.stop() == 0
    rig.close()


# ---- parameters of every wrong type and value, while running

WRONG_PARAMETERS = {
    'string for double': ('range.min_depth', 'near'), 'bool for double': ('sync.tolerance', True),
    'double out of range': ('range.max_depth', 1e6), 'NaN': ('range.min_depth', NAN),
    'infinity': ('range.max_depth', INF), 'negative double': ('sync.tolerance', -0.1),
    'double for integer': ('sync.queue_size', 2.5), 'string for integer': ('pattern.cycles', '1'),
    'bool for integer': ('sync.queue_size', True), 'integer out of range': ('sync.queue_size', 0),
    'integer beyond 32 bit': ('sync.queue_size', 2**40),
    'integer for bool': ('input.rectified', 1), 'string for bool': ('input.rectified', 'true'),
    'integer for string': ('matching.method', 1), 'no such choice': ('matching.method', 'magic'),
    'empty choice': ('output.frame', ''), 'list for double': ('range.min_depth', [0.3]),
    'list of strings for string': ('matching.method', ['paper']),
    'bytes for string': ('matching.method', [b'p']),
    'contradiction': ('range.min_depth', 0.9), 'even window': ('matching.window_width', 8),
    'limits outside the image': ('range.max_depth', 0.26),
    'unknown name': ('range.min_deph', 0.3)}


@pytest.mark.parametrize('kind', WRONG_PARAMETERS)
def test_a_wrong_parameter_is_refused_with_a_reason_and_changes_nothing(rig, kind):
    name, value = WRONG_PARAMETERS[kind]
    if kind == 'limits outside the image':
        assert rig.set_parameters(range__min_depth=0.01).successful
        name, value = 'range.max_depth', 0.02
    result = rig.set_parameters(atomically=False, **{name.replace('.', '__'): value})[0]
    if kind == 'limits outside the image':
        assert rig.set_parameters(range__min_depth=0.25).successful
    assert not result.successful
    assert len(result.reason) > 15
    send_good(rig)


# ---- circumstances

def test_qos_follows_best_effort_cameras_and_back(rig):
    best_effort = QoSProfile(depth=10, reliability=QoSReliabilityPolicy.BEST_EFFORT)
    cameras = Rig(qos=best_effort)
    cameras.spin(0.1)
    name = '/left/image_raw'
    rig.diagnose(lambda p: 'subscribed best_effort' in values_of(p['inputs'])[name], 'best effort')
    cameras.wait_for_node()
    cameras.stamp = rig.stamp
    stamp = cameras.send_pair()
    rig.await_output(DEPTH, stamp)
    rig.stamp = cameras.stamp
    cameras.close()
    rig.diagnose(lambda p: 'subscribed reliable' in values_of(p['inputs'])[name], 'reliable')
    rig.wait_for_node()


def test_a_pinned_qos_that_does_not_fit_is_told(tmp_path):
    override = 'qos_overrides./pinned/left/image_raw.subscription.reliability'
    node = NodeProcess(tmp_path / 'log.txt', parameters={**PARAMETERS, override: 'reliable'},
                       arguments=['-r', '__ns:=/pinned'])
    rig = Rig('/pinned', qos=QoSProfile(depth=10, reliability=QoSReliabilityPolicy.BEST_EFFORT))
    assert_told(rig, 'inputs', DiagnosticStatus.ERROR, '/pinned/left/image_raw',
                'incompatible QoS', 'reliability')
    assert node.stop() == 0
    rig.close()


def test_what_was_latched_before_the_node_came_is_taken(tmp_path):
    latched = QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
    rig = Rig('/latched', qos=latched)
    stamp = rig.send_pair()
    node = NodeProcess(tmp_path / 'log.txt', parameters=PARAMETERS,
                       arguments=['-r', '__ns:=/latched'])
    rig.diagnose(lambda p: missed(p) == 1, 'a pair that nobody wants')
    rig.listen(Image, DEPTH)  # even now: a latched image does not come again
    depth = rig.await_output(DEPTH, stamp)
    assert bytes(depth.data) == depth_of(rig)
    values = values_of(rig.diagnose(lambda p: True, 'values')['inputs'])
    for topic in ('left/image_raw', 'right/camera_info'):
        assert values[f'/latched/{topic}'] == '1 publishers, subscribed reliable, transient_local'
    assert node.stop() == 0
    rig.close()


def missed(parts):
    """Return how many pairs nobody wanted or were not calibrated, by the diagnostics."""
    values = values_of(parts['range images'])
    return int(values['skipped for want of a subscriber']) + int(values['without calibration'])


def test_latched_images_wait_for_their_calibration(tmp_path):
    rig = Rig('/latched', qos=QoSProfile(
        depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL))
    rig.listen(Image, DEPTH)
    stamp = rig.send_pair(infos=False)
    node = NodeProcess(tmp_path / 'log.txt', parameters=PARAMETERS,
                       arguments=['-r', '__ns:=/latched'])
    rig.diagnose(lambda p: missed(p) == 1, 'a pair without calibration')
    rig.send_infos()
    assert bytes(rig.await_output(DEPTH, stamp).data) == depth_of(rig)
    assert len(rig.received[DEPTH]) == 1
    assert node.stop() == 0
    rig.close()


def test_a_volatile_publisher_beside_a_latched_one_is_heard(rig):
    latched = QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
    others = Rig(qos=latched)
    rig.diagnose(lambda p: '2 publishers on /left/camera_info' in p['inputs'].message, 'both')
    assert_good(rig)
    others.close()
    rig.diagnose(lambda p: p['inputs'].message == 'pairs arrive', 'one')


def test_two_publishers_of_one_topic_are_named(rig):
    second = Rig()
    send_good(rig)
    assert_told(rig, 'inputs', DiagnosticStatus.WARN,
                *(f'2 publishers on /{side}/{topic} (/test_rig, /test_rig)'
                  for side in ('left', 'right') for topic in ('image_raw', 'camera_info')))
    rig.process.wait_until_said('2 publishers on /left/image_raw')  # at most every 5 s
    second.close()
    send_good(rig)
    rig.diagnose(lambda p: p['inputs'].message == 'pairs arrive', 'one publisher')


def test_images_that_come_as_theora_only_are_told_what_to_do(tmp_path):
    node = NodeProcess(tmp_path / 'log.txt', parameters=PARAMETERS,
                       arguments=['-r', '__ns:=/small'])
    rig = Rig('/small')
    for side in ('left', 'right'):
        rig.node.destroy_publisher(rig.publishers.pop((side, Image)))
        rig.node.create_publisher(CompressedImage, f'{side}/image_raw/theora', 10)
    words = [f'nobody publishes /small/{side}/image_raw, but /small/{side}/image_raw/theora '
             'has a publisher' for side in ('left', 'right')]
    command = ('ros2 run image_transport republish --ros-args -p in_transport:=theora '
               '-p out_transport:=raw -r in/theora:=/small/left/image_raw/theora '
               '-r out:=/small/left/image_raw')
    assert_told(rig, 'inputs', DiagnosticStatus.WARN, *words, command)
    node.wait_until_said(command)
    assert node.stop() == 0
    rig.close()


def test_the_other_transport_is_named_where_only_it_has_publishers(tmp_path):
    node = NodeProcess(tmp_path / 'log.txt', parameters=PARAMETERS,
                       arguments=['-r', '__ns:=/small', '-r', 'left/image_raw:=cam/image'])
    rig = Rig('/small')
    rig.node.destroy_publisher(rig.publishers.pop(('left', Image)))
    rig.node.create_publisher(CompressedImage, 'cam/image/compressed', 10)
    command = 'ros2 param set /small/range_node input.transport compressed'
    assert_told(rig, 'inputs', DiagnosticStatus.WARN, 'nobody publishes /small/cam/image, but '
                '/small/cam/image/compressed has a publisher: set input.transport to compressed',
                command)
    node.wait_until_said(command)
    assert rig.set_parameters(input__transport='compressed').successful
    assert_told(rig, 'inputs', DiagnosticStatus.WARN, 'nobody publishes '
                '/small/right/image_raw/compressed, but /small/right/image_raw has a publisher: '
                'set input.transport to raw')
    assert node.stop() == 0
    rig.close()


LONG = 'x' * 100_000


def long_frame_of_the_image(rig):
    """Send an image whose frame_id is long."""
    msg = image_message(rig.images['left'])
    msg.header.frame_id = LONG
    rig.send_pair(left=msg)


def long_frames_of_the_calibrations(rig):
    """Send calibrations whose frame_id is long."""
    for side in ('left', 'right'):
        msg = info_message(getattr(rig.calibration, side))
        msg.header.frame_id = LONG
        rig.send_info(side, msg)
    rig.send_pair(infos=False)


def long_model(rig):
    """Send a calibration whose distortion_model is long."""
    rig.send_info('left', info_message(rig.calibration.left, distortion_model=LONG))
    rig.send_info('right')


def long_encoding(rig):
    """Send an image whose encoding is long."""
    rig.send_pair(left=image_message(rig.images['left'], encoding=LONG))


def long_pattern(rig):
    """Send a description of a pattern whose type is long."""
    publisher = rig.node.create_publisher(String, 'pattern/info', 1)
    rig.spin_until(publisher.get_subscription_count, 'the node')
    for text in (LONG, json.dumps({'pattern': {'type': LONG[:9000]}, 'sha256': LONG[:100]}),
                 '[' * 9000):
        publisher.publish(String(data=text))
    rig.diagnose(lambda p: 'cannot be read' in p['pattern'].message, 'the last one')
    rig.node.destroy_publisher(publisher)


@pytest.mark.parametrize('send, part, words', [
    (long_frame_of_the_image, 'calibration', 'left image has frame_id'),
    (long_frames_of_the_calibrations, 'calibration', 'does not say "optical"'),
    (long_model, 'calibration', '(100000 characters)'),
    (long_encoding, 'inputs', 'is not supported'),
    (long_pattern, 'pattern', 'cannot be read')])
def test_foreign_texts_are_bounded_in_log_and_diagnostics(rig, send, part, words):
    before = len(rig.process.text())
    send(rig)
    parts = rig.diagnose(lambda p: words in p[part].message, words)
    assert all(len(text) < 2000 for status in parts.values()
               for text in (status.message, *values_of(status).values()))
    rig.spin(0.2)
    said = rig.process.text()[before:]
    assert 'x' * 10 in said or send is long_pattern
    assert max(map(len, said.splitlines())) < 2000 and LONG[:1000] not in said


def test_after_an_absurd_image_the_memory_goes_back(rig):
    send_good(rig, 20)
    before = rig.process.memory()
    for size in ((5000, 7000), (3000, 7000)):  # 105 MB and 63 MB
        rig.send_image('left', rig.tick(), image_message(np.full((*size, 3), 77, np.uint8)))
        rig.diagnose(lambda p: True, 'it')
    count = [int(values_of(rig.diagnose(lambda p: True, 'it')['inputs'])['left received'])]
    assert count[0] > 20
    assert_good(rig)  # the first pair behind such an image may be lost on its way

    sent = []

    def settled():
        sent.extend(send_good(rig))
        rig.spin(0.1)  # as cameras send; the next image is a frame period away
        return rig.process.memory() < before + 20_000  # kB

    rig.spin_until(settled, 'the memory')
    assert rig.stamps(DEPTH)[-len(sent):] == sent


def test_a_subscriber_with_incompatible_qos_is_told(rig):
    demanding = QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
    subscription = rig.node.create_subscription(Image, 'status/image', print, demanding)
    assert_told(rig, 'range images', DiagnosticStatus.ERROR, 'status/image', 'durability')
    rig.node.destroy_subscription(subscription)
    rig.diagnose(lambda p: 'durability' not in p['range images'].message, 'the end of it')


def helper_process(body):
    """Start a Python process beside the tests, in their domain."""
    code = f'import sys; sys.path.insert(0, "test")\nfrom ros_rig import *\n{body}'
    return subprocess.Popen([sys.executable, '-c', code], cwd=ROOT)


def test_a_subscriber_that_stops_reading_stops_nobody_else(rig):
    reader = helper_process('from sensor_msgs.msg import PointCloud2\n'
                            'rig = Rig(); rig.listen(PointCloud2, "points"); rig.spin(60)')
    try:
        rig.spin_until(lambda: rig.node.count_subscribers('/points'), 'the reader')
        reader.send_signal(signal.SIGSTOP)
        sent = send_good(rig, 20)
        assert rig.stamps(DEPTH) == sent
    finally:
        reader.kill()
        reader.wait()


def test_cameras_that_are_killed_and_come_again_are_measured_again(tmp_path):
    node = NodeProcess(tmp_path / 'log.txt', parameters=PARAMETERS,
                       arguments=['-r', '__ns:=/killed'])
    rig = Rig('/killed')
    rig.listen(PointCloud2, 'points')
    camera_code = ('rig = Rig("/killed"); rig.wait_for_node()\n'
                   'while True: rig.send_pair(stamp=time.time_ns()); rig.spin(0.1)')
    for _ in range(2):
        cameras = helper_process(camera_code)
        try:
            count = len(rig.received['points'])
            rig.spin_until(lambda: len(rig.received['points']) > count + 2, 'points')
        finally:
            cameras.send_signal(signal.SIGKILL)
            cameras.wait()
        rig.diagnose(lambda p: 'any more' in p['inputs'].message, 'dead cameras')
    assert node.stop() == 0
    rig.close()


def test_a_node_that_is_killed_and_started_again_measures_again(tmp_path):
    rig = Rig('/phoenix')
    rig.listen(Image, DEPTH)
    for number in (signal.SIGKILL, signal.SIGINT):
        node = NodeProcess(tmp_path / 'log.txt', parameters=PARAMETERS,
                           arguments=['-r', '__ns:=/phoenix'])
        rig.received[DEPTH].clear()
        rig.first_output(DEPTH)
        assert bytes(rig.good_pair(DEPTH).data) == depth_of(rig)
        assert node.stop(number) == (0 if number == signal.SIGINT else -signal.SIGKILL)
    rig.close()


def test_two_nodes_in_two_namespaces_keep_apart(tmp_path):
    rigs = [Rig(f'/cell/{name}') for name in ('one', 'two')]
    nodes = [NodeProcess(tmp_path / f'{index}.txt', parameters=PARAMETERS,
                         arguments=['-r', f'__ns:={rig.node.get_namespace()}'])
             for index, rig in enumerate(rigs)]
    rigs[1].images = dict(zip(('left', 'right'), scene(disparity=8, seed=9)))
    for rig in rigs:
        rig.listen(Image, DEPTH)
        rig.first_output(DEPTH)
    for rig in rigs:
        assert bytes(rig.good_pair(DEPTH).data) == depth_of(rig)
    for rig, node in zip(rigs, nodes):
        assert rig.received[DEPTH][-1].header.frame_id
        assert node.stop() == 0
        rig.close()


def test_a_full_disk_fails_the_save_and_leaves_no_file(rig):
    saved = rig.saved
    pid = rig.process.process.pid
    limits = resource.prlimit(pid, resource.RLIMIT_FSIZE)
    timer = rig.node.create_timer(0.1, lambda: rig.send_pair(stamp=time.time_ns()))
    try:
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (16384, limits[1]))
        answer = rig.call(Trigger, '/range_node/save', Trigger.Request())
        assert not answer.success
        assert f'{saved}' in answer.message and 'cannot be written' in answer.message
        assert list(saved.iterdir()) == []
        resource.prlimit(pid, resource.RLIMIT_FSIZE, limits)
        answer = rig.call(Trigger, '/range_node/save', Trigger.Request())
        assert answer.success, answer.message
        assert len(list(saved.iterdir())) == 1
    finally:
        resource.prlimit(pid, resource.RLIMIT_FSIZE, limits)
        rig.node.destroy_timer(timer)


def publish_time(clock, stamp):
    """Publish a time, ns, as a simulator or a player does."""
    message = Clock()
    message.clock.sec, message.clock.nanosec = divmod(stamp, SECOND)
    clock.publish(message)


def test_a_clock_that_is_set_back_is_followed(tmp_path):
    node = NodeProcess(tmp_path / 'log.txt', parameters={**PARAMETERS, 'use_sim_time': True},
                       arguments=['-r', '__ns:=/sim'])
    rig = Rig('/sim', clock_start=1000 * SECOND)
    clock = rig.node.create_publisher(Clock, '/clock', 10)
    rig.listen(Image, DEPTH)

    def send():
        publish_time(clock, rig.tick())
        return rig.send_pair(stamp=rig.stamp)

    deadline = time.monotonic() + 60.0
    while not rig.received[DEPTH] and time.monotonic() < deadline:
        send()
        rig.spin(0.2)
    rig.await_output(DEPTH, send())
    rig.stamp = 5 * SECOND
    for _ in range(3):
        rig.await_output(DEPTH, send())
    parts = rig.diagnose(lambda p: values_of(p['inputs'])['jumps of time'] != '0', 'the jump')
    assert parts['inputs'].message == 'pairs arrive'
    assert node.stop() == 0
    rig.close()


def test_a_recording_in_a_loop_with_its_clock_gives_the_same_each_time(tmp_path):
    """Do what `ros2 bag play --clock --loop` does: clock and stamps begin anew in each turn."""
    node = NodeProcess(tmp_path / 'log.txt', parameters={**PARAMETERS, 'use_sim_time': True},
                       arguments=['-r', '__ns:=/loop'])
    rig = Rig('/loop', clock_start=1000 * SECOND)
    clock = rig.node.create_publisher(Clock, '/clock', 10)
    rig.listen(Image, DEPTH)
    rig.wait_for_node()
    first, count, images, turns = rig.stamp, 4, dict(rig.images), []

    def play(index):
        rig.stamp = first + index * rig.period
        publish_time(clock, rig.stamp)
        rig.images = {side: np.roll(image, index, axis=0) for side, image in images.items()}
        return rig.send_pair(stamp=rig.stamp, infos=index == 0)

    deadline = time.monotonic() + 60.0
    while not rig.received[DEPTH] and time.monotonic() < deadline:
        for index in range(count):
            play(index)
            rig.spin(0.2)
    for _ in range(3):
        rig.spin(0.3)
        rig.received[DEPTH].clear()
        turns.append([bytes(rig.await_output(DEPTH, play(index)).data)
                      for index in range(count)])
    assert turns[0] == turns[1] == turns[2] and len(set(turns[0])) == count
    parts = rig.diagnose(lambda p: int(values_of(p['inputs'])['jumps of time']) >= 3, 'the jumps')
    assert parts['inputs'].message == 'pairs arrive'
    assert node.stop() == 0
    rig.close()


def test_outputs_come_and_go_with_their_subscribers(rig):
    for topic in ('points', 'status/image', 'points'):
        kind = PointCloud2 if topic == 'points' else Image
        subscription = rig.listen(kind, topic)
        rig.spin_until(lambda: rig.node.count_subscribers(f'/{topic}'), topic)
        rig.spin(0.2)
        stamp = rig.send_pair()
        rig.await_output(topic, stamp)
        rig.await_output(DEPTH, stamp)
        rig.node.destroy_subscription(subscription)


def test_memory_does_not_grow_with_the_pairs(rig, effort):
    messages = {side: image_message(image) for side, image in rig.images.items()}

    def send(count):
        for index in range(count):
            stamp = rig.send_pair(infos=index % 100 == 0, **messages)
            if index % 20 == 19:
                rig.await_output(DEPTH, stamp)
                rig.received[DEPTH].clear()

    send(1000)
    before = rig.process.memory()
    send(effort.count(2000, 9000))
    assert rig.process.memory() < 1.01 * before

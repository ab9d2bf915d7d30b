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
"""What /diagnostics says: the state of the sensor in the order in which one would look."""

import os
from pathlib import Path
import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.qos import QoSProfile

from ...core.account import (
    doubt_about_projector, doubt_about_ranges, doubt_about_rivals, doubts_about_rows,
    rows_in_words, status_shares, SUSPICIOUS)
from ...core.patterns.seen import Seen
from ...errors import bounded
from ...messages.health import health_values, needs_care, UNKNOWN
from ...messages.synchronizer import SIDES

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
MEASURING = 'measuring'


class Diagnostics:
    """
    Publishes /diagnostics every output.diagnostics_period.

    Parameters
    ----------
    node : rclpy.node.Node
    sensor : RangeSensor

    """

    def __init__(self, node, sensor):
        self._node, self._sensor = node, sensor
        self._publisher = node.create_publisher(
            DiagnosticArray, '/diagnostics', QoSProfile(depth=1),
            event_callbacks=PublisherEventCallbacks(use_default_callbacks=False))  # see `qos`
        self._timer = node.create_timer(sensor.settings.output.diagnostics_period, self.publish,
                                        clock=Clock(clock_type=ClockType.STEADY_TIME))

    def configure(self, settings):
        """Take new settings."""
        self._timer.timer_period_ns = round(settings.output.diagnostics_period * 1e9)

    def publish(self):
        """Publish the diagnostics now."""
        self._publisher.publish(_diagnostic_array(
            self._sensor, self._node.get_fully_qualified_name(),
            self._node.get_clock().now().to_msg()))

    def destroy(self):
        """Leave the topic."""
        self._node.destroy_timer(self._timer)
        self._node.destroy_publisher(self._publisher)


def _diagnostic_array(sensor, name, stamp):
    """Return the DiagnosticArray: a summary, inputs, calibration, health, pattern, ranges."""
    judges = {'inputs': _inputs, 'calibration': _calibration,
              'calibration health': _calibration_health, 'pattern': _pattern,
              'range images': _range_images}
    parts = {part: judge(sensor) for part, judge in judges.items()}
    parts = {'summary': _summary(sensor, parts), **parts}
    message = DiagnosticArray()
    message.header.stamp = stamp
    for part, (level, text, values) in parts.items():
        message.status.append(DiagnosticStatus(
            level=level, name=f'{name.lstrip("/")}: {part}', message=bounded(text),
            hardware_id=name,
            values=[KeyValue(key=key, value=_text(value)) for key, value in values.items()]))
    return message


def _summary(sensor, parts):
    """Say in one line how the sensor is, and what should be looked after first."""
    account, doubts = sensor.worker.account, sensor.worker.doubts
    values = {}
    if account.result is not None:
        values['rows'] = rows_in_words(account.result)
    seen = _seen(sensor)  # the last of all that a look at a pair finds out
    if seen is not None:
        values |= {'exposure': doubts.exposure.sentence(), 'pattern': seen.sentence}
    level = max(level for level, _, _ in parts.values())
    troubles = [f'{part}: {text}' for part, (its, text, _) in parts.items() if its != OK]
    if troubles:
        return level, '; '.join(troubles), values
    text, more = parts['range images'][1:]
    if text != MEASURING or account.result is None:
        return level, text, values
    told = [f'{text}: {more["rate (Hz)"]:.1f} Hz, {more["share valid"]:.0%} of the pixels, '
            f'{more["latency p50 (ms)"] or 0:.0f} ms']
    return level, '; '.join([*told, *values.values()]), values


def _seen(sensor):
    """Return what the last pair that was looked at shows of the pattern that is set, or None."""
    seen, result = sensor.worker.doubts.pattern, sensor.worker.account.result
    if seen is None or seen.kind != sensor.settings.pattern.type:
        return None
    rivals = None if result is None else doubt_about_rivals(result)
    return Seen(rivals, False, seen.kind) if rivals else seen


def _text(value):
    if value is None:
        return 'unknown'
    return f'{value:.4g}' if isinstance(value, float) else bounded(str(value))


def _milliseconds(nanoseconds):
    return None if nanoseconds is None else nanoseconds / 1e6


def _inputs(sensor):
    """Judge arrival, QoS and pairing of the images."""
    inputs = sensor.inputs
    report = inputs.synchronizer.report()
    values = {'pairs': report.pairs, 'pairs dropped for newer ones': sensor.worker.dropped,
              'tolerance (ms)': report.tolerance / 1e6,
              'frame period (ms)': _milliseconds(report.period),
              'skew, median (ms)': _milliseconds(report.skew_median),
              'skew, largest (ms)': _milliseconds(report.skew_largest),
              'jumps of time': report.jumps, 'clock': sensor.capture.relation.sentence()}
    drift = sensor.capture.relation.drift
    if drift is not None:
        values['drift of the clock (ppm)'] = drift * 1e6
    for side in SIDES:
        values |= {f'{side} received': report.received[side],
                   f'{side} refused': inputs.refused[side],
                   f'{side} without partner': report.unmatched[side],
                   f'{side} late': report.late[side]}
    for subscription in inputs.subscriptions:
        values[subscription.name] = (f'{len(subscription.publishers)} publishers, subscribed '
                                     f'{subscription.kind}')
    return (*_judge_inputs(sensor, report), values)


def _judge_inputs(sensor, report):
    inputs = sensor.inputs
    mismatches = [f'{subscription.name}: incompatible QoS, {subscription.mismatch}'
                  for subscription in inputs.subscriptions if subscription.mismatch]
    if mismatches:
        return ERROR, '; '.join(mismatches)
    refusal = inputs.refusal()
    if refusal:
        return ERROR, '; '.join([refusal, *inputs.shared])
    warnings = [*filter(None, [inputs.complaint(sensor.settings.sync.warn_after)]),
                *inputs.shared, *_oddities(sensor, report)]
    if warnings:
        return WARN, '; '.join(warnings)
    if report.pairs == 0:
        return OK, 'waiting for the first pair'
    return OK, 'pairs arrive'


def _oddities(sensor, report):
    """Return what is odd about images that are measured all the same."""
    if sensor.inputs.zero_stamps:
        yield 'the stamps are zero: pairs cannot be told apart'
    elif report.period and report.tolerance > report.period / 2:
        yield (f'sync.tolerance = {report.tolerance / 1e6:.1f} ms exceeds half the frame period '
               f'of {report.period / 1e6:.1f} ms: frames may be mixed up')
    yield from filter(None, dict(sensor.inputs.color_doubts).values())
    doubt = sensor.worker.values.doubt(sensor.settings.input.significant_bits)
    if doubt:
        yield doubt


def _calibration(sensor):
    """Judge the CameraInfo messages."""
    watch = sensor.inputs.calibration
    values = {f'{side} camera_info received': watch.received[side] for side in SIDES}
    values['calibrations taken'] = watch.changes
    if watch.error is not None:
        return ERROR, watch.error, values
    if watch.calibration is None:
        return WARN, _about_no_calibration(watch), values
    geometry = watch.calibration.geometry
    values |= {'size (px)': f'{geometry.width} x {geometry.height}',
               'focal length (px)': geometry.focal_x, 'baseline (m)': geometry.baseline,
               'cx left - cx right (px)': geometry.principal_offset}
    result = sensor.worker.account.result
    rows = [] if result is None else doubts_about_rows(result)
    values |= _rows(result)
    warnings = [*watch.warnings, *filter(None, [sensor.inputs.frame_warning]), *rows]
    if warnings:
        return WARN, '; '.join(warnings), values
    return OK, 'calibrated', values


def _rows(result):
    """Return what the latest pair showed of the rows of the two views."""
    if result is None or result.alignment is None:
        return {}
    alignment = result.alignment
    if not alignment.known:
        return {'row error': 'not observable' if not alignment.observable else 'unknown'}
    error, place = alignment.largest()
    return {'row error (px)': error, 'row error, largest': place,
            'row error, standard deviation (px)': float(alignment.std[0]),
            'rows corrected': bool(alignment.applied.any())}


def _calibration_health(sensor):
    """Judge by how much the cameras have moved since they were calibrated."""
    result = sensor.worker.account.result
    if result is None:
        return OK, 'no pair has been measured yet', {}
    if result.health is None:
        return OK, UNKNOWN, {}
    level = WARN if needs_care(result.health) else OK
    return level, result.health.sentence(), health_values(result.health)


def _about_no_calibration(watch):
    if watch.missing:
        return f'no {" and no ".join(watch.missing)} camera_info has arrived yet'
    return 'one camera_info has changed, waiting for the other one'


def _pattern(sensor):
    """Judge what pattern_node shows."""
    watch = sensor.pattern
    values = {'pattern.type': sensor.settings.pattern.type}
    result = sensor.worker.account.result
    track = None if result is None else result.projector
    doubt = None
    seen = _seen(sensor)
    if seen is not None:
        values['seen'] = seen.sentence
        few = seen.gray and result is not None and result.density < SUSPICIOUS
        doubt = seen.sentence if seen.agrees is False or few else None
    if track is not None:
        values |= _projector(track)
        doubt = doubt or doubt_about_projector(track, shown=watch.known and not watch.mismatch)
    if watch.mismatch:
        return WARN, watch.mismatch, values
    if doubt:
        return WARN, doubt, values
    if not watch.known:
        return OK, 'the projected pattern is unknown: no message on pattern/info', values
    return OK, 'the pattern shown is the one that is set', values


def _projector(track):
    """Return what the latest pair showed of the projector."""
    values = {'projector': track.sentence()}
    if track.usable:
        x, y, z = track.model.center
        std = track.model.center_std
        values |= {'projector, place from the left camera (m)': f'{x:.4f} {y:.4f} {z:.4f}',
                   'projector, standard deviation of the place (m)': float(std.max()),
                   'projector, matches': track.model.matches}
    return values


def _range_images(sensor):
    """Judge the results and their speed."""
    worker, account = sensor.worker, sensor.worker.account
    values = {'rate (Hz)': account.rate(time.monotonic()), 'measured': account.measured,
              'failed': account.failed, 'without calibration': account.uncalibrated,
              'latency p50 (ms)': _scaled(account.latency(50)),
              'latency p99 (ms)': _scaled(account.latency(99)),
              'memory of the node (MB)': _memory(),
              'subscribed': ', '.join(sensor.outputs.wanted()) or 'nothing',
              'skipped for want of a subscriber': sensor.skipped,
              'calls of ~/capture that wait': sensor.capture.waiting}
    shares = {}
    if account.result is not None:
        shares = status_shares(account.result.status)
        values |= {f'share {name}': share for name, share in shares.items()}
    return (*_judge_results(sensor, worker, account, shares), values)


def _memory():
    """Return the resident memory of this process, MB; None where the system does not tell."""
    try:
        pages = int(Path('/proc/self/statm').read_text().split()[1])
    except (OSError, ValueError, IndexError):
        return None
    return pages * os.sysconf('SC_PAGE_SIZE') / 1e6


def _scaled(seconds):
    return None if seconds is None else seconds * 1000.0


def _judge_results(sensor, worker, account, shares):
    if not sensor.active:
        return OK, 'inactive'
    if worker.state != 'ready':
        return WARN, worker.state
    if account.error is not None:
        return ERROR, account.error
    if sensor.outputs.mismatches:
        return ERROR, '; '.join(f'{topic}: a subscriber has incompatible QoS, {policy}'
                                for topic, policy in sensor.outputs.mismatches.items())
    if sensor.settings.input.mode == 'capture':
        return OK, 'waiting for a call of ~/capture (input.mode is capture)'
    if not sensor.outputs.wanted():
        return OK, f'waiting for a subscriber on {", ".join(sensor.outputs.names)}'
    few = doubt_about_ranges(shares) if shares else None
    if few:
        few += f' (few pixels have a range: {shares["valid"]:.1%})'
    alone = worker.lost and f'{worker.lost}: left camera and projector measure without it'
    doubts = [*filter(None, [alone]), *sensor.worker.doubts.current, *filter(None, [few])]
    if doubts:
        return WARN, '; '.join(doubts)
    return OK, MEASURING if account.measured else 'waiting for the first pair'

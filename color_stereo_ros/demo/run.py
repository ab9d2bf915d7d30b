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
"""What `color_stereo demo` does: start the nodes, play, collect, compare, write."""

from datetime import datetime
import os
import platform
import shutil
import time

import numpy as np
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from stereo_msgs.msg import DisparityImage

from .layout import RECORDING, SETTINGS, TRUTH
from .page import (DEFAULT_METHOD, depth_preview, make_page, Measurement, one_line, overview,
                   page_limits)
from .plots import surface_plot
from ..core import RangeResult, RecordingError, StereoCalibration
from ..core.false_color import range_limits
from ..core.legends import with_scale_bar
from ..core.settings import updated
from ..core.surface.third.fusion import PROJECTOR
from ..core.triangulation import disparity_from_depth, disparity_limits
from ..evaluation.datasets import load_truth
from ..files.atomic import write_bytes, write_text
from ..files.claim import held
from ..files.cloud import save_cloud
from ..files.image import write_image
from ..messages.outputs import millimeters
from ..messages.published import values_of
from ..messages.reading import image_to_rgb
from ..nodes.live import Collector, latched, LiveError, Processes, ros_node, spin_until
from ..nodes.sensor.projector_search import expects_projector
from ..nodes.sensor.worker import COMPILING, READY
from ..parameters.files import read_settings
from ..parameters.groups import RangeNodeSettings
from ..recordings.reading import Recording

OUTPUTS = {'depth/image': Image, 'depth/camera_info': CameraInfo, 'points': PointCloud2,
           'disparity': DisparityImage, 'range_image': Image, 'confidence/image': Image,
           'status/image': Image, 'status_picture': Image, 'views/image': Image}

LOG = 'log'
MARK = '.color_stereo_demo'  # says that a demo made the folder, and may remove it
SLOWEST_START = 120.0  # s from the start of range_node to "ready", kernels loaded, not compiled
PROJECTOR_WAIT = 15.0  # s from the first output until the projector is found, or two views count
NOTE_EVERY = 3.0  # s between two signs that the demo goes on

COMMANDS = """\
color_stereo replay {recording} --loop
ros2 run color_stereo_ros range_node --ros-args --params-file {settings}
ros2 run color_stereo_ros pattern_node --ros-args --params-file {settings}
ros2 topic echo --no-arr points
"""


class Demo:
    """
    One run of the demonstration.

    Parameters
    ----------
    samples, output : Path
    wait : float
        s that range_node may take from being ready to its first complete output.

    Raises
    ------
    RecordingError
        If there are no samples, or one is damaged.

    """

    def __init__(self, samples, output, wait):
        self.samples = sorted(path.parent for path in samples.glob(f'*/{RECORDING}'))
        if not self.samples:
            raise RecordingError(f'{samples}: holds no folder with a {RECORDING}')
        self.output = output
        self.wait = wait
        self._start = time.monotonic()
        self._waiting_for = None

    @property
    def first(self):
        """Return the folder of the first sample on the page."""
        return default_first(self.samples)[0]

    def run(self):
        """Return the path of the page."""
        whole = self.output.resolve()
        with held(whole.with_name(f'.{whole.name}.color_stereo_demo'), self.output):
            return self._run()

    def _run(self):
        self._make_room()
        write_text(self.output / MARK,
                   'Made by `color_stereo demo`, which replaces this folder.\n')
        samples = default_first(self.samples)
        with ros_node('color_stereo_demo') as node:
            measurements = [self._measure(node, folder) for folder in samples]
        self._say('writing the page')
        limits = page_limits(measurements)
        for measurement in measurements:
            write_bytes(self.output / measurement.name / 'surface.png',
                        surface_plot(measurement.points, *limits))
        write_image(self.output / 'overview.png', overview(measurements[0], limits))
        page = self.output / 'index.html'
        made = (f'Made on {datetime.now():%Y-%m-%d %H:%M} with {os.cpu_count()} processor cores, '
                f'Python {platform.python_version()}.')
        first = samples[0]
        write_text(page, make_page(measurements, made, COMMANDS.format(
            recording=first / RECORDING, settings=first / SETTINGS)))
        return page

    def _make_room(self):
        """Remove the output of an earlier run, and nothing else."""
        if not self.output.exists() or not any(self.output.iterdir()):
            return
        if not (self.output / MARK).is_file():
            raise RecordingError(f'{self.output}: holds something else than the output of an '
                                 'earlier demo, so it is not replaced')
        shutil.rmtree(self.output)

    def _say(self, text, end='\n'):
        if self._waiting_for is not None:
            print()
            self._waiting_for = None
        print(f'[{time.monotonic() - self._start:5.1f} s] {text}', end=end, flush=True)

    def _note(self, text):
        """Say what is waited for, once; a dot each time shows that something goes on."""
        if text != self._waiting_for:
            self._say(text, end=' ')
            self._waiting_for = text
        print('.', end='', flush=True)

    def _measure(self, node, folder):
        """Return the measurement of one sample and write its files."""
        left, right, calibration = first_pair(folder / RECORDING)
        truth = load_truth(folder / TRUTH)
        settings = settings_of(folder)
        messages, pattern, seconds = self._play(node, folder)
        result = result_from(messages, calibration, settings)
        measurement = Measurement(
            name=folder.name, method=settings.matching.method, left=left, right=right,
            pattern=pattern, range_image=labeled(messages['range_image'], result, settings),
            status_picture=image_to_rgb(messages['status_picture']), result=result,
            points=points_from(messages['points']), truth=truth, seconds=seconds)
        self._say(f'{folder.name}: {one_line(measurement)}')
        write_files(self.output / folder.name, measurement)
        return measurement

    def _play(self, node, folder):
        """Return the outputs of one stamp, the pattern and the time to the first output."""
        name = folder.name
        collector = Collector(node, name, OUTPUTS)
        patterns = latched(node, Image, f'/{name}/pattern/image')
        ros = ('--ros-args', '-r', f'__ns:=/{name}', '--params-file', folder / SETTINGS)
        with Processes(self.output / LOG) as processes:
            self._say(f'{name}: starting pattern_node and range_node, playing the recording')
            processes.start(f'{name}_pattern_node', 'color_stereo_ros.nodes.pattern_node', *ros)
            started = time.monotonic()
            processes.start(f'{name}_range_node', 'color_stereo_ros.nodes.range_node', *ros)
            processes.start(f'{name}_replay', 'color_stereo_ros.cli.main', 'replay',
                            folder / RECORDING, '--loop', '--namespace', name)
            self._wait(node, processes, name, lambda: patterns and collector.complete_set(),
                       collector, patterns)
            seconds = time.monotonic() - started
            self._say(f'{name}: everything received, {seconds:.1f} s after the start')
            messages = collector.complete_set()
            if expects_projector(settings_of(folder).core):
                messages = self._with_projector(node, processes, name, collector) or messages
        collector.close()
        return messages, image_to_rgb(patterns[-1]), seconds

    def _with_projector(self, node, processes, name, collector):
        """Return the outputs of one stamp for which the projector was a view, None without."""
        self._say(f'{name}: the projector is searched')

        def seen():
            message = collector.latest('views/image')
            return message is not None and (values_of(message) & PROJECTOR).any()

        if not spin_until(node, seen, PROJECTOR_WAIT, processes.check):
            self._say(f'{name}: not found; two views count')
            return None
        collector.forget()  # a recording in a loop has its stamps again: none may be mixed
        spin_until(node, collector.complete_set, PROJECTOR_WAIT, processes.check)
        return collector.complete_set()

    def _wait(self, node, processes, name, condition, collector, patterns):
        """
        Spin until the condition holds.

        `wait` begins when range_node is ready. Before that it may take SLOWEST_START to start,
        however short `wait` is, and any time to compile its kernels. A look in which it goes from
        one of these to the next does not count.

        """
        left, before = max(self.wait, SLOWEST_START), waiting_for('')
        while left > 0:
            begin = time.monotonic()
            if spin_until(node, condition, min(NOTE_EVERY, left), processes.check):
                return
            log = processes.log(f'{name}_range_node')
            if waiting_for(log) != before:
                left, before = self.wait, waiting_for(log)
            elif not is_compiling(log):
                left -= time.monotonic() - begin
            self._note(f'{name}: {before}')
        self._say(f'{name}: giving up')
        said = f'range_node said:\n{processes.log_tail(f"{name}_range_node")}'
        if before == waiting_for(''):
            raise LiveError(f'{name}: range_node was not ready after '
                            f'{max(self.wait, SLOWEST_START):.0f} s. {said}')
        missing = [topic for topic, count in collector.received.items() if not count]
        missing += [] if patterns else ['pattern/image']
        raise LiveError(
            f'{name}: no complete output within {self.wait:.0f} s (--wait SECONDS waits longer); '
            'nothing came on '
            f'{", ".join(missing) or "no topic, but never all of one stamp"}. {said}')


def settings_of(folder):
    """Return the RangeNodeSettings of a sample."""
    return updated(RangeNodeSettings(), read_settings(folder / SETTINGS, RangeNodeSettings()))


def default_first(samples):
    """Return the folders of samples, those of the default method before the others."""
    return sorted(samples, key=lambda folder: (
        settings_of(folder).matching.method != DEFAULT_METHOD, folder.name))


def labeled(message, result, settings):
    """Return a published range image with its scale bar, RGB."""
    limits = range_limits(result.depth, settings.range, settings.output.range_limits)
    return with_scale_bar(image_to_rgb(message), *limits, settings.output.range_colors)


def is_compiling(log):
    """Tell from its log whether range_node compiles its kernels now."""
    return COMPILING in log and READY not in log


def waiting_for(log):
    """Return what a demo waits for, as text, from the log of range_node."""
    if is_compiling(log):
        return 'range_node is compiling its kernels, which takes up to a minute and is not counted'
    return f'range_node is {"ready; its outputs are awaited" if READY in log else "starting"}'


def first_pair(recording):
    """Return (left, right, StereoCalibration) of the first pair in a recording."""
    with Recording(recording) as opened:
        topics = opened.stereo_topics()
        found = {}
        for message in opened.messages(topics.names):
            found.setdefault(message.topic, opened.decoded(message))
            if len(found) == len(topics.names):
                break
    calibration = StereoCalibration.from_camera_info(found[topics.left_info],
                                                     found[topics.right_info])
    return (image_to_rgb(found[topics.left_image]), image_to_rgb(found[topics.right_image]),
            calibration)


def points_from(message):
    """Return x, y, z of an organized cloud of 16 bytes a point, float32 (H, W, 3)."""
    return _cloud(message)[..., :3]


def _cloud(message):
    values = np.frombuffer(message.data, np.float32)
    return values.reshape(message.height, message.width, message.point_step // 4)


def result_from(messages, calibration, settings):
    """Return the RangeResult that a set of published messages amounts to."""
    geometry = calibration.geometry
    depth = values_of(messages['depth/image'])
    color = _cloud(messages['points'])[..., 3:].copy().view(np.uint8)
    return RangeResult(
        disparity=disparity_from_depth(depth, geometry), depth=depth,
        confidence=values_of(messages['confidence/image']),
        status=values_of(messages['status/image']), views=values_of(messages['views/image']),
        disparity_std=np.full(depth.shape, np.nan, np.float32), image_source=color[..., 2::-1],
        geometry=geometry, disparity_limits=disparity_limits(geometry, settings.range))


def write_files(folder, measurement):
    """Write what does not depend on the other measurements into a folder."""
    result = measurement.result
    write_image(folder / 'range_image.png', measurement.range_image)
    write_image(folder / 'depth_mm.png', millimeters(result.depth))
    write_image(folder / 'depth_preview.png', depth_preview(result.depth))
    write_image(folder / 'status.png', measurement.status_picture)
    save_cloud(folder / 'points.ply', measurement.points, result.image)

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
"""The service ~/save: the points of what was captured, as a file."""

import os
from pathlib import Path

from ...errors import brief, ColorStereoError, RecordingError, SettingsError
from ...files.cloud import save_cloud
from ...messages.reading import stamp_ns
from ...messages.trimming import trimmed


_SUFFIXES = '.ply', '.pcd'
_FIXED = 'save_directory', 'save_limit'


class SaveFolder:
    """
    Where files may be written: inside of the folder that was given when the node started.

    Any peer of the network can set parameters. What it sets never leads out of that folder,
    neither by an absolute path, nor by `..`, nor by a symbolic link.

    Parameters
    ----------
    settings : OutputSettings
        At the start of the node.

    """

    def __init__(self, settings):
        self._start = settings
        self._root = os.path.realpath(settings.save_directory or '.')

    def check(self, settings):
        """Refuse OutputSettings that a peer may not set, by a SettingsError."""
        fixed = ('save_directory_fixed', *(_FIXED if self._start.save_directory_fixed else ()))
        for name in fixed:
            value, own = getattr(settings, name), getattr(self._start, name)
            if value != own:
                raise SettingsError(
                    f'output.{name} = {brief(value)} is refused: it stays {brief(own)} while the '
                    'node runs (output.save_directory_fixed); set it at the start')
        self.path(settings)

    def path(self, settings):
        """
        Return the folder to write to, whether it is there or not.

        Parameters
        ----------
        settings : OutputSettings
            The group `output` of the parameters.

        Returns
        -------
        folder : Path

        Raises
        ------
        SettingsError
            If it lies outside of the folder given at the start.

        """
        name = settings.save_directory
        folder = '' if name == self._start.save_directory else name
        try:
            real = os.path.realpath(os.path.join(self._root, folder))
            inside = os.path.commonpath([self._root, real]) == self._root
        except (OSError, ValueError) as error:
            raise SettingsError(f'output.save_directory = {brief(name)} is no path: '
                                f'{error}') from error
        if not inside:
            raise SettingsError(f'output.save_directory = {brief(name)} leads to {brief(real)}, '
                                f'outside of {brief(self._root)}, the folder given at the start')
        return Path(real)


class Save:
    """
    Writes the points of the last capture, or of a new pair when streaming.

    Parameters
    ----------
    node : rclpy.node.Node
    services : ServiceThread
    sensor : RangeSensor
    capture : Capture
    folder : SaveFolder

    """

    def __init__(self, node, services, sensor, capture, folder):
        self._node, self._sensor, self._capture = node, sensor, capture
        self._folder = folder
        services.create('~/save', self._serve)

    def _serve(self, reply):
        if self._sensor.settings.input.mode == 'capture':
            self._answer(reply, self._capture.latest)
        elif self._does(reply, lambda: self._room(self._sensor.settings.output)):
            self._capture.request(reply, lambda outcome: self._answer(reply, outcome))

    def _answer(self, reply, outcome):
        text = self._does(reply, lambda: self._saved(outcome))
        if text:
            reply(True, text)

    def _does(self, reply, step):
        """Return what a step returns; where it fails, answer with the reason and return None."""
        try:
            return step()
        except ColorStereoError as error:
            self._node.get_logger().error(f'save: {error}')
            reply(False, str(error))
            return None

    def _saved(self, outcome):
        """Write a file; return its path and how many points it holds."""
        settings = self._sensor.settings
        folder = self._room(settings.output)
        if outcome is None:
            raise RecordingError('nothing has been captured yet: call ~/capture first')
        if outcome.result is None:
            raise RecordingError(outcome.failure)
        context = outcome.context
        path = self._free_name(folder, stamp_ns(context.header), settings.output.save_format)
        shown = trimmed(outcome.result, context)
        points = shown.points()
        if settings.output.frame == 'camera':
            points = points @ context.rotation.T.astype(points.dtype)
        count = save_cloud(path, points, shown.image)
        return f'{path}: {count} points'

    def _room(self, settings):
        """Return the folder, in which there must be room for another file."""
        folder = self._folder.path(settings)
        if not folder.is_dir():
            raise RecordingError(f'output.save_directory = {str(folder)!r} is no directory')
        try:
            names = os.listdir(folder)
        except OSError as error:
            raise RecordingError(f'{folder} cannot be read: {error.strerror}') from error
        own = [name for name in names if name.startswith(f'{self._node.get_name()}_')
               and name.endswith(_SUFFIXES)]
        if len(own) >= settings.save_limit:
            raise RecordingError(f'{folder} holds {len(own)} files of this node, '
                                 f'output.save_limit = {settings.save_limit}: move some away, or '
                                 'start the node with a larger limit')
        return folder

    def _free_name(self, folder, stamp, suffix):
        """Return the path of a new file; nothing is replaced."""
        name = f'{self._node.get_name()}_{stamp}'
        path, count = folder / f'{name}.{suffix}', 1
        while os.path.lexists(path):
            count += 1
            path = folder / f'{name}_{count}.{suffix}'
        return path

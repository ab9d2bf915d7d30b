# SPDX-License-Identifier: Apache-2.0
"""The service ~/save: the points of what was captured, as a file."""

from pathlib import Path

from ...errors import RecordingError
from ...files.cloud import save_cloud
from ...messages.reading import stamp_ns


class Save:
    """
    Writes the points of the last capture, or of a new pair when streaming.

    Parameters
    ----------
    node : rclpy.node.Node
    services : ServiceThread
    sensor : RangeSensor
    capture : Capture

    """

    def __init__(self, node, services, sensor, capture):
        self._node, self._sensor, self._capture = node, sensor, capture
        services.create('~/save', self._serve)

    def _serve(self, _, response):
        try:
            response.message = self._saved()
            response.success = True
        except RecordingError as error:
            response.success = False
            response.message = str(error)
            self._node.get_logger().error(f'save: {error}')
        return response

    def _saved(self):
        """Write a file; return its path and how many points it holds."""
        settings = self._sensor.settings
        streaming = settings.input.mode == 'stream'
        request = self._capture.measure() if streaming else self._capture.latest
        if request is None:
            raise RecordingError('nothing has been captured yet: call ~/capture first')
        if request.result is None:
            raise RecordingError(request.failure or 'the node is shutting down')
        folder = Path(settings.output.save_directory or '.')
        if not folder.is_dir():
            raise RecordingError(f'output.save_directory = {str(folder)!r} is no directory')
        name = f'{self._node.get_name()}_{stamp_ns(request.header)}.{settings.output.save_format}'
        points = request.result.points()
        if settings.output.frame == 'camera':
            points = points @ request.rotation.T.astype(points.dtype)
        count = save_cloud(folder / name, points, request.result.image)
        return f'{folder / name}: {count} points'

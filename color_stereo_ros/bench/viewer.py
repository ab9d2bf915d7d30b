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
Processor time of the server of `color_stereo view` for each update: the goal is 8 ms.

Run `python -m color_stereo_ros.bench.viewer`. A program that takes the place of a browser reads
all that is sent. Everything that this process does for an update counts: pictures, points, JPEG,
and what viser does to send them.

"""

import argparse
import multiprocessing
import time

from ..cli.process import SAMPLE
from ..core import StereoCalibration
from ..core.settings import updated
from ..parameters.files import read_settings
from ..parameters.groups import RangeNodeSettings
from ..viewer.page import PERIOD, ViewPage
from ..viewer.sources import FileFrames


def read_all(address, connected):
    """Connect as a browser does, set an event, and read what comes until the server ends."""
    import viser
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.client import connect
    try:
        with connect(address, subprotocols=[f'viser-v{viser.__version__}'],
                     max_size=None, compression=None) as socket:
            for _ in socket:
                connected.set()
    except (ConnectionClosed, OSError):
        pass


def measured(updates, moving):
    """
    Return what an update costs.

    Parameters
    ----------
    updates : int
        Pictures that are sent.
    moving : bool
        As `ViewPage.show` takes it.

    Returns
    -------
    milliseconds : float
        Of processor time, the mean.

    """
    settings = RangeNodeSettings()
    settings = updated(settings, read_settings(SAMPLE / 'settings.yaml', settings))
    calibration = StereoCalibration.from_yaml(SAMPLE / 'left.yaml', SAMPLE / 'right.yaml')
    frame = FileFrames.of_folder(SAMPLE, calibration, settings).frame(0)
    page = ViewPage('127.0.0.1', 0, frame)
    processes = multiprocessing.get_context('spawn')
    connected = processes.Event()
    reader = processes.Process(
        target=read_all, args=[page.address.replace('http', 'ws'), connected], daemon=True)
    reader.start()
    if not connected.wait(60.0):
        raise SystemExit('nothing was sent')
    page.show(frame, moving)
    time.sleep(1.0)
    begin = time.process_time()
    time.sleep(updates * PERIOD)
    idle = time.process_time() - begin
    begin = time.process_time()
    for _ in range(updates):
        page.show(frame, moving)
        time.sleep(PERIOD)
    spent = time.process_time() - begin - idle
    reader.kill()
    page.close()
    return 1e3 * spent / updates


def main(argv=None):
    """Print what an update costs."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--updates', type=int, default=50, metavar='N', help='default 50')
    args = parser.parse_args(argv)
    for moving in (True, False):
        name = 'while frames follow each other' if moving else 'a frame that stands still'
        print(f'{measured(args.updates, moving):6.1f} ms processor time for an update, {name}',
              flush=True)


if __name__ == '__main__':
    main()

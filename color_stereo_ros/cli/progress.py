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
"""Progress bars that also tell something when standard error is a file or a pipe."""

from contextlib import contextmanager
import sys

from tqdm import tqdm

LINE_EVERY = 5.0  # s between two lines in a file


class Progress(tqdm):
    """
    A progress bar on a terminal; elsewhere a line at the start, at the end and now and then.

    Parameters are those of `tqdm.tqdm`.

    """

    def __init__(self, *arguments, **options):
        terminal = sys.stderr.isatty()
        if not terminal:
            options = {'mininterval': LINE_EVERY, 'ncols': 80, **options, 'leave': True}
        super().__init__(*arguments, file=sys.stderr, **options)

    @staticmethod
    def status_printer(file):
        """Return the function that shows a state of the bar."""
        if getattr(file, 'isatty', bool)():
            return tqdm.status_printer(file)

        def show(line):
            if text := line.replace('\r', '').rstrip():
                file.write(f'{text}\n')
                file.flush()
        return show

    def say(self, text):
        """Print a sentence on standard error, above the bar."""
        if sys.stderr.isatty():
            self.write(text, file=sys.stderr)
        else:
            print(text, file=sys.stderr, flush=True)

    @classmethod
    @contextmanager
    def pairing(cls, recording, topics):
        """Yield what takes the sentences and the messages of a pass that finds pairs."""
        with cls(total=sum(recording.counts[topic] for topic in topics.names), unit='message',
                 desc='pairing', leave=False) as progress:
            yield progress.say, lambda message: progress.update()

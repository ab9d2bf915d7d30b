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
What launch files start that ROS 2 brings along: RViz and the player of recordings.

A launch file knows no "if it is installed", and hands on an argument of several words as one word.
These programs know better, and then become the other program: signals reach it.

"""

from importlib.util import find_spec
import os
import shlex
import shutil
import sys

PLAYER = 'ros2', 'bag', 'play', '--clock', '100', '--delay', '3'


def show_rviz(args=None):
    """Become rviz2 with all arguments; where there is none, say so and end with status 0."""
    words = sys.argv[1:] if args is None else args
    program = shutil.which('rviz2')
    if program is None:
        print('rviz:=true, but rviz2 is not installed (ros-jazzy-rviz2): everything else goes on '
              'without it', file=sys.stderr)
        return 0
    return _become(program, ['rviz2', *words])


def play_recording(args=None):
    """
    Become `ros2 bag play` of a recording.

    Parameters
    ----------
    args : list of str, optional
        The recording, and further options of the player: no word, one, or several in one text.
        Default: the command line.

    Returns
    -------
    status : int
        Only if there is nothing to become.

    """
    words = sys.argv[1:] if args is None else args
    if not words or not words[0]:
        print('no recording to play: give bag:=FOLDER', file=sys.stderr)
        return 1
    recording, *options = words
    try:
        options = [word for text in options for word in shlex.split(text)]
    except ValueError as error:
        print(f'play_args = {" ".join(options)}: {error}', file=sys.stderr)
        return 1
    program = shutil.which(PLAYER[0])
    if program is None:
        print('ros2 is not on the PATH: source the setup.bash of ROS 2, or use `color_stereo '
              'replay`, which needs none', file=sys.stderr)
        return 1
    if find_spec('ros2bag') is None:
        print('`ros2 bag` is not installed (ros-jazzy-ros2bag, ros-jazzy-rosbag2-storage-mcap): '
              'install it, or use `color_stereo replay`, which needs none', file=sys.stderr)
        return 1
    return _become(program, [*PLAYER, *options, recording])


def _become(program, words):
    """Replace this process by a program; its arguments begin with its name."""
    sys.stdout.flush()
    sys.stderr.flush()
    os.execv(program, words)

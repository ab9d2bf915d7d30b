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
"""The command line: `python -m color_stereo_ros.evaluation.fits MODEL --output FILE`."""

import argparse
import sys

from .arguments import add_arguments, LIT, MODELS


def main(argv=None):
    """Run the fit that the arguments name; return the exit status."""
    parser = argparse.ArgumentParser(
        prog='python -m color_stereo_ros.evaluation.fits', allow_abbrev=False,
        description='Fit a model of the surface method to simulated scenes with truth.')
    commands = parser.add_subparsers(dest='model', required=True)
    for name, summary in MODELS.items():
        each = commands.add_parser(name, help=summary, description=summary, allow_abbrev=False)
        add_arguments(each)
        if name in LIT:
            each.add_argument('--light', metavar='FOLDER', help='fit to rendered light that '
                              'evaluate --stress keeps; SCENE begins the name of a folder there')
    args = parser.parse_args(argv)
    from .run import run  # compiles for a while, which --help should not
    return run(args.model, args)


if __name__ == '__main__':
    sys.exit(main())

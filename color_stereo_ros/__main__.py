# SPDX-License-Identifier: Apache-2.0
"""The command `color_stereo` where it is not on the PATH: `python -m color_stereo_ros`."""

import sys

from .cli.main import main

if __name__ == '__main__':
    sys.exit(main())

# SPDX-License-Identifier: Apache-2.0
"""Single-shot color range finding with two cameras and a projected color pattern."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version(__name__)
except PackageNotFoundError:  # sources that nobody has installed
    __version__ = 'unknown'

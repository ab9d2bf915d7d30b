# SPDX-License-Identifier: Apache-2.0
"""Single-shot colour range finding with two cameras and a projected colour pattern."""

__version__ = '0.1.0'

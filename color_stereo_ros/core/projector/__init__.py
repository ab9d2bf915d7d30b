# SPDX-License-Identifier: Apache-2.0
"""The projector as a third view: its geometry, found and followed in the pairs themselves."""

from .model import ProjectorModel

__all__ = ['ProjectorModel']

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
"""ROS domains of which one process is sure that nobody else on this machine uses them."""

from random import SystemRandom
import socket

LAST = 100
"""Domains 1 .. 100: the ports of higher ones may be given to other programs (Linux)."""
_held = []


def own_domain():
    """
    Return a ROS domain that no other process of this machine uses, and keep it.

    The middleware gives each participant of a domain ports of its own (DDSI-RTPS, 9.6.1.1). This
    process holds the last port of its domain until it ends, so that the next caller sees that the
    domain is taken. A domain where the first participant listens is taken, too.

    Returns
    -------
    domain : int
        1 .. 100.

    Raises
    ------
    OSError
        If all are taken.

    """
    domains = list(range(1, LAST + 1))
    SystemRandom().shuffle(domains)
    for domain in domains:
        first = 7400 + 250 * domain
        claim = _bound(first + 249)
        if claim is None:
            continue
        nobody = _bound(first + 10)
        if nobody is not None:
            nobody.close()
            _held.append(claim)
            return domain
        claim.close()
    raise OSError(f'all ROS domains 1 .. {LAST} of this machine are in use')


def _bound(port):
    """Return a UDP socket that holds a port of all addresses; None if the port is taken."""
    found = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        found.bind(('', port))
    except OSError:
        found.close()
        return None
    return found

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
"""Which quality of service keeps a publisher and a subscription apart."""

from rclpy.qos import LivelinessPolicy, QoSDurabilityPolicy, QoSReliabilityPolicy


def incompatible_policy(offered, requested):
    """
    Return the policy by which a subscription refuses a publisher, such as 'reliability'.

    The nodes ask for it instead of listening to events: an executor of rclpy goes through every
    event handler at every message, and 30 of them took it a third of a millisecond.

    Parameters
    ----------
    offered, requested : rclpy.qos.QoSProfile
        Of the publisher and of the subscription.

    Returns
    -------
    policy : str or None
        None if they fit: an offer must be as strict as the request (DDS, sec. 2.2.3).

    """
    if (requested.reliability == QoSReliabilityPolicy.RELIABLE
            and offered.reliability == QoSReliabilityPolicy.BEST_EFFORT):
        return 'reliability'
    if (requested.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL
            and offered.durability == QoSDurabilityPolicy.VOLATILE):
        return 'durability'
    if _seconds(offered.deadline) > _seconds(requested.deadline):
        return 'deadline'
    if (requested.liveliness == LivelinessPolicy.MANUAL_BY_TOPIC
            and offered.liveliness == LivelinessPolicy.AUTOMATIC):
        return 'liveliness'
    if (_seconds(offered.liveliness_lease_duration)
            > _seconds(requested.liveliness_lease_duration)):
        return 'liveliness'
    return None


def _seconds(duration):
    """Return a duration in s; zero stands for no limit."""
    return duration.nanoseconds * 1e-9 or float('inf')

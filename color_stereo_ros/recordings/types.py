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
"""The message types of ROS 2 Jazzy as the library `rosbags` knows them, and contents as CDR."""

from dataclasses import fields, is_dataclass
from functools import lru_cache

import numpy as np


@lru_cache(maxsize=1)
def typestore():
    """Return the message types of ROS 2 Jazzy."""
    return new_typestore()


def new_typestore():
    """Return the message types of ROS 2 Jazzy, a set of its own to which types may be added."""
    from rosbags.typesys import Stores, get_typestore
    return get_typestore(Stores.ROS2_JAZZY)


def serialized(content):
    """
    Return the bytes of a message.

    Parameters
    ----------
    content : object
        One of `messages.contents`.

    Returns
    -------
    data : memoryview
        CDR, little endian.

    """
    return typestore().serialize_cdr(_message(content), content.TYPE)


def _message(content):
    """Return a content as an object of rosbags."""
    values = {spec.name: _value(getattr(content, spec.name)) for spec in fields(content)}
    return typestore().types[content.TYPE](**values)


def _value(value):
    if is_dataclass(value):
        return _message(value)
    if isinstance(value, tuple):
        return [_message(item) for item in value]
    return value if isinstance(value, (bool, int, float, str)) else np.asarray(value)

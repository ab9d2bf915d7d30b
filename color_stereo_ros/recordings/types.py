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

from dataclasses import fields, is_dataclass, replace
from functools import lru_cache
import struct

import numpy as np

from ..messages.contents import CompressedImage, Image, PointCloud2

BEHIND_DATA = {Image.TYPE: 0, CompressedImage.TYPE: 0, PointCloud2.TYPE: 1}
"""Types to bytes behind their field `data`, which are not aligned."""
LENGTH = struct.Struct('<I')
NOTHING = np.empty(0, np.uint8)


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


def serialized_parts(content):
    """
    Return the bytes of a message in parts, so that a long field `data` is not copied.

    Parameters
    ----------
    content : object
        One of `messages.contents`.

    Returns
    -------
    parts : tuple of bytes-like
        Joined they are what `serialized` returns.

    """
    if content.TYPE not in BEHIND_DATA:
        return serialized(content),
    data = memoryview(content.data).cast('B')
    around = serialized(replace(content, data=NOTHING))
    end = len(around) - BEHIND_DATA[content.TYPE]
    return around[:end - LENGTH.size], LENGTH.pack(len(data)), data, around[end:]


def _message(content):
    """Return a content as an object of rosbags."""
    names = _names(type(content))
    return typestore().types[content.TYPE](**{name: _value(getattr(content, name))
                                              for name in names})


@lru_cache(maxsize=None)
def _names(kind):
    """Return the names of the fields of a kind of content."""
    return [spec.name for spec in fields(kind)]


def _value(value):
    if isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, tuple):
        return [_message(item) for item in value]
    return _message(value) if is_dataclass(value) else np.asarray(value)

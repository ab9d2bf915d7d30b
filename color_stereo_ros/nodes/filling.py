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
"""Messages of rclpy from contents; their byte arrays are used again."""

from array import array
from dataclasses import fields
from functools import lru_cache
import importlib

import numpy as np

from ..messages.contents import new_memory


@lru_cache(maxsize=None)
def message_class(type_name):
    """
    Return the class of a message type.

    Parameters
    ----------
    type_name : str
        For example sensor_msgs/msg/Image.

    Raises
    ------
    ImportError, AttributeError
        If its package is not installed, or has no such message.

    """
    package, _, name = type_name.partition('/msg/')
    return getattr(importlib.import_module(f'{package}.msg'), name)


def message_of(content):
    """Return a new message that holds a content."""
    return fill(message_class(content.TYPE)(), content)


def fill(message, content):
    """
    Write a content into a message.

    Arrays of the message stay where they are while their length does, and what a content wrote
    into them itself (see `Reused`) is not copied; `publish` copies them anyway.

    Parameters
    ----------
    message : object
        Of the class that `content.TYPE` names.
    content : object
        One of `messages.contents`.

    Returns
    -------
    message : object
        The one that was given.

    """
    for name in _names(type(content)):
        value = getattr(content, name)
        if isinstance(value, (int, float, str)):
            octet = isinstance(getattr(message, name), bytes)
            setattr(message, name, bytes([value]) if octet else value)
        elif isinstance(value, tuple):
            _fill_list(message, name, value)
        elif hasattr(value, 'TYPE'):
            fill(getattr(message, name), value)
        else:
            _copy(message, name, value)
    return message


@lru_cache(maxsize=None)
def _names(content_type):
    """Return the names of the fields of a class of contents."""
    return tuple(spec.name for spec in fields(content_type))


def _fill_list(message, name, contents):
    """Write contents into the list of messages that a field holds."""
    own = getattr(message, name)
    if len(own) != len(contents):
        own = [message_class(content.TYPE)() for content in contents]
        setattr(message, name, own)
    for item, content in zip(own, contents):
        fill(item, content)


def _copy(message, name, values):
    """Copy numbers into the array of a message, which is replaced if its length differs."""
    own = getattr(message, name)
    if values is own:
        return
    if len(own) != len(values):
        # array.array is the one type that rclpy assigns fast with and without its field checks
        setattr(message, name, array(own.typecode, bytes(own.itemsize * len(values))))
        own = getattr(message, name)
    np.copyto(np.asarray(own), values)


class Reused:
    """
    A message that is filled again and again.

    Parameters
    ----------
    type_name : str
        For example sensor_msgs/msg/Image.

    """

    def __init__(self, type_name):
        self.message = message_class(type_name)()

    def memory(self, size):
        """Return so many bytes to write the field `data` into: those of the message itself."""
        if not hasattr(self.message, 'data'):
            return new_memory(size)
        if len(self.message.data) != size:
            self.message.data = new_memory(size)
        return self.message.data

    def filled(self, content):
        """Return the message with another content."""
        return fill(self.message, content)

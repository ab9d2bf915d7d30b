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
"""Small recordings of a card at 1 m as other people make them: SQLite, compressed, ROS 1."""

from color_stereo_ros.messages.contents import camera_info, CameraInfo, Header, Image, image
from color_stereo_ros.recordings.types import serialized, typestore
import numpy as np
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores
from scenes import hue_pair, parallel_rig

SECOND = 1_000_000_000
START = 1_000_000_000 * SECOND
PERIOD = SECOND // 10
USUAL = ('/left/image_raw', '/right/image_raw', '/left/camera_info', '/right/camera_info')
OTHER = ('/stereo/left/image_color', '/stereo/right/image_color', '/stereo/left/camera_info',
         '/stereo/right/camera_info')
DISPARITY = 8
DEPTH = 1.0  # m: focal length 80 px, baseline 0.1 m, disparity 8 px


def contents(index, stamp, seen=lambda *pair: pair):
    """Return the images and camera_infos of one pair in the order of `USUAL`."""
    rig, pair = parallel_rig(), seen(*hue_pair(DISPARITY))
    header = Header.at(stamp(index), 'left_optical')
    return [*(image(pixels, 'rgb8', header) for pixels in pair),
            *(camera_info(camera, header) for camera in (rig.left, rig.right))]


def usual_stamp(index):
    """Return the stamp of a pair, ns."""
    return START + index * PERIOD


def recorded(path, names=USUAL, stamp=usual_stamp, pairs=3, mode=None, damage=lambda *_: None,
             seen=lambda *pair: pair):
    """
    Write a recording.

    `damage(index, topic, data)` may return other bytes for a message, `seen(left, right)` other
    images.

    """
    writer = Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3)
    if mode:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    kinds = (Image, Image, CameraInfo, CameraInfo)
    with writer:
        connections = [writer.add_connection(name, kind.TYPE, typestore=typestore())
                       for name, kind in zip(names, kinds)]
        for index in range(pairs):
            rows = list(zip(connections, names, contents(index, stamp, seen)))
            for connection, name, content in rows[2:] + rows[:2]:
                data = bytes(serialized(content))
                changed = damage(index, name, data)
                writer.write(connection, usual_stamp(index), data if changed is None else changed)
    return path


def recorded_by_ros1(path):
    """Write the same as a ROS 1 bag, which has a connection for each start of a driver."""
    store = get_typestore(Stores.ROS1_NOETIC)
    with Ros1Writer(path) as writer:
        for index in range(3):
            for name, content in zip(USUAL, contents(index, usual_stamp)):
                connection = writer.add_connection(name, content.TYPE, typestore=store,
                                                   callerid=f'/driver{index}', latching=0)
                writer.write(connection, usual_stamp(index), ros1_bytes(store, content))
    return path


def ros1_bytes(store, content):
    """Return the ROS 1 bytes of a content; its headers count, its CameraInfo has D K R P."""
    kinds = store.types
    stamp = kinds['builtin_interfaces/msg/Time'](content.header.stamp.sec,
                                                 content.header.stamp.nanosec)
    header = kinds['std_msgs/msg/Header'](7, stamp, content.header.frame_id)
    if isinstance(content, Image):
        values = (content.height, content.width, content.encoding, 0, content.step,
                  np.asarray(content.data))
    else:
        roi = kinds['sensor_msgs/msg/RegionOfInterest'](0, 0, 0, 0, False)
        values = (content.height, content.width, content.distortion_model, content.d, content.k,
                  content.r, content.p, 0, 0, roi)
    return store.serialize_ros1(kinds[content.TYPE](header, *values), content.TYPE)

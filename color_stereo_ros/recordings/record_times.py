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
"""When the messages of a topic were recorded, from the index of a file: no message is read."""

import struct

import numpy as np

MESSAGE_INDEX = struct.Struct('<BQHI')
"""Kind, length, channel and bytes of the entries of a record of MCAP's message index."""
MESSAGE_INDEX_KIND = 0x07
TIMES = 'SELECT timestamp FROM messages WHERE topic_id = ?'


def times_in(storage, topic):
    """
    Return when the messages of a topic in one file of rosbag2 were recorded.

    Parameters
    ----------
    storage : McapReader or Sqlite3Reader
        Of `rosbags`, open.
    topic : str
        Its name in the recording.

    Returns
    -------
    times : numpy.ndarray, int64, shape (n,)
        ns, in no order. Empty for an MCAP file without index.

    """
    ids = {item.id for item in storage.connections if item.topic == topic}
    if hasattr(storage, 'dbconn'):
        found = [[time for time, in storage.dbconn.execute(TIMES, (key,))] for key in ids]
    else:
        found = [_indexed(storage.bio, chunk.message_index_offsets[key])
                 for chunk in storage.chunks for key in ids & set(chunk.message_index_offsets)]
    return np.concatenate([np.empty(0, np.int64), *(np.asarray(times, np.int64)
                                                    for times in found)])


def _indexed(file, offset):
    """Return the times in a record of the message index, uint64; none where it is damaged."""
    file.seek(offset)
    head = file.read(MESSAGE_INDEX.size)
    if len(head) < MESSAGE_INDEX.size:
        return ()
    kind, _, _, size = MESSAGE_INDEX.unpack(head)
    entries = file.read(size) if kind == MESSAGE_INDEX_KIND else b''
    return np.frombuffer(entries[:len(entries) // 16 * 16], '<u8')[::2].astype(np.int64)

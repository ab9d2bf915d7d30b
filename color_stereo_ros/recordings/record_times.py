# SPDX-License-Identifier: Apache-2.0
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

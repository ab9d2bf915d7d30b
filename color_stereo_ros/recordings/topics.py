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
"""The four topics of a stereo pair in a recording: found, named by the user, or guessed."""

from dataclasses import astuple, dataclass
import re

from ..errors import RecordingError
from ..messages.contents import CameraInfo, CompressedImage, Image

COMPRESSED = CompressedImage.TYPE
DECOMPRESS = ('`color_stereo convert --input.transport compressed` reads JPEG and PNG; '
              '`ros2 run image_transport republish compressed raw` makes raw images of any, '
              'which can be recorded')
_SUFFIX = '/compressed'

OPTIONS = '--left-image', '--right-image', '--left-info', '--right-info'
"""The options of the command line that name the topics, in the order of `StereoTopics`."""

_PARTNERS = {'left': 'right', 'Left': 'Right', 'LEFT': 'RIGHT', 'l': 'r', 'L': 'R', '0': '1',
             '1': '2'}
_OTHER_IMAGES = re.compile('depth|disparity|mask|confidence', re.IGNORECASE)
_RESULTS = '/depth/image', '/points'
_LAST_CHOICE = re.compile('rect|mono|gr[ae]y', re.IGNORECASE)


@dataclass(frozen=True)
class StereoTopics:
    """The four topics that `range_node` needs, as a recording names them."""

    left_image: str
    right_image: str
    left_info: str
    right_info: str

    @property
    def names(self):
        """Return the four names."""
        return astuple(self)

    @property
    def common_namespace(self):
        """Return what the names of both images begin with: '/' or '/NAME/'."""
        left, right = (name.split('/')[:-1] for name in (self.left_image, self.right_image))
        common = []
        for first, second in zip(left, right):
            if first != second:
                break
            common.append(first)
        return '/'.join([*common, '']) or '/'


STEREO_TOPICS = StereoTopics('left/image_raw', 'right/image_raw',
                             'left/camera_info', 'right/camera_info')
NOTHING_NAMED = StereoTopics(None, None, None, None)


def stereo_topics(recording, namespace=None, named=NOTHING_NAMED, compressed=False):
    """
    Return the topics of the one stereo pair in a recording.

    Parameters
    ----------
    recording : Recording
        An open recording.
    namespace : str or None
        What the names begin with, for example '/cell_1'; None = find it.
    named : StereoTopics
        Topics that the user names; None = the usual name. A name without `/` in front is below
        the namespace. A camera_info is looked for beside an image that is named.
    compressed : bool
        The images are JPEG or PNG; their usual names end with /compressed.

    Returns
    -------
    topics : StereoTopics

    Raises
    ------
    RecordingError
        If a topic is missing, empty or of another type, or if several pairs are there. The text
        asks for a pair of other names where there is one.

    """
    images, prefix = _images(recording, namespace, named, compressed)
    beside = [f'{image.removesuffix(_SUFFIX).rpartition("/")[0]}/camera_info' for image in images]
    infos = [_existing(recording, usual if given is None else given, prefix)
             for given, usual in zip(named.names[2:], beside)]
    found = StereoTopics(*images, *infos)
    _check_different(recording, *images, 'images')
    _check_different(recording, *infos, 'camera_infos')
    kind = COMPRESSED if compressed else Image.TYPE
    for topic, expected, option in zip(found.names, 2 * [kind] + 2 * [CameraInfo.TYPE],
                                       OPTIONS):
        _check_topic(recording, topic, expected, option)
    return found


def image_topics(recording, namespace=None, named=NOTHING_NAMED, compressed=False):
    """
    Return the topics of the left and the right image; as `stereo_topics`, without camera_infos.

    Returns
    -------
    topics : (str, str)

    """
    images, _ = _images(recording, namespace, named, compressed)
    _check_different(recording, *images, 'images')
    for topic, option in zip(images, OPTIONS):
        _check_topic(recording, topic, COMPRESSED if compressed else Image.TYPE, option)
    return tuple(images)


def _images(recording, namespace, named, compressed):
    """Return the names of both image topics, and the prefix of the namespace."""
    if None in (named.left_image, named.right_image):
        prefix = _prefix(_namespace(recording, compressed) if namespace is None else namespace)
    else:
        prefix = _prefix(namespace or '')
    return [_existing(recording, usual + _SUFFIX * compressed if given is None else given, prefix)
            for given, usual in zip(named.names[:2], STEREO_TOPICS.names[:2])], prefix


def _check_different(recording, left, right, what):
    if left == right:
        raise RecordingError(f'{recording.path}: {left} is named for the {what} of both cameras')


def _prefix(namespace):
    return f'/{namespace.strip("/")}/' if namespace.strip('/') else '/'


def _existing(recording, name, prefix):
    """Return a name as the recording has it: some recorders write none of the first `/`."""
    full = name if name.startswith('/') else prefix + name
    return next((known for known in (full, full.lstrip('/'), name) if known in recording.topics),
                full)


def _namespace(recording, compressed):
    ending = STEREO_TOPICS.left_image + _SUFFIX * compressed
    found = {_folder(topic, ending) for topic in recording.topics
             if f'/{topic}'.endswith(f'/{ending}')}
    if not found:
        raise RecordingError(f'{recording.path}: no topic ends with /{ending}; '
                             f'{_question(recording)}')
    if len(found) > 1:
        raise RecordingError(f'{recording.path}: several stereo pairs, choose one with '
                             f'--namespace: {", ".join("/" + name for name in sorted(found))}')
    return found.pop()


def _folder(topic, ending):
    return topic.removesuffix(ending).strip('/')


def _check_topic(recording, topic, expected, option):
    if topic not in recording.topics:
        raise RecordingError(f'{recording.path}: no topic {topic}; {_question(recording)} '
                             f'({option} names another topic)')
    if recording.topics[topic] != expected:
        advice = f'; {DECOMPRESS}' if recording.topics[topic] == COMPRESSED else ''
        raise RecordingError(f'{recording.path}: {topic} is a {recording.topics[topic]}, '
                             f'expected {expected}{advice}')
    if not recording.counts[topic]:
        raise RecordingError(f'{recording.path}: {topic} has no messages')


def _question(recording):
    """Return a question about a pair of other names, or what there is instead."""
    pairs = [pair for pair in guessed_pairs(recording.topics, recording.counts)
             if None not in pair.names]
    if len(pairs) == 1:
        options = ' '.join(f'{option} {name}' for option, name in zip(OPTIONS, pairs[0].names))
        rectified = ' --input.rectified true' if 'rect' in pairs[0].left_image else ''
        return f'did you mean {options}{rectified}?'
    if pairs:
        names = '; '.join(f'{pair.left_image} and {pair.right_image}' for pair in pairs)
        return (f'did you mean one of these pairs: {names}? --left-image and --right-image '
                'choose one')
    compressed = sorted(topic for topic, kind in recording.topics.items() if kind == COMPRESSED)
    if compressed and Image.TYPE not in recording.topics.values():
        return f'its images are compressed ({", ".join(compressed)}): {DECOMPRESS}'
    held = ', '.join(sorted(recording.topics)) or 'no topic at all'
    if any(f'/{topic}'.endswith(_RESULTS) for topic in recording.topics):
        return f'it holds results ({held}): name the recording of the images they were made from'
    return f'it holds {held}'


def guessed_pairs(topics, counts, compressed=False):
    """
    Return the stereo pairs that names of topics speak of.

    Parameters
    ----------
    topics : dict
        Topic names to types.
    counts : dict
        Topic names to numbers of messages; topics without any are left out.
    compressed : bool
        Look for JPEG and PNG images instead of raw ones.

    Returns
    -------
    pairs : list of StereoTopics
        One for each pair of cameras, with the images that are most likely raw; infos may be
        None.

    """
    kind, suffix = (COMPRESSED, _SUFFIX) if compressed else (Image.TYPE, '')
    images = {topic.removesuffix(suffix) for topic, found in topics.items()
              if found == kind and topic.endswith(suffix) and counts[topic]
              and not _OTHER_IMAGES.search(topic)}
    infos = {topic for topic, found in topics.items()
             if found == CameraInfo.TYPE and counts[topic]}
    best = {}
    for left in sorted(images, key=_kind):
        for right in sorted(_partners(left) & images):
            cameras = left.rpartition('/')[0], right.rpartition('/')[0]
            best.setdefault(cameras if cameras[0] != cameras[1] else (left, right), (left, right))
    return [StereoTopics(left + suffix, right + suffix, *_infos_of(left, right, infos))
            for left, right in sorted(best.values())]


def _kind(topic):
    """Return a key that sorts names of images: raw ones before rectified and gray ones."""
    name = topic.rpartition('/')[2]
    return bool(_LAST_CHOICE.search(name)), 'raw' not in name, 'color' not in name, topic


def _partners(left):
    """Return the names that the right one of a left image may have."""
    tokens = re.findall(r'[A-Za-z]+|\d+|[^A-Za-z\d]+', left)
    found = {left.replace('left', 'right'), left.replace('Left', 'Right')}
    for word in set(tokens) & set(_PARTNERS):
        places = [index for index, token in enumerate(tokens) if token == word]
        for chosen in [places, *([place] for place in places)]:
            found.add(''.join(_PARTNERS[word] if index in chosen else token
                              for index, token in enumerate(tokens)))
    return found - {left}


def _infos_of(left, right, infos):
    """Return the names of both camera_infos, None where there is none for it."""
    beside = [f'{image.rpartition("/")[0]}/camera_info' for image in (left, right)]
    if beside[0] != beside[1] and set(beside) <= infos:
        return beside
    for first in sorted(infos):
        for second in sorted(_partners(first) & infos):
            return first, second
    return [name if name in infos and beside[0] != beside[1] else None for name in beside]

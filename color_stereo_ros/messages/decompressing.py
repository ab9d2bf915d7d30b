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
"""
JPEG and PNG messages to images, as image_transport's subscribers read them.

The meaning of `format` is that of `src/compressed_subscriber.cpp` of compressed_image_transport:
`rgb8; jpeg compressed bgr8` says which encoding the image had and in which order of colors it was
handed to the encoder. Drivers that pass the bytes of a camera on write `jpeg` alone.

"""

from dataclasses import dataclass, replace
import struct
import sys

import cv2
import numpy as np

from .contents import Image
from .encodings import BAYER, COLORS
from .reading import MAX_SIDE
from ..errors import brief, ImageError
from ..files.image import is_cut_off_jpeg

_JPEG, _PNG, _PNG_END = b'\xff\xd8', b'\x89PNG\r\n\x1a\n', b'IEND'
_FRAMES = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}  # start-of-frame markers of a JPEG
_ALONE = {0x01, *range(0xD0, 0xD8)}  # markers without a length
_NAMES = {(1, 1): '4:4:4', (2, 1): '4:2:2', (2, 2): '4:2:0', (1, 2): '4:4:0', (4, 1): '4:1:1',
          (4, 2): '4:1:0'}


@dataclass(frozen=True)
class Look:
    """What the first bytes of a compressed image say."""

    width: int
    """px."""
    height: int
    """px."""
    subsampling: tuple = (1, 1)
    """Columns and rows that share a color: (2, 2) is 4:2:0."""

    @property
    def doubt(self):
        """Return what is odd about the color, or None."""
        if self.subsampling == (1, 1):
            return None
        name = _NAMES.get(self.subsampling, 'subsampled')
        across, down = self.subsampling
        return (f'JPEG {name}: {across} x {down} px share one color, and depth is measured from '
                'color; let the driver send JPEG 4:4:4, PNG or raw images')


def look_at(msg):
    """
    Read size and sampling of a compressed image, cheaply: no pixel is decoded.

    Parameters
    ----------
    msg : sensor_msgs.msg.CompressedImage
        Or anything with the same fields.

    Returns
    -------
    look : Look

    Raises
    ------
    ImageError
        If the bytes are neither JPEG nor PNG, end too early, or lost their color.

    """
    data = bytes(memoryview(msg.data)[:8])
    if data.startswith(_JPEG):
        whole = bytes(msg.data)
        if is_cut_off_jpeg(whole):
            raise ImageError(f'the JPEG is damaged or ends too early: {len(whole)} bytes')
        look = _look_at_jpeg(whole)
        _refuse_lost_color(msg.format)
    elif data == _PNG:
        whole = bytes(msg.data)
        if whole.rfind(_PNG_END) < 0 or len(whole) < 24:
            raise ImageError(f'the PNG ends too early: {len(whole)} bytes')
        look = Look(*struct.unpack_from('>II', whole, 16))
    else:
        raise ImageError(f'format = {brief(msg.format)}: the bytes are neither JPEG nor PNG')
    if not 0 < min(look.width, look.height) <= max(look.width, look.height) <= MAX_SIDE:
        raise ImageError(f'{look.width} x {look.height} px is no size of an image, expected '
                         f'1 .. {MAX_SIDE} px')
    return look


def _look_at_jpeg(data):
    """Return the Look of a JPEG: the first frame header counts (ITU-T T.81, B.2.2)."""
    at = 2
    try:
        while True:
            while data[at] != 0xFF:
                at += 1
            marker = data[at + 1]
            if marker in _FRAMES:
                height, width, count = struct.unpack_from('>HHB', data, at + 5)
                factors = [divmod(data[at + 11 + 3 * each], 16) for each in range(count)]
                return Look(width, height, _subsampling(factors))
            if marker in _ALONE or marker == 0xFF:
                at += 1 if marker == 0xFF else 2
            else:
                at += 2 + struct.unpack_from('>H', data, at + 2)[0]
    except (struct.error, IndexError):
        raise ImageError('the JPEG is damaged: it has no frame header') from None


def _subsampling(factors):
    """Return by how much the other components are coarser than the first one."""
    if len(factors) < 2 or 0 in factors[1]:
        return 1, 1
    return tuple(max(1, own // other) for own, other in zip(factors[0], factors[1]))


def _refuse_lost_color(text):
    """Refuse mosaics that image_transport has turned to gray before it made a JPEG of them."""
    encoding, _, rest = text.partition(';')
    if encoding.rstrip('0123456789') in BAYER and 'compressed mono' in rest:
        raise ImageError(
            f'format = {brief(text)}: image_transport makes gray JPEGs of {encoding} images, so '
            'the color is lost; let it write PNG (parameter `format` of the driver), or let the '
            'driver send color images')


def decompressed(msg):
    """
    Return the image in a message; tags that say how the camera was held are ignored.

    Parameters
    ----------
    msg : sensor_msgs.msg.CompressedImage
        Or anything with the same fields.

    Returns
    -------
    image : Image
        8 bits a channel, except gray images and mosaics of 16. Mosaics stay mosaics.

    Raises
    ------
    ImageError
        As `look_at`, or if the bytes cannot be decoded.

    """
    look_at(msg)
    try:
        # unchanged: OpenCV then does not turn the image as EXIF says
        pixels = cv2.imdecode(np.frombuffer(msg.data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        pixels = None
    if pixels is None:
        raise ImageError(f'format = {brief(msg.format)}: the image is damaged')
    if pixels.ndim == 3 and pixels.dtype == np.uint16:
        pixels = (pixels >> 8).astype(np.uint8)
    if pixels.dtype not in (np.uint8, np.uint16):
        raise ImageError(f'the image has {8 * pixels.itemsize} bits, expected 8 or 16')
    pixels = np.ascontiguousarray(pixels)
    height, width = pixels.shape[:2]
    return Image(msg.header, height, width, _encoding(msg.format, pixels),
                 int(sys.byteorder == 'big'), pixels.strides[0], pixels.reshape(-1).view(np.uint8))


def _encoding(text, pixels):
    """Return the encoding of decoded pixels from the `format` of the message."""
    before, separator, rest = text.partition(';')
    if pixels.ndim == 2:
        kind = before.strip().rstrip('0123456789')
        return (kind if kind in BAYER else 'mono') + str(8 * pixels.itemsize)
    # the order that was handed to the encoder comes back; OpenCV takes and gives BGR
    swapped = separator and before.startswith(COLORS) and 'compressed bgr' not in rest
    return ('rgb' if swapped else 'bgr') + ('a8' if pixels.shape[2] == 4 else '8')


def opened(pair):
    """Return a Pair whose compressed images are decompressed; an error names the camera."""
    changes = {}
    for side in ('left', 'right'):
        message = getattr(pair, side)
        if hasattr(message, 'format'):
            try:
                changes[side] = decompressed(message)
            except ImageError as error:
                raise ImageError(f'{side} image: {error}') from error
    return replace(pair, **changes) if changes else pair

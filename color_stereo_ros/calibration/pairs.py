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
"""Pairs of image files: which left and which right image belong together, by their names."""

from collections import Counter
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
import re

from .views import SIDES
from ..errors import RecordingError
from ..files.image import read_image

SUFFIXES = {'.png', '.jpg', '.jpeg', '.tif', '.tiff', '.bmp', '.webp', '.pgm', '.ppm'}
_WORD = {side: re.compile(rf'(?<![a-z]){side}|{side}(?![a-z])', re.IGNORECASE) for side in SIDES}
STAMP_DIGITS = 10      # before the point: a number as long as a time since 1970, s
TOLERANCE = 20_000_000  # ns between two stamps of a pair; chosen: less than a frame at 30 Hz


@dataclass(frozen=True)
class ImagePair:
    """Two images that were taken at the same moment."""

    name: str
    """For people; no other pair has it."""
    left: object
    """Path of the image file, or its pixels, uint8 (H, W, 3) RGB."""
    right: object
    """As `left`."""
    skew: int = 0
    """Stamp of the right image minus that of the left one, ns; 0 where nothing is known."""

    def images(self):
        """Return both images, uint8 (H, W, 3) RGB; errors as for `files.image.read_image`."""
        return tuple(read_image(each) if isinstance(each, Path) else each
                     for each in (self.left, self.right))


@dataclass(frozen=True)
class FoundPairs:
    """The pairs in one or two folders."""

    pairs: list
    """ImagePair, in the order of their numbers."""
    alone: list
    """Names of the files that have no partner."""


def find_pairs(*folders):
    """
    Find the image pairs in a folder, or in one folder for each camera.

    A single folder holds files with `left` and `right` in their names, or two folders of these
    names. Files belong together if the rest of their names is the same; otherwise by the last
    number in it, which may be a stamp (s, ms, us or ns since 1970).

    Parameters
    ----------
    folders : path-like
        One folder, or that of the left and that of the right camera.

    Returns
    -------
    found : FoundPairs

    Raises
    ------
    RecordingError
        If a folder is missing, or no two files belong together; names the folder.

    """
    folders = [Path(folder) for folder in folders]
    for folder in folders:
        if not folder.is_dir():
            raise RecordingError(f'{folder}: there is no such folder')
    if len(folders) == 2:
        if folders[0].resolve() == folders[1].resolve():
            raise RecordingError(f'{folders[0]}: is named for both cameras; name it once if it '
                                 'holds the images of both')
        files = {side: _images_in(folder) for side, folder in zip(SIDES, folders)}
    else:
        files = _files_by_side(folders[0])
    for side in SIDES:
        if not files[side]:
            raise RecordingError(_about_none(folders, side))
    return _paired(files, folders)


def _images_in(folder):
    return sorted(path for path in folder.iterdir()
                  if path.suffix.lower() in SUFFIXES and path.is_file())


def _files_by_side(folder):
    """Return the files of both cameras in one folder, or in its folders left and right."""
    inner = {side: next((path for path in sorted(folder.iterdir()) if path.is_dir()
                         and _WORD[side].search(path.name)), None) for side in SIDES}
    if all(inner.values()):
        return {side: _images_in(path) for side, path in inner.items()}
    return {side: [path for path in _images_in(folder) if _WORD[side].search(path.stem)]
            for side in SIDES}


def _about_none(folders, side):
    if len(folders) == 2:
        folder = folders[SIDES.index(side)]
        return f'{folder}: no image inside; expected files such as {side}_001.png'
    count = len(_images_in(folders[0]))
    held = f'{count} images, but none' if count else 'no image'
    return (f'{folders[0]}: {held} with {side!r} in its name; expected files such as '
            'left_001.png and right_001.png, folders left and right, or two folders on the '
            'command line')


def _paired(files, folders):
    """Return the FoundPairs of the files of both cameras."""
    rests = {side: {_rest(path, side): path for path in paths} for side, paths in files.items()}
    common = rests['left'].keys() & rests['right'].keys()
    if 2 * len(common) >= min(map(len, files.values())):
        found = [(rests['left'][rest], rests['right'][rest], 0) for rest in common]
    else:
        found = _paired_by_number(files)
    if not found:
        examples = ' and '.join(files[side][0].name for side in SIDES)
        raise RecordingError(
            f'{" ".join(map(str, folders))}: no two images belong together ({examples}, for '
            'example); give both files of a pair the same number or stamp')
    used = {path for left, right, _ in found for path in (left, right)}
    alone = [path.name for side in SIDES for path in files[side] if path not in used]
    found.sort(key=lambda entry: (_number(entry[0]) or 0, entry[0].name))
    names = Counter(left.stem for left, _, _ in found)
    return FoundPairs([ImagePair(left.stem if names[left.stem] == 1 else left.name, left, right,
                                 skew) for left, right, skew in found], alone)


def _rest(path, side):
    """Return the name of a file without the name of its camera."""
    return _WORD[side].sub('', path.stem).strip(' _-.').lower()


def _number(path):
    """Return the last number in the name of a file: a stamp in ns, or what it is; or None."""
    found = re.findall(r'\d+(?:\.\d+)?', path.stem)
    if not found:
        return None
    number = Decimal(found[-1])
    digits = len(str(int(number)))
    if digits < STAMP_DIGITS:
        return int(number)
    return int(number * 10**max(0, 9 - 3 * ((digits - STAMP_DIGITS) // 3)))


def _paired_by_number(files):
    """Return (left, right, skew) of files of the same number, or of nearly the same stamp."""
    numbers = {side: sorted((_number(path), path) for path in paths
                            if _number(path) is not None) for side, paths in files.items()}
    found, rights = [], dict(numbers['right'])
    for number, left in numbers['left']:
        reach = TOLERANCE if number >= 10**17 else 0
        near = min(rights, key=lambda other: abs(other - number), default=None)
        if near is not None and abs(near - number) <= reach:
            found.append((left, rights.pop(near), near - number))
    return found

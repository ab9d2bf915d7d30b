# SPDX-License-Identifier: Apache-2.0
"""An account of one measurement for people: why pixels have no range, what is odd about a pair."""

import numpy as np

from .status import Status

FEW = 0.05
"""Below this share of pixels with a range something is wrong."""

_GRAY = 2         # DN: channels that differ by no more show no color; JPEG leaves 1 or 2
_NEARLY_ALL = 0.999
_DARK = 16        # DN: where nothing is brighter, nothing can be said about the color
_SUSPICIOUS = 0.2  # share of ranges below which swapped images are thought of
_CLEARLY = 0.3, 3  # the other order gives at least this share, and so many times this order's


def status_shares(status):
    """
    Return how many pixels have each status.

    Parameters
    ----------
    status : numpy.ndarray, uint8, shape (H, W)
        Codes of `Status`.

    Returns
    -------
    shares : dict
        Name of the status, such as 'out of range', to its share of all pixels, 0..1.

    """
    counts = np.bincount(status.ravel(), minlength=len(Status))
    return {code.label: float(counts[code] / status.size) for code in Status}


def main_reason(shares):
    """Return why most pixels without a range have none, as one sentence with the share."""
    code = max((code for code in Status if code != Status.VALID),
               key=lambda code: shares[code.label])
    return f'{shares[code.label]:.1%} {code.label}: {code.meaning}'


def doubts_about_images(left, right):
    """
    Tell what is wrong with a pair before it is measured.

    Parameters
    ----------
    left, right : numpy.ndarray, uint8, shape (H, W, 3)
        Raw RGB images.

    Returns
    -------
    doubts : list of str
        Sentences for people; empty if the pair looks as it should.

    """
    doubts = [f'the {name} image is gray: a mono camera, or raw Bayer data that nobody has '
              'turned into color'
              for name, image in (('left', left), ('right', right)) if _is_gray(image)]
    if np.array_equal(left, right):
        doubts.insert(0, 'left and right image are identical: one camera, or one file twice')
    return doubts


def _is_gray(image):
    brightest = image.max(axis=2)
    colorless = brightest - image.min(axis=2) <= _GRAY
    return bool(brightest.max(initial=0) > _DARK and colorless.mean() >= _NEARLY_ALL)


def doubts_about_result(stereo, left, right, result):
    """
    Tell what is wrong with a pair after it has been measured.

    Parameters
    ----------
    stereo : ColorStereo
        Measures the pair the other way round if there are few ranges.
    left, right : numpy.ndarray, uint8, shape (H, W, 3)
        Raw RGB images.
    result : RangeResult
        What the sensor made of them.

    Returns
    -------
    doubts : list of str
        Sentences for people; empty if nothing is odd.

    """
    doubts = []
    if result.density < _SUSPICIOUS:
        swapped = stereo.process(right, left).density
        least, times = _CLEARLY
        if swapped > max(least, times * result.density):
            doubts.append(f'left and right image swapped? The other way round {swapped:.1%} of '
                          f'the pixels have a range, as given {result.density:.1%}')
    if result.density < FEW:
        doubts.append(f'hardly any pixel has a range; {main_reason(status_shares(result.status))}')
    return doubts

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
"""An account of one measurement for people: why pixels have no range, what is odd about a pair."""

from dataclasses import dataclass

import numpy as np

from .constants import chosen, constant, Constants, derived, unexplained
from .patterns.feature_size import feature_size_in
from .projector.finding import Reason
from .projector.tracking import Track
from .settings import PatternSettings
from .status import Status

FIRST = 'The value of the first version (4de8491).'


@dataclass(frozen=True)
class AccountTuning(Constants):
    """When a pair is worth a doubt."""

    gray_difference: int = constant(
        2, 'DN', 'Largest difference of the channels of a pixel without color.',
        derived('The compression of JPEG leaves 1 or 2 DN in gray images.'))
    gray_share: float = constant(
        0.999, '1', 'Share of pixels without color from which an image is gray.',
        unexplained('A few damaged pixels may have a color. ' + FIRST))
    mosaic_ratio: float = constant(
        1.3, '1', 'Change from column to column over that to the next but one, from which a gray '
        'image is a mosaic.', chosen('Noise alone: 1; surfaces and patterns: less.'))
    dark: int = constant(
        16, 'DN', 'Brightest channel up to which an image says nothing about color.',
        unexplained(FIRST))
    few_ranges: float = constant(
        0.05, '1', 'Share of pixels with a range below which something is wrong.',
        unexplained(FIRST))
    suspicious_share: float = constant(
        0.2, '1', 'Share of pixels with a range below which the images may be swapped.',
        unexplained('Only then the pair is measured a second time. ' + FIRST))
    swapped_share: float = constant(
        0.3, '1', 'Share that swapped images must give for a doubt.',
        unexplained(FIRST))
    swapped_ratio: int = constant(
        3, '1', 'How many times more ranges swapped images must give for a doubt.',
        unexplained(FIRST))
    least_feature: float = constant(
        4.0, 'px', 'Structure of the pattern in the image below which colors blur into each '
        'other.',
        chosen('The smallest of docs/hardware.md. Simulated rig: 6.2 to 7.7 px; under a projector '
               'with 1.9 times as many columns 3.8 to 4.5 px.'))
    white: float = constant(
        200.0, 'DN', 'What the brightest channel of a white card shall read.',
        chosen('Some room below 255 for gloss; docs/hardware.md says the same.'))
    brightest: float = constant(
        99.0, '%', 'Percentile of the lit pixels that counts as the brightest surface.',
        chosen('As the automatic exposure of the simulated rig; gloss is brighter.'))
    exposure_factor: float = constant(
        1.4, '1', 'Change of the exposure from which it is worth advice.',
        chosen('Half a stop, the step of many apertures.'))
    clipped_share: float = constant(
        0.03, '1', 'Share of overexposed lit pixels from which less exposure is advised.',
        chosen('Above the 1 % that the percentile leaves out, and small highlights.'))
    feature_margin: float = constant(
        1.1, '1', 'Factor of this size up to which a doubt holds that was said already.',
        unexplained('Estimates of two pairs differ by less; a doubt is then said once.'))


TUNING = AccountTuning()
FEW = TUNING.few_ranges
"""Below this share of pixels with a range something is wrong."""
SUSPICIOUS = TUNING.suspicious_share
"""Below this share of pixels with a range the images may be swapped."""
LARGEST_FEATURE = PatternSettings.__dataclass_fields__['feature_size'].metadata['maximum']


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
    Return what looks wrong with a pair before it is measured.

    Parameters
    ----------
    left, right : numpy.ndarray, uint8, shape (H, W, 3)
        Raw RGB images.

    Returns
    -------
    doubts : list of str
        Sentences for people; empty if the pair looks as it should.

    """
    gray = {'left': _is_gray(left), 'right': _is_gray(right)}
    doubts = []
    if all(gray.values()):
        doubts += ['both images are gray, and their columns alternate: raw Bayer data without '
                   'demosaicing'] * _alternates(left)
    elif any(gray.values()):
        name = 'left' if gray['left'] else 'right'
        doubts += [f'the {name} image is gray, the other one is not: a mono camera, or raw Bayer '
                   'data without demosaicing']
    if np.array_equal(left, right):
        doubts.insert(0, 'left and right image are identical: one camera, or one file twice')
    return doubts


def are_gray(left, right):
    """Return whether neither of two raw RGB images, uint8 (H, W, 3), has colors."""
    return _is_gray(left) and _is_gray(right)


def _is_gray(image):
    darkest, brightest = _extremes(image)
    colorless = brightest - darkest <= TUNING.gray_difference
    return bool(brightest.max(initial=0) > TUNING.dark
                and colorless.mean() >= TUNING.gray_share)


def _extremes(image):
    """Return least and largest channel of every pixel; faster than to reduce an axis of 3."""
    first, second, third = np.moveaxis(image, 2, 0)
    return tuple(extreme(extreme(first, second), third) for extreme in (np.minimum, np.maximum))


def _alternates(image):
    """Return whether adjacent columns differ clearly more than those two apart: a mosaic does."""
    levels = image[..., 1].astype(np.int16)
    near, far = (np.abs(levels[:, step:] - levels[:, :-step]).mean() for step in (1, 2))
    return bool(near > TUNING.mosaic_ratio * max(far, 1.0))


@dataclass(frozen=True)
class Exposure:
    """How bright a pair is."""

    level: float
    """Brightest channel of the brightest surfaces, DN, of the brighter view; 0: nothing is lit."""
    clipped: float
    """Share of the lit pixels that are overexposed, of the view that has more of them."""

    @property
    def factor(self):
        """Return by how much the exposure should change; 1 where it is good or nothing is lit."""
        if not self.level:
            return 1.0
        if self.clipped > TUNING.clipped_share:  # by how much, a full scale does not say
            return 1 / TUNING.exposure_factor
        factor = TUNING.white / self.level
        good = 1 / TUNING.exposure_factor < factor < TUNING.exposure_factor
        return 1.0 if good else factor

    def sentence(self):
        """Return advice for people."""
        if not self.level:
            return 'nothing is lit'
        factor, white = self.factor, f'white card at {TUNING.white:.0f}'
        if self.clipped > TUNING.clipped_share:
            return (f'lower exposure by {1 / factor:.1f} and look again, {white}: '
                    f'{self.clipped:.0%} of the lit pixels are overexposed')
        if factor == 1.0:
            return f'exposure is good: the brightest surfaces read {self.level:.0f} DN'
        word, by = ('raise', factor) if factor > 1 else ('lower', 1 / factor)
        return (f'{word} exposure by {by:.1f}, {white}: the brightest surfaces read '
                f'{self.level:.0f} DN')


def exposure_of(left, right, saturation):
    """
    Return how bright a pair is.

    Parameters
    ----------
    left, right : numpy.ndarray, uint8, shape (H, W, 3)
        Raw RGB images.
    saturation : float
        Value from which a channel is overexposed, DN.

    Returns
    -------
    exposure : Exposure

    """
    found = []
    for image in (left, right):
        _, brightest = _extremes(image)
        lit = brightest[brightest > TUNING.dark]
        if lit.size:
            found.append((float(np.percentile(lit, TUNING.brightest)),
                          float(np.mean(lit >= saturation))))
    levels, shares = zip(*found) if found else ((0.0,), (0.0,))
    return Exposure(max(levels), max(shares))


def doubt_about_rivals(result):
    """Return that an aperiodic pattern seems to repeat in the images; None where it does not."""
    if not result.rival_share:
        return None
    return ('the pattern repeats or does not show, although pattern.type names one whose colors '
            f'never come again; {result.rival_share:.0%} of the lit surface match at several '
            'places')


def doubts_about_result(stereo, left, right, result):
    """
    Return what looks wrong with a pair after it has been measured.

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
    few = doubt_about_ranges(status_shares(result.status))
    return [*doubts_about_rows(result), *doubts_about_features(stereo.settings.pattern, result),
            *doubts_about_order(stereo, left, right, result),
            *filter(None, [doubt_about_rivals(result), few])]


def doubt_about_projector(track, shown):
    """
    Return what should be looked after at the projector, None if nothing.

    Parameters
    ----------
    track : Track
        Of a RangeResult.
    shown : bool
        The projector is known to show the pattern of the settings.

    Returns
    -------
    doubt : str or None

    """
    if track.held or (track.agreeing and track.explains):
        return None
    lost = not track.agreeing and track.model is not None
    odd = track.reason in (Reason.MIRRORED, Reason.TWICE, Reason.APART, Reason.PICTURE)
    absent = shown and track.reason is Reason.ABSENT
    if odd or lost or track.agreeing or absent:
        return track.sentence()
    return None


def doubts_about_rows(result):
    """Return that the rows of the two views disagree, or that the views have nothing in common."""
    return list(filter(None, [result.alignment and result.alignment.sentence()]))


def rows_in_words(result):
    """Return what is known of the rows of the two views, as a short text."""
    alignment = result.alignment
    if alignment is None:
        return 'rows are not looked at'
    told = alignment.sentence()
    if told:
        return told
    if not alignment.known:
        return 'rows are not known: the pattern does not show them'
    error, place = alignment.largest()
    if alignment.applied.any():
        return f'rows differ by {abs(error):.2f} px ({place}), and are corrected'
    return 'rows agree'


def doubts_about_features(pattern, result, said=False):
    """
    Return that the structures of the pattern are too small in the image, with a better setting.

    Parameters
    ----------
    pattern : PatternSettings
        Of the pattern that is projected.
    result : RangeResult
        Of the pair.
    said : bool
        The doubt was said of the pair before: it holds a little longer.

    Returns
    -------
    doubts : list of str
        Sentences for people; empty where they are large enough, or their size is not seen.

    """
    size = feature_size_in(result.image, pattern)
    least = TUNING.least_feature
    if size is None or size >= least * (TUNING.feature_margin if said else 1):
        return []
    larger = min(np.ceil(pattern.feature_size * least / max(size, 1)), LARGEST_FEATURE)
    return [f'the smallest structures of the pattern are too small in the image: {size:.1f} px, '
            f'below {least:.0f} px the colors blur into each other; set pattern.feature_size to '
            f'{larger:.0f} instead of {pattern.feature_size:g} where the pattern is shown and '
            'where it is measured']


def doubts_about_order(stereo, left, right, result):
    """Return the part of `doubts_about_result` that may measure the pair a second time."""
    if result.density >= SUSPICIOUS:
        return []
    # with an alignment of its own: what is known of the rows is not of this order
    swapped = stereo.process(right, left, stereo.alignment.but(wait=1),
                             Track.known(None), stereo.health).density
    if swapped <= max(TUNING.swapped_share, TUNING.swapped_ratio * result.density):
        return []
    return [f'left and right image swapped? The other way round {swapped:.1%} of the pixels have '
            f'a range, as given {result.density:.1%}']


def doubt_about_ranges(shares):
    """Return that hardly any pixel has a range, with the main reason; None if enough have one."""
    if shares[Status.VALID.label] >= FEW:
        return None
    return f'hardly any pixel has a range; {main_reason(shares)}'

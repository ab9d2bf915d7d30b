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
Check a sensor on a flat board or a sphere bar: figures, a verdict, and what to change.

A check needs a calibration, settings and some pairs of a board that fills the view. Several pairs
of a scene at rest tell the noise of a pixel from the shape that the calibration leaves.

"""

from dataclasses import dataclass

import numpy as np

from .check_light import light_of
from .check_shapes import measured_plane, measured_spheres
from .planning import DISPARITY_STD, ROWS_LIMIT
from ..core.account import rows_in_words, TUNING
from ..core.health.tuning import TUNING as HEALTH
from ..errors import CalibrationError

GOOD, FAIR, POOR, NOTE = 'good', 'fair', 'poor', 'note'
LEVELS = GOOD, FAIR, POOR
PLACES = (('top left', 'top', 'top right'), ('left', 'middle', 'right'),
          ('bottom left', 'bottom', 'bottom right'))
# Limits of good and of fair. The first ones compare figures with what the sensor claims itself.
CLAIM = 1.4, 2.0         # times the claim; chosen: claims of pairs in the stress test vary so much
NOISE = 2.0, 4.0         # times DISPARITY_STD, the claim that a plan is based on; chosen
SHAPE = 1.0, 2.0         # times the claim of a pixel; derived: the claim holds for means, too
WRONG = 2.0, 10.0        # times the share that the confidences say; chosen
LEAST_WRONG = 0.001      # chosen: a smaller share is not judged
RANGE = 5.94             # derived: 99.7 % of a normal distribution lie within 2.97 each side
# where a drift is told; where a 2-D pattern loses density, measured
ROWS_PX = HEALTH.use.told_rows, ROWS_LIMIT
# conventions
BIAS_PERCENT = 0.1, 0.3
DENSITY = 0.97, 0.85
GAIN = 1.25, 1.7
BALANCE = 1.5, 2.5
CONTRAST = 0.45, 0.25
SHARPNESS = 0.6, 0.4
SIZE_SHARE = 0.005, 0.015  # of the diameter
SPACING_PERCENT = 0.1, 0.3
TEMPORAL_PAIRS = 3  # fewest pairs that tell the noise of a pixel


@dataclass(frozen=True)
class Finding:
    """One property of the sensor."""

    name: str
    text: str
    """The figure with its unit, for people."""
    level: str
    """GOOD, FAIR, POOR, or NOTE where nothing is judged."""
    advice: str = ''
    """What to change; '' if nothing."""


@dataclass(frozen=True, eq=False)
class Check:
    """The outcome."""

    findings: tuple
    figures: dict
    """Name to number, for JSON: names end in their unit."""
    residual_mm: np.ndarray
    """float32 (H, W): mean distance from the plane, mm; NaN = unknown; None without a plane."""
    noise_mm: np.ndarray
    """float32 (H, W): standard deviation of the depth from pair to pair, mm; None = few pairs."""

    @property
    def level(self):
        """Return the worst level of the findings."""
        judged = [finding.level for finding in self.findings if finding.level in LEVELS]
        return max(judged, key=LEVELS.index, default=GOOD)

    def verdict(self):
        """Return the verdict as a sentence."""
        if self.level == GOOD:
            return 'The sensor is in order.'
        named = ', '.join(finding.name for finding in self.findings
                          if finding.level == self.level)
        if self.level == FAIR:
            return f'The sensor works, but could be better: {named}.'
        return f'The sensor is not in order: {named}.'


def graded(value, limits):
    """Return the level of a value; limits are those of good and fair, falling if more is good."""
    good, fair = limits
    if not np.isfinite(value):
        return NOTE
    sign = 1 if good < fair else -1
    return GOOD if sign * value <= sign * good else FAIR if sign * value <= sign * fair else POOR


def check(pairs, results, settings, distance=None, bar=None):
    """
    Check a sensor.

    Parameters
    ----------
    pairs : sequence of (left, right)
        Raw RGB images, uint8 (H, W, 3).
    results : sequence of RangeResult
        What the sensor made of each.
    settings : Settings
        Of the core.
    distance : float, optional
        True distance of the board from the left camera along the optical axis of the rectified
        camera, m.
    bar : (float, float), optional
        Distance of the centers and radius of the spheres of a bar, m; then no board is looked
        for.

    Returns
    -------
    found : Check

    Raises
    ------
    CalibrationError
        If the view shows neither board nor bar.

    """
    if not results:
        raise CalibrationError('there is no pair to check')
    findings, figures = [], {'pairs': len(results)}
    residual = noise = None
    if bar is None:
        planes = [measured_plane(result) for result in results]
        noise = _noise(results, planes[0].inside)
        residual = _mean([plane.residual_mm for plane in planes])
        findings += _about_plane(planes, results[-1], distance, noise, figures)
    else:
        findings += _about_bar([measured_spheres(result, bar[1]) for result in results], bar,
                               figures)
    findings += _about_rows(results[-1], figures)
    findings += _about_light(light_of(*pairs[-1], results[-1].image, settings), figures)
    return Check(tuple(findings), figures, residual, noise)


def _mean(images):
    stack = np.stack(images)
    count = np.isfinite(stack).sum(axis=0)
    return np.where(count > 0, np.nansum(stack, axis=0) / np.maximum(count, 1),
                    np.nan).astype(np.float32)


def _noise(results, inside):
    """Return the standard deviation of the depth of each pixel, mm, or None for few pairs."""
    if len(results) < TEMPORAL_PAIRS:
        return None
    depths = np.stack([result.depth for result in results]).astype(np.float64)
    always = np.isfinite(depths).all(axis=0) & inside
    spread = np.full(inside.shape, np.nan, np.float32)
    spread[always] = 1e3 * depths[:, always].std(axis=0, ddof=1)
    return spread


def _about_plane(planes, result, distance, noise, figures):
    """Return the findings on a flat board; adds to the figures."""
    def mean(name):
        return float(np.mean([getattr(plane, name) for plane in planes]))

    place, rms, rms_px = mean('distance_mm'), mean('rms_mm'), mean('rms_px')
    shape, flatness = mean('shape_mm'), max(plane.flatness_mm for plane in planes)
    density, outliers = mean('density'), mean('outliers')
    per_pixel = rms / max(rms_px, 1e-9)  # mm a px, at this distance
    claimed, ratio, wrong = mean('claimed_px'), mean('claim_ratio'), mean('claimed_wrong')
    shape_ratio = shape / per_pixel / claimed
    predicted = float(np.nanmedian(result.depth_std[planes[-1].inside]) * 1e3)
    figures.update(
        distance_mm=place, tilt_degrees=mean('tilt_degrees'), plane_rms_mm=rms,
        plane_rms_px=rms_px, claimed_px=claimed, claim_ratio=ratio, claimed_wrong=wrong,
        flatness_measurement_error_mm=flatness, shape_rms_mm=shape,
        density=density, outliers=outliers, predicted_noise_mm=predicted)
    found = [
        Finding('place of the board', f'{place:.1f} mm along the optical axis, tilted by '
                f'{mean("tilt_degrees"):.1f} degrees', NOTE),
        Finding('plane fit', f'RMS {rms:.3f} mm ({rms_px:.3f} px, {100 * rms / place:.3f} % of '
                'the distance)', NOTE),
        Finding('claims', f'68 % of the points lie within {ratio:.2f} of their own standard '
                'deviations', graded(ratio, CLAIM), 'calibrate the geometry anew, or check that '
                'the board is flat and dull'),
        Finding('noise that is claimed', f'{claimed:.3f} px ({predicted:.3f} mm) a pixel, median',
                graded(claimed / DISPARITY_STD, NOISE),
                'improve light, focus and contrast of the pattern; see the findings below'),
        Finding('flatness measurement error', f'{flatness:.3f} mm (the largest of the pairs, '
                '3 of 1,000 points left out)', NOTE),
        Finding('shape that stays', f'RMS {shape:.3f} mm ({shape / per_pixel:.3f} px) over '
                f'blocks of 16 px, {shape_ratio:.2f} times the noise that is claimed',
                graded(shape_ratio, SHAPE),
                'calibrate the geometry anew, or check that the board is flat'),
        Finding('density', f'{100 * density:.1f} % of the pixels of the board have a range',
                graded(density, DENSITY), 'look at the status picture of `color_stereo process`'),
        Finding('wrong ranges', f'{100 * outliers:.2f} % are off by more than 1 px; by their '
                f'confidence it should be {100 * wrong:.2f} %',
                graded(outliers / max(wrong, LEAST_WRONG), WRONG),
                'check pattern.type and the rows')]
    if distance is not None:
        bias = place - 1e3 * distance
        figures.update(bias_mm=bias, bias_percent=100 * bias / (1e3 * distance))
        found.append(Finding('bias', f'{bias:+.3f} mm ({figures["bias_percent"]:+.3f} %)',
                             graded(abs(figures['bias_percent']), BIAS_PERCENT),
                             'calibrate the geometry anew; a wrong yaw or baseline shows here '
                             'alone'))
    return [*found, *_about_noise(noise, predicted, figures)]


def _about_noise(noise, predicted, figures):
    """Return the findings on the noise from pair to pair."""
    if noise is None:
        return [Finding('temporal noise', f'needs {TEMPORAL_PAIRS} pairs of a scene at rest; '
                        f'the sensor itself predicts {predicted:.3f} mm', NOTE)]
    median = float(np.nanmedian(noise)) if np.isfinite(noise).any() else float('nan')
    figures['temporal_noise_mm'] = median
    return [Finding('temporal noise', f'{median:.3f} mm a pixel (median); the sensor itself '
                    f'predicts {predicted:.3f} mm', graded(median / predicted, CLAIM),
                    'check that nothing moves, and that lamps do not flicker')]


def _about_bar(bars, bar, figures):
    """Return the findings on a sphere bar."""
    length, radius = bar
    found = []
    for at, side in enumerate(('left', 'right')):
        spheres = [pair[at] for pair in bars]
        form = max(sphere.form_mm for sphere in spheres)
        size = max((sphere.size_mm for sphere in spheres), key=abs)
        expected = RANGE * max(sphere.claimed_mm for sphere in spheres)
        figures.update({f'probing_error_form_{side}_mm': form,
                        f'probing_error_size_{side}_mm': size})
        found += [Finding(f'probing error, form, {side} sphere', f'{form:.3f} mm; '
                          f'{expected:.3f} mm by the noise that is claimed',
                          graded(form / expected, CLAIM),
                          'improve light, focus and contrast of the pattern'),
                  Finding(f'probing error, size, {side} sphere', f'{size:+.3f} mm',
                          graded(abs(size) / (2e3 * radius), SIZE_SHARE),
                          'calibrate the geometry anew; gloss of the spheres has the same effect')]
    spacing = [1e3 * (np.linalg.norm(right.center - left.center) - length)
               for left, right in bars]
    worst = max(spacing, key=abs)
    figures['sphere_spacing_error_mm'] = worst
    return [*found, Finding('sphere-spacing error', f'{worst:+.3f} mm '
                            f'({worst / (10 * length):+.3f} %)',
                            graded(abs(worst) / (10 * length), SPACING_PERCENT),
                            'calibrate the geometry anew; check the size of the squares')]


def _about_rows(result, figures):
    """Return the finding on the rows of the two views."""
    alignment = result.alignment
    if alignment is None or not alignment.known:
        return [Finding('rows', rows_in_words(result), NOTE)]
    error, place = alignment.largest()
    figures['rows_px'] = error
    return [Finding('rows', f'off by {abs(error):.3f} px at most'
                    + (f' ({place})' if error else ''), graded(abs(error), ROWS_PX),
                    'calibrate the geometry anew; matching.row_alignment corrects rows, not '
                    'depth')]


def _about_light(light, figures):
    """Return the findings on exposure, colors and sharpness."""
    gain = np.maximum(light.gains, 1 / light.gains).max()
    balance = light.balance.max(axis=1) / np.maximum(light.balance.min(axis=1), 1e-9)
    contrast = light.contrast.min()
    figures.update(
        exposure_level=light.exposure.level, exposure_clipped=light.exposure.clipped,
        gains=[float(value) for value in light.gains], color_balance=float(balance.max()),
        contrast=float(contrast), feature_px=light.feature_px,
        sharpness=[[float(value) for value in row] for row in light.sharpness])
    sides = 'RGB'
    worst = np.argmin(light.contrast) if np.isfinite(contrast) else 0
    found = [
        Finding('exposure', light.exposure.sentence(), _exposure_level(light.exposure),
                light.exposure.sentence()),
        Finding('colors, left over right', ', '.join(
            f'{name} {value:.2f}' for name, value in zip(sides, light.gains)),
            graded(gain, GAIN), 'set both cameras to the same gain and white balance, or run '
            '`color_stereo calibrate color`'),
        Finding('color balance', f'strongest over weakest channel {balance[0]:.2f} left, '
                f'{balance[1]:.2f} right', graded(balance.max(), BALANCE),
                'set the white balance on a white card, without pattern'),
        Finding('contrast', f'{contrast:.2f} in the weakest channel '
                f'({("left", "right")[worst // 3]} {sides[worst % 3]})',
                graded(contrast, CONTRAST), 'darken the room, or use a brighter projector')]
    return [*found, *_about_focus(light)]


def _exposure_level(exposure):
    if not exposure.level:
        return POOR
    return GOOD if exposure.factor == 1.0 else FAIR


def _about_focus(light):
    """Return the findings on the sharpness of the pattern."""
    found = []
    if np.isfinite(light.feature_px):
        found.append(Finding(
            'size of the pattern', f'smallest structures {light.feature_px:.1f} px',
            graded(light.feature_px, (TUNING.least_feature, 0.75 * TUNING.least_feature)),
            'raise pattern.feature_size'))
    if np.isfinite(light.sharpness).any():
        least = np.unravel_index(np.nanargmin(light.sharpness), light.sharpness.shape)
        share = light.sharpness[least]
        found.append(Finding(
            'focus of the projector', f'weakest field, {PLACES[least[0]][least[1]]}, has '
            f'{100 * share:.0f} % of the sharpness of the best one', graded(share, SHARPNESS),
            'focus the projector on the board; a tilted projector needs a smaller aperture or '
            'more distance'))
    return found

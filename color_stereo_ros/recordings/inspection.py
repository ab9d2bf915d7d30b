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
What a recording holds, and whether it can be measured: a look that takes seconds.

The findings are plain values, as JSON holds them; `inspection_text` tells them to people.

"""

from dataclasses import asdict
import json
import shlex

import numpy as np

from .measuring import make_stereo
from .salvage import is_salvageable
from .sampling import Sampler, size_of
from .topics import guessed_pairs, NOTHING_NAMED, OPTIONS
from ..core.account import (are_gray, doubts_about_images, doubts_about_result, exposure_of, FEW,
                            main_reason, status_shares)
from ..core.patterns.frames import PATTERN
from ..core.patterns.seen import pattern_seen
from ..core.settings import flat, PatternSettings, updated
from ..errors import brief, ColorStereoError, RecordingError
from ..messages.pairs import rgb_pair

INFO, IMAGE = 'pattern/info', 'pattern/image'
"""Topics of pattern_node, without namespace."""
STEP = 4
"""Every so many rows and columns show how bright a pair is, as in the node."""
ENOUGH = 0.98
"""Share of the expected messages from which a recording counts as complete."""
PAUSE, PAUSE_PERIODS = 0.5, 5
"""s and frame periods without an image that are a pause: a busy recorder delays less."""


class Inspection:
    """
    One run of `color_stereo inspect`.

    Parameters
    ----------
    recording : Recording
    settings : RangeNodeSettings
    namespace : str or None
    named : StereoTopics
        Topics that the user names.
    options : sequence of str
        Options that the user gave; they belong to the command to run next.
    damage : sequence of str
        What is known to be damaged.

    """

    def __init__(self, recording, settings, namespace=None, named=NOTHING_NAMED, options=(),
                 damage=()):
        self._recording, self._settings = recording, settings
        self._namespace, self._named = namespace, named
        self._options = list(options)
        self.found = {'recording': str(recording.path), 'usable': False,
                      'bytes': size_of(recording.path), 'duration': recording.duration,
                      'topics': self._topics(), 'pair': None, 'pairing': None,
                      'calibration': None, 'images': None, 'pattern': None, 'density': None,
                      'damage': list(damage), 'doubts': [], 'problems': [], 'command': None}
        """The findings; lengths are in m, times in s, angles in degrees."""

    def look(self):
        """Look at everything; return the findings."""
        topics = self._choose_pair()
        if topics is None:
            return self.found
        sampler = self._sampled(topics)
        self._tell_pairing(topics, sampler)
        self._tell_calibration(sampler.watch)
        self._tell_pattern()
        self._measure(sampler.sample.pairs, sampler.watch.calibration)
        self.found['usable'] = not self.found['problems']
        if self.found['usable']:
            path = self._recording.path
            self.found['command'] = shlex.join(
                ['color_stereo', 'convert', str(path), f'{path.stem}_measured', *self._options])
        return self.found

    def _problem(self, text):
        self.found['problems'].append(text)

    def _doubt(self, text):
        """Note a doubt, once."""
        if text not in self.found['doubts']:
            self.found['doubts'].append(text)

    def _topics(self):
        recording, seconds = self._recording, self._recording.duration
        return [{'name': name, 'type': recording.topics[name], 'count': count,
                 'rate': (count - 1) / seconds if count > 1 and seconds else None,
                 'latched': name in recording.latched}
                for name, count in sorted(recording.counts.items())]

    def _choose_pair(self):
        """Return the StereoTopics to look at, or None; note how to name them."""
        compressed = self._settings.input.transport == 'compressed'
        reasons = []
        for kind in dict.fromkeys((compressed, True)):
            try:
                topics = self._recording.stereo_topics(self._namespace, self._named, kind)
                return self._note_pair(topics, kind, [])
            except RecordingError as error:
                reasons.append(str(error))
        for kind in (False, True):
            pairs = [pair for pair in guessed_pairs(self._recording.topics,
                                                    self._recording.counts, kind)
                     if None not in pair.names]
            if pairs and self._named == NOTHING_NAMED and self._namespace is None:
                for other in pairs[1:]:
                    self._doubt(f'there is another pair: {other.left_image} and '
                                f'{other.right_image}')
                named = [word for both in zip(OPTIONS, pairs[0].names) for word in both]
                return self._note_pair(pairs[0], kind, named)
        self._problem(reasons[0].removeprefix(f'{self._recording.path}: '))
        return None

    def _note_pair(self, topics, compressed, named):
        self._options += named
        if self._namespace is not None:
            self._options += ['--namespace', self._namespace]
        self._options += [word for option, name in zip(OPTIONS, self._named.names) if name
                          for word in (option, name)]
        changes = {}
        if compressed and self._settings.input.transport != 'compressed':
            changes['input.transport'] = 'compressed'
        if named and 'rect' in topics.left_image and not self._settings.input.rectified:
            changes['input.rectified'] = True
        self._set(changes)
        self.found['pair'] = {**dict(zip(('left_image', 'right_image', 'left_info',
                                          'right_info'), topics.names)),
                              'transport': 'compressed' if compressed else 'raw'}
        return topics

    def _set(self, changes):
        """Measure with changed settings, and let the next command do so, too."""
        self._settings = updated(self._settings, changes)
        for name, value in changes.items():
            self._options += [f'--{name}', str(value).lower() if isinstance(value, bool)
                              else str(value)]

    def _sampled(self, topics):
        """Return the Sampler of the recording; of a damaged one, of what can be read."""
        sampler = self._sampler(topics)
        damage = sampler.look().damage
        if not damage or self._recording.loss or not is_salvageable(self._recording.path):
            return sampler
        self.found['damage'] += damage
        damage.clear()
        try:
            self._recording.salvage()
        except RecordingError as error:
            damage.append(str(error))
            return sampler
        self.found['damage'].append(self._recording.loss)
        sampler = self._sampler(topics)
        sampler.look()
        return sampler

    def _sampler(self, topics):
        return Sampler(self._recording, topics, self._settings, lambda text: None)

    def _tell_pairing(self, topics, sampler):
        sample, recording = sampler.sample, self._recording
        self.found['damage'] += sample.damage
        if sampler.refusals:
            self.found['damage'].append(f'{sampler.refusals} at {sample.windows} places; the '
                                        f'first: {sampler.refusals.first}')
        expected = missing = None
        if sample.period:
            expected = recording.duration * 1e9 / sample.period + 1
            missing = max(0.0, 1 - recording.counts[topics.left_image] / expected)
        skews, pauses = np.abs(sample.skews), self._pauses(topics.left_image, sample.period)
        self.found['pairing'] = {
            'places': sample.windows, 'images': sample.images, 'share': sample.share,
            'skew_median': float(np.median(sample.skews)) * 1e-9 if len(skews) else None,
            'skew_largest': float(skews.max()) * 1e-9 if len(skews) else None,
            'period': sample.period and sample.period * 1e-9,
            'gaps': len(sample.gaps),
            'gap_longest': max(sample.gaps) * 1e-9 if sample.gaps else None,
            'pauses': len(pauses), 'pause_longest': max(pauses, default=None),
            'missing': missing, 'stamps_backwards': sample.backwards,
            'stamps_zero': sample.without_stamp}
        if not sample.skews:
            self._problem('no left and right image have stamps that fit together: the cameras '
                          'are not synchronized; --sync.tolerance widens what counts as a pair'
                          if sample.images or not sample.empty else 'no image could be read')
        elif sample.share < ENOUGH:
            self._doubt(f'{1 - sample.share:.0%} of the images have no partner')
        if sample.empty:
            self._doubt(f'{sample.empty} of {sample.windows} places hold no image: the cameras '
                        'were recorded for a part of the time')
        elif missing is not None and missing > 1 - ENOUGH:
            self._doubt(f'about {missing:.0%} of the left images are missing in the recording')
        if pauses:
            self._doubt(f'{len(pauses)} pauses of the left images, the longest of '
                        f'{max(pauses):.2f} s')
        if sample.backwards:
            self._doubt(f'{sample.backwards} stamps lie before the one before')
        if sample.without_stamp:
            self._doubt(f'{sample.without_stamp} images have no stamp')

    def _pauses(self, topic, period):
        """Return the pauses of a topic over the whole time, s, by when it was recorded."""
        try:
            steps = np.diff(self._recording.record_times(topic)) * 1e-9
        except RecordingError as error:
            self.found['damage'].append(str(error))
            return []
        return steps[steps > max(PAUSE, PAUSE_PERIODS * (period or 0) * 1e-9)].tolist()

    def _tell_calibration(self, watch):
        calibration, error = watch.calibration, watch.error
        if calibration is None:
            error = error or f'no camera_info of the {" and the ".join(watch.missing)} camera'
            self._problem(f'calibration: {error}')
            self.found['calibration'] = {'usable': False, 'error': error}
            return
        geometry = calibration.geometry
        self.found['calibration'] = {
            'usable': True, 'error': None, 'width': geometry.width, 'height': geometry.height,
            'focal_length': geometry.focal_x, 'baseline': geometry.baseline,
            'changes': max(watch.changes - 1, 0)}
        for text in watch.warnings:
            self._doubt(text)
        if watch.changes > 1:
            self._doubt(f'the calibration changes {watch.changes - 1} times')

    def _tell_pattern(self):
        """Note what the recording says of the pattern, and measure with that."""
        self.found['pattern'] = {'recorded': None, 'seen': None, 'agrees': None}
        content = self._first(INFO)
        if content is None:
            recorded = self._topic(IMAGE) is not None
            self.found['pattern']['recorded'] = 'as an image, without its settings' * recorded \
                or None
            return
        try:
            shown = json.loads(str(content.data))
            pattern = PatternSettings(**shown['pattern'])
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            self._doubt(f'{INFO} cannot be read: {error}')
            return
        if shown.get('frame', PATTERN) != PATTERN:
            self._doubt(f'pattern_node showed {brief(shown["frame"])} instead of the pattern')
        self.found['pattern']['recorded'] = asdict(pattern)
        own = asdict(self._settings.pattern)
        self._set({f'pattern.{name}': value for name, value in asdict(pattern).items()
                   if own[name] != value})

    def _topic(self, ending):
        """Return the topic of pattern_node with messages, beside the cameras if there, or None."""
        found = [name for name in self._recording.topics
                 if f'/{name}'.endswith(f'/{ending}') and self._recording.counts[name]]
        return min(found, key=len, default=None)

    def _first(self, ending):
        """Return the first message of a topic, decoded, or None."""
        topic = self._topic(ending)
        try:
            message = next(self._recording.messages({topic}), None) if topic else None
            return message and self._recording.decoded(message)
        except RecordingError as error:
            self.found['damage'].append(str(error))
            return None

    def _measure(self, pairs, calibration):
        """Measure some pairs, and note what they show."""
        images = [found for found in map(self._images_of, pairs) if found is not None]
        if not images:
            return
        self._tell_images(images)
        if calibration is None:
            return
        # two views tell as much of the density, and nothing is searched for
        settings = updated(self._settings, {'matching.third_view': 'off'})
        try:
            stereo = make_stereo(calibration, settings)
            results = [stereo.process(*pair) for pair in images]
        except ColorStereoError as error:
            self._problem(str(error))
            return
        self._tell_density(results)
        middle = len(results) // 2
        self._tell_seen(images[middle], results[middle])
        for text in doubts_about_result(stereo, *images[middle], results[middle]):
            self._doubt(text)

    def _images_of(self, pair):
        """Return both images of a pair as RGB, or None."""
        try:
            opened = rgb_pair(pair)
        except ColorStereoError as error:
            self._problem(str(error))
            return None
        return opened.left, opened.right

    def _tell_images(self, images):
        level = flat(self._settings)['color.saturation_level']
        found = [exposure_of(left[::STEP, ::STEP], right[::STEP, ::STEP], level)
                 for left, right in images]
        middle = found[len(found) // 2]
        doubts = list(dict.fromkeys(text for pair in images for text in doubts_about_images(
            *pair)))
        self.found['images'] = {
            'width': images[0][0].shape[1], 'height': images[0][0].shape[0],
            'gray': are_gray(*images[0]), 'brightest': middle.level, 'clipped': middle.clipped,
            'exposure': middle.sentence()}
        if middle.factor != 1.0 or not middle.level:
            self._doubt(middle.sentence())
        for text in doubts:
            self._doubt(text)

    def _tell_density(self, results):
        densities = [result.density for result in results]
        known = np.concatenate([result.depth[np.isfinite(result.depth)] for result in results])
        near, middle, far = (np.percentile(known, (1, 50, 99)).tolist() if known.size
                             else 3 * [None])
        shares = status_shares(np.stack([result.status for result in results]))
        self.found['density'] = {
            'pairs': densities, 'mean': float(np.mean(densities)), 'depth_near': near,
            'depth_median': middle, 'depth_far': far, 'others': main_reason(shares)}
        if self.found['density']['mean'] < FEW:
            self._problem(f'hardly any pixel has a range; {main_reason(shares)}')

    def _tell_seen(self, images, result):
        gray = are_gray(*(image[::STEP, ::STEP] for image in images))
        seen = pattern_seen(result.image, self._settings.pattern, gray)
        self.found['pattern'] |= {'seen': seen.sentence, 'agrees': seen.agrees}
        if seen.agrees is False:
            self._doubt(f'{seen.sentence}; --pattern.type names the pattern that was projected')

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
"""The findings of an Inspection for people."""

WIDTH = 13
"""Characters of the first column."""
LEAST_TOLD = 0.001
"""Share of missing images that is told."""


def inspection_text(found):
    """
    Return the findings as text.

    Parameters
    ----------
    found : dict
        Inspection.found.

    Returns
    -------
    text : str

    """
    rows = [('recording', f'{found["recording"]}: {found["duration"]:.1f} s, '
             f'{found["bytes"] / 1e6:.1f} MB')]
    rows += [('', line) for line in _topics(found['topics'])]
    for name, tell in (('pair', _pair), ('pairing', _pairing), ('calibration', _calibration),
                       ('images', _images), ('pattern', _pattern), ('density', _density)):
        if found[name] is not None:
            rows.append((name, tell(found[name])))
    for name in ('damage', 'doubts', 'problems'):
        rows += [(name, text) for text in found[name]]
    rows.append(('verdict', 'can be measured' if found['usable'] else 'cannot be measured as it '
                 'is'))
    if found['command']:
        rows.append(('next', found['command']))
    return '\n'.join(f'{name:{WIDTH}}{text}'.rstrip() for name, text in rows)


def _topics(topics):
    """Return a line for each topic."""
    wide = max((len(topic['name']) for topic in topics), default=0)
    kinds = max((len(topic['type']) for topic in topics), default=0)
    return [f'{topic["name"]:{wide}}  {topic["type"]:{kinds}}  {topic["count"]:6}'
            + (f'  {topic["rate"]:7.2f} Hz' if topic['rate'] else '')
            + ('  latched' if topic['latched'] else '') for topic in topics]


def _pair(pair):
    return (f'{pair["left_image"]} and {pair["right_image"]}, {pair["transport"]}, with '
            f'{pair["left_info"]} and {pair["right_info"]}')


def _pairing(pairing):
    read = 'all read' if pairing['places'] == 1 else f'read at {pairing["places"]} places'
    if pairing['share'] is None:
        return f'{read}: no image has a partner'
    texts = [f'{pairing["share"]:.0%} of {pairing["images"]} images have a partner ({read})']
    if pairing['skew_largest'] is not None:
        texts.append(f'right after left by {pairing["skew_median"] * 1e3:.2f} ms (median), '
                     f'largest {pairing["skew_largest"] * 1e3:.2f} ms')
    if pairing['period']:
        texts.append(f'frame period {pairing["period"] * 1e3:.1f} ms')
    gaps = f'{pairing["gaps"]} gaps'
    if pairing['gap_longest']:
        gaps += f', the longest {pairing["gap_longest"]:.3f} s'
    texts.append(gaps)
    if pairing['pauses']:
        texts.append(f'{pairing["pauses"]} pauses, the longest {pairing["pause_longest"]:.2f} s')
    if (pairing['missing'] or 0) >= LEAST_TOLD:
        texts.append(f'about {pairing["missing"]:.1%} of all images missing')
    return '; '.join(texts)


def _calibration(calibration):
    if not calibration['usable']:
        return f'refused: {calibration["error"]}'
    return (f'usable: {calibration["width"]} x {calibration["height"]} px, focal length '
            f'{calibration["focal_length"]:.1f} px, baseline '
            f'{calibration["baseline"] * 1e3:.2f} mm')


def _images(images):
    gray = ', gray' if images['gray'] else ''
    return f'{images["width"]} x {images["height"]} px{gray}; {images["exposure"]}'


def _pattern(pattern):
    texts = []
    if isinstance(pattern['recorded'], dict):
        shown = pattern['recorded']
        texts.append(f'recorded: {shown["type"]}, {shown["width"]} x {shown["height"]} px, '
                     f'feature size {shown["feature_size"]:g} px')
    elif pattern['recorded']:
        texts.append(f'recorded {pattern["recorded"]}')
    if pattern['seen']:
        texts.append(f'seen: {pattern["seen"]}')
    return '; '.join(texts) or 'unknown'


def _density(density):
    each = ', '.join(f'{share:.0%}' for share in density['pairs'])
    text = f'{density["mean"]:.0%} of the pixels have a range (pairs: {each})'
    if density['depth_median'] is not None:
        text += (f', depth {density["depth_near"]:.3g} .. {density["depth_far"]:.3g} m, median '
                 f'{density["depth_median"]:.3g} m')
    return f'{text}; others: {density["others"]}'

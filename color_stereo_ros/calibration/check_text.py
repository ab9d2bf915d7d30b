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
"""The report of a check as text for a terminal and as JSON."""

import json
import math

import numpy as np

from .checking import FAIR, GOOD, NOTE, POOR

MARKS = {GOOD: 'ok  ', FAIR: 'FAIR', POOR: 'POOR', NOTE: '    '}
TERMS = ('Terms of VDI/VDE 2634 part 2: flatness measurement error, probing error (form, size), '
         'sphere-spacing error. They are measured at this one position of the artifact. This is '
         'no claim of conformity: the guideline asks for several positions and for calibrated '
         'artifacts.')


def check_text(found):
    """Return a Check as text for a terminal."""
    width = max(len(finding.name) for finding in found.findings)
    lines = [f'{MARKS[finding.level]}  {finding.name:{width}}  {finding.text}'
             for finding in found.findings]
    changes = [f'  - {finding.name}: {finding.advice}' for finding in to_change(found)]
    advice = ['What to change:', *changes] if changes else []
    return '\n'.join([*lines, '', found.verdict(), *advice, '', TERMS])


def to_change(found):
    """Return the findings that ask for a change, the worst first."""
    judged = [finding for finding in found.findings
              if finding.level in (FAIR, POOR) and finding.advice]
    return sorted(judged, key=lambda finding: finding.level == FAIR)


def check_json(found):
    """Return a Check as JSON; numbers that are not known are null."""
    content = {'verdict': found.level, 'sentence': found.verdict(), 'terms': TERMS,
               'figures': _plain(found.figures),
               'findings': [{'name': finding.name, 'text': finding.text, 'level': finding.level,
                             'advice': finding.advice if finding.level in (FAIR, POOR) else ''}
                            for finding in found.findings]}
    return json.dumps(content, indent=1, allow_nan=False) + '\n'


def _plain(value):
    if isinstance(value, dict):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, list):
        return [_plain(each) for each in value]
    if isinstance(value, (int, np.integer)):
        return int(value)
    return float(value) if math.isfinite(value) else None

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
"""The arguments of the fits; needs neither the method nor the simulator."""

MODELS = {
    'trust': 'log-odds that a node is right within 1 px: form and hidden_odds',
    'slow': 'offset of the log-odds under one sine and one sweep: odds_offset',
    'spread': 'standard deviation of a node: variance_factor and std_per_distance',
    'period': 'log-odds of the right period under 16 sines: shares and odds',
    'third': 'log-odds of the projector as a third view, alone and beside two cameras',
    'doubts': 'what log-odds of three views lose, and in which pairs: doubts, expected_wrong',
    'certainty': 'how certain the third view makes pairs that two cameras find hard: '
                 'kept_certainty',
    'steps': 'log-odds that ranges lose beside steps in pairs that say little there: odds',
    'temper': 'log-odds under other than aperiodic colors: tempered_odds, tempered_factor, '
              'rough_odds',
    'quality': 'variance of planes by how well they fit around: pull_gain, uneven_power',
}
LIT = 'third', 'doubts', 'certainty', 'steps', 'temper', 'quality'
"""Fits to the light of `evaluate --stress`."""


def add_arguments(parser):
    """Declare the arguments that all fits have."""
    parser.add_argument('scenes', nargs='*', metavar='SCENE',
                        help='names of simulated scenes (default: those of the fit)')
    parser.add_argument('--cache', metavar='FOLDER', default='render_output/cache',
                        help='keeps what does not depend on the pattern (default %(default)s)')
    parser.add_argument('--output', metavar='FILE',
                        help='write the model to a YAML file as core/surface/models has them')
    parser.add_argument('--seed', type=int, default=1,
                        help='seed of the camera noise (default %(default)s)')
    parser.add_argument('--quick', action='store_true',
                        help='three scenes, one sample per pixel, no bounced light, one round: '
                        'shows that it works, and no more')

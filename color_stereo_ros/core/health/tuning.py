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
"""All constants of the health: value, unit, reason and provenance of each."""

from dataclasses import dataclass

from ..constants import chosen, constant, Constants, derived, unexplained


@dataclass(frozen=True)
class EstimateTuning(Constants):
    """From the row evidence of pairs to the drift."""

    calibrated_std: tuple = constant(
        (0.01, 0.01, 0.02, 0.05, 0.01, 0.01), 'degrees, %', 'Standard deviations of pitch, yaw, '
        'roll, focal ratio and direction of the baseline of a calibration without covariance.',
        chosen('Rows of a good calibration of ROS agree to .25 px, 2 standard deviations.'))
    knocked_std: tuple = constant(
        (0.3, 0.3, 0.3, 0.1, 0.005, 0.005), 'degrees, %', 'The same of what a knock adds.',
        chosen('A camera turns in its mount, and its center moves by .02 mm in 200 mm.'))
    knock_odds: float = constant(
        14.0, '1', 'Least logarithm of the Bayes factor of a knock.',
        derived('A million to one: no false alarm in days of pairs that depend on each other.'))
    bias_std: float = constant(
        0.004, 'px', 'Standard deviation of each of the seven row terms that a scene adds to the '
        'drift.', derived('As rows.estimate.floor_std.'))
    bump: float = constant(
        0.06, 'px', 'Difference between pair and drift, root mean square over the evidence, from '
        'which earlier pairs are forgotten.',
        chosen('Five times what undisturbed pairs scatter.'))
    every: int = constant(
        5, 'pairs', 'One pair of so many is used.',
        derived('An update takes some 2 ms, a pair then .4 ms on average. One more than the turns '
                'of cells, so that all turns come.'))
    first: int = constant(
        5, 'pairs', 'Pairs at the beginning, and after a knock, that are all used.',
        derived('All turns of cells, and once more the first: the pair that shows a knock was '
                'measured with the maps from before it.'))
    iterations: int = constant(
        4, '1', 'Most linearizations of one update.', derived('Two suffice up to .3 degrees.'))
    settled: float = constant(
        0.05, 'px', 'Step of the rows after which there is no further linearization.',
        derived('What is left is quadratic in it.'))
    focal_step: float = constant(
        1e-5, '1', 'Step of the focal length for the derivative by it: a lens has no closed '
        'inverse.', derived('Rounding and curvature are both below 1e-5 of it.'))
    samples: int = constant(
        400, '1', 'Largest number of cells that are used of a pair.',
        derived('Bounds the time; .1 px each make .005 px.'))


@dataclass(frozen=True)
class PriorTuning(Constants):
    """From the covariance of a calibration to that of the drift."""

    grid: int = constant(
        7, '1', 'Places along either axis of the image where parameters and drift are compared.',
        unexplained('Fields are polynomials of low degree.'))
    depths: tuple = constant(
        (2.0, 3.0, 6.0), 'baselines', 'Depths of these places.',
        chosen('The usual working range of a rig.'))
    least_std: float = constant(
        1e-6, 'rad', 'Standard deviation that every number keeps.',
        derived('Far below all bounds; the covariance can be inverted.'))
    step: float = constant(
        1e-6, 'rad', 'Step of a drift for the derivatives of the parameters.',
        derived('Rounding and curvature are both below 1e-8 of them.'))
    same: float = constant(
        1e-5, '1', 'Relative difference of two standard deviations that are the same.',
        derived('More than text rounds.'))


@dataclass(frozen=True)
class UseTuning(Constants):
    """What is told, and when the maps are corrected."""

    told_rows: float = constant(
        0.1, 'px', 'Row error from which a drift is told.',
        chosen('Half of .02 degrees of pitch at a focal length of 640 px.'))
    told_disparity: float = constant(
        0.1, 'px', 'Error of the disparities from which a drift is told.',
        chosen('Three times the noise of a pair.'))
    sure: float = constant(
        5.0, '1', 'Standard deviations that a told drift exceeds.',
        derived('Chance of a millionth.'))
    known: float = constant(
        0.5, '1', 'Share of the standard deviation before anything is seen below which a number '
        'of the drift is observable.', unexplained('Evidence then counts three times the prior.'))
    least_change: float = constant(
        0.02, 'px', 'Change of rows or disparities that is worth new maps.',
        derived('Less than the noise of a pair.'))
    worth: float = constant(
        0.5, '1', 'The same in standard deviations.',
        derived('Smaller changes are noise of the estimate.'))
    largest: tuple = constant(
        (1.0, 1.0, 1.0, 1.0), 'degrees, %', 'Largest pitch, yaw, roll and focal ratio that are '
        'corrected.', chosen('Beyond, the camera is loose or was exchanged: calibrate anew.'))
    grid: int = constant(
        5, '1', 'Places along either axis of the image where rows and depth are judged.',
        unexplained('As for the row alignment.'))


@dataclass(frozen=True)
class Tuning(Constants):
    """All constants of the health."""

    estimate: EstimateTuning = EstimateTuning()
    prior: PriorTuning = PriorTuning()
    use: UseTuning = UseTuning()


TUNING = Tuning()

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
"""The plot of a plan: depth error, disparity and common view over the depth."""

from ..files.atomic import written_whole

STYLE = {'font.size': 9.5, 'axes.spines.top': False, 'axes.spines.right': False,
         'axes.grid': True, 'grid.color': '#e6e8ec', 'legend.frameon': False,
         'axes.titlesize': 10.5, 'axes.titlelocation': 'left', 'svg.hashsalt': 'color_stereo'}


def write_plot(plan, path):
    """
    Write the plot of a Plan.

    Parameters
    ----------
    plan : Plan
        What is planned, and what it should give.
    path : path-like
        Its suffix says the format: .svg, .png, .pdf.

    Raises
    ------
    RecordingError
        If matplotlib knows no format of that suffix, or the file cannot be written.

    """
    import matplotlib
    from matplotlib.figure import Figure

    from ..errors import RecordingError
    with matplotlib.rc_context(STYLE):
        figure = Figure((10.5, 3.4), layout='constrained')
        errors, disparities, views = figure.subplots(1, 3)
        _plot_errors(errors, plan)
        disparities.plot(plan.depth, plan.disparity, color='#3d6cb4')
        disparities.set(title='disparity', xlabel='depth, m', ylabel='px')
        for values, label, color in ((plan.common_width, 'width', '#0b7a5b'),
                                     (plan.common_height, 'height', '#c8553d')):
            views.plot(plan.depth, values, label=label, color=color)
        views.set(title='seen by both cameras', xlabel='depth, m', ylabel='m', ylim=(0, None))
        views.legend()
        try:
            with written_whole(path) as partial:
                figure.savefig(partial, dpi=130)
        except (OSError, ValueError) as error:
            raise RecordingError(f'{path}: cannot be written: {error}') from error


def _plot_errors(axes, plan):
    """Plot the standard deviations of the depth."""
    for values, label, style in ((plan.matching_std, 'matching', '--'),
                                 (plan.calibration_std, 'calibration', ':'),
                                 (plan.total_std, 'both', '-')):
        axes.plot(plan.depth, 1e3 * values, style, label=label, color='#0b7a5b')
    axes.set(title='standard deviation of the depth', xlabel='depth, m', ylabel='mm',
             yscale='log')
    axes.legend()

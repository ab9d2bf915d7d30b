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
"""A hand-eye calibration as text: for people, as YAML, and as a command that publishes it."""

import numpy as np

from .hand_eye import as_degrees, as_millimeters
from .rigid import quaternions_of
from ..files.yaml import yaml_text

ORDER = 'rotation_x', 'rotation_y', 'rotation_z', 'x', 'y', 'z'


def account(found):
    """Return what a HandEye says, with a line for each pose."""
    millimeters, degrees = 1e3 * found.position_std, np.degrees(found.rotation_std)
    position, rotation = as_millimeters(found.position), as_degrees(found.rotation)
    lines = [f'{found.mounting}: {np.count_nonzero(found.used)} of {len(found.names)} poses',
             '  position  ' + ', '.join(f'{axis} {1e3 * value:.2f} +- {std:.2f} mm' for
                                        axis, value, std in zip('xyz', found.camera[1],
                                                                millimeters)),
             f'  rotation  +- {", ".join(f"{value:.3f}" for value in degrees)} degrees about '
             'x, y, z',
             f'  robot     {1e3 * found.robot_noise[0]:.3f} mm and '
             f'{np.degrees(found.robot_noise[1]):.4f} degrees a coordinate (standard deviation)',
             '  residual of each pose of the flange:']
    width = max(len(name) for name in found.names)
    for name, used, near, turned in zip(found.names, found.used, position, rotation):
        lines.append(f'    {name:{width}}  {near:8.3f} mm  {turned:8.4f} degrees'
                     + ('' if used else '  LEFT OUT: does not fit the others'))
    return '\n'.join(lines)


def hand_eye_yaml(found, camera, parent, child, frame):
    """
    Return a HandEye as YAML.

    Parameters
    ----------
    found : HandEye
        The estimate and how exact it is.
    camera : (R, t)
        The pose to write.
    parent, child : str
        Names of frames.
    frame : str
        'physical' or 'rectified'.

    """
    x, y, z, w = (float(value) for value in _quaternion(camera[0]))
    position, rotation = as_millimeters(found.position), as_degrees(found.rotation)
    content = {
        'mounting': found.mounting, 'frame_id': parent, 'child_frame_id': child,
        'left_camera': frame,
        'translation': dict(zip('xyz', map(float, camera[1]))),
        'rotation': {'x': x, 'y': y, 'z': z, 'w': w},
        'covariance_order': list(ORDER),
        'covariance': [[float(value) for value in row] for row in found.covariance],
        'std_mm': [float(value) for value in 1e3 * found.position_std],
        'std_degrees': [float(value) for value in np.degrees(found.rotation_std)],
        'robot_noise': {'position_mm': float(1e3 * found.robot_noise[0]),
                        'rotation_degrees': float(np.degrees(found.robot_noise[1]))},
        'poses': [{'name': name, 'used': bool(used), 'residual_mm': float(near),
                   'residual_degrees': float(turned)} for name, used, near, turned in zip(
                       found.names, found.used, position, rotation)]}
    head = ('# X_parent = R X_camera + t; m, rad; the covariance is that of a small turn about '
            'the axes of\n# the parent and a small shift.\n')
    return head + yaml_text(content)


def static_transform(camera, parent, child):
    """Return the command that publishes a pose (R, t) as a static transform."""
    place = ' '.join(f'--{axis} {value:.6f}' for axis, value in zip('xyz', camera[1]))
    turn = ' '.join(f'--q{axis} {value:.8f}'
                    for axis, value in zip('xyzw', _quaternion(camera[0])))
    return (f'ros2 run tf2_ros static_transform_publisher {place} {turn} --frame-id {parent} '
            f'--child-frame-id {child}')


def _quaternion(rotation):
    """Return x, y, z, w with w >= 0."""
    quaternion = quaternions_of(rotation)
    return quaternion if quaternion[3] >= 0 else -quaternion

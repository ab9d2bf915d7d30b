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
Objects of a scene: their fields, and what Mitsuba needs to know of them.

Every shape has its own frame, in m: x right, y down, z away from the cameras when not rotated.

"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .board_shape import board_meshes, INK, read_board
from .fields import Reader
from .geometry import Pose
from .materials import Material, read_material
from .relief import read_relief, relief_mesh


@dataclass(frozen=True, eq=False)
class SceneObject:
    """A shape with a material at a place."""

    shape: str
    """Name in SHAPES."""
    form: dict
    """The shape's own checked fields."""
    pose: Pose
    """Scene frame from shape frame."""
    material: Material
    path: tuple = ()
    """Poses of a sequence, frame by frame; empty = `pose` all the time."""

    def at(self, frame):
        """Return the object as it stands in one frame of a sequence; the last pose stays."""
        if not self.path:
            return self
        return replace(self, pose=self.path[min(frame, len(self.path) - 1)])


def read_object(node: Reader):
    """Return the SceneObject of an entry of the field `objects`."""
    if not isinstance(node.value, dict):
        node.only('shape')
    read_form = SHAPES[node.get('shape').choice(SHAPES)][0]
    form = read_form(node)
    node.only('shape', 'position', 'rotation', 'material', 'path', 'name', *form)
    return SceneObject(node.value['shape'], form, read_pose(node),
                       read_material(node.get('material', 'white_cardboard')), read_path(node))


def read_pose(node):
    """Return the Pose of the fields `position` (m) and `rotation` (degrees), default zero."""
    return Pose.from_degrees(node.get('position', [0, 0, 0]).vector(),
                             node.get('rotation', [0, 0, 0]).vector())


def read_path(node):
    """Return the Poses of the field `path`: a list of mappings with position and rotation."""
    steps = node.get('path', []).items()
    return tuple(read_pose(step.only('position', 'rotation')) for step in steps)


def _sizes(name, default, length):
    def read(node):
        return {name: node.get(name, default).vector(length, 1e-5, 100.0)}
    return read


def _lengths(**defaults):
    def read(node):
        return {name: node.get(name, default).number(1e-5, 100.0)
                for name, default in defaults.items()}
    return read


def _read_tube(node):
    form = _lengths(outer=0.02, bore=0.01, length=0.01)(node)
    form['sides'] = node.get('sides', 96).integer(3, 1024)
    if form['bore'] >= form['outer']:
        node.get('bore', 0.01).fail(f'less than outer = {form["outer"]} m')
    return form


def _read_revolved(node):
    profile = [point.vector(2) for point in node.get('profile').items()]
    if len(profile) < 2:
        node.get('profile').fail('two or more [radius, z] points')
    return {'profile': profile, 'sides': node.get('sides', 96).integer(3, 1024)}


def _read_mesh(node):
    return {'file': str(node.get('file').existing_file()),
            'scale': node.get('scale', 1.0).number(1e-6, 1e6),
            'smooth': node.get('smooth', False).flag()}


def _read_wire_grid(node):
    form = {'size': node.get('size', [0.1, 0.1]).vector(2, 1e-3, 10.0)}
    form.update(_lengths(pitch=0.012, wire=0.002)(node))
    return form


def _plane(mitsuba, form):
    scale = (form['size'][0] / 2, form['size'][1] / 2, 1)
    # Mitsuba's rectangle looks along +z; ours looks at the cameras.
    return [({'type': 'rectangle'}, np.diag([scale[0], -scale[1], -1, 1]))]


def _sphere(mitsuba, form):
    return [({'type': 'sphere', 'radius': form['radius']}, np.eye(4))]


def _box(mitsuba, form):
    return [({'type': 'cube'}, np.diag([*(size / 2 for size in form['size']), 1]))]


def _cylinder(mitsuba, form):
    radius, half = form['radius'], form['length'] / 2
    wall = {'type': 'cylinder', 'p0': [0, 0, -half], 'p1': [0, 0, half], 'radius': radius}
    caps = []
    for side in (-1, 1):
        matrix = np.diag([radius, side * radius, side, 1.0])
        matrix[2, 3] = side * half
        caps.append(({'type': 'disk'}, matrix))
    return [(wall, np.eye(4)), *caps]


def _wire_grid(mitsuba, form):
    wires = []
    for axis in (0, 1):
        reach, across = form['size'][axis] / 2, form['size'][1 - axis] / 2
        for offset in np.arange(-across, across + 1e-9, form['pitch']):
            start = np.zeros(3)
            start[1 - axis], start[2] = offset, (axis - 0.5) * form['wire']
            end = start.copy()
            start[axis], end[axis] = -reach, reach
            wires.append(({'type': 'cylinder', 'p0': start.tolist(), 'p1': end.tolist(),
                           'radius': form['wire'] / 2}, np.eye(4)))
    return wires


def revolved_mesh(profile, sides):
    """
    Return the mesh of a profile that turns about the z axis.

    Parameters
    ----------
    profile : list of (float, float)
        Radius (corner radius of a polygon) and z, m.
    sides : int
        Corners of each ring.

    Returns
    -------
    vertices : numpy.ndarray, float64, shape (V, 3)
    faces : numpy.ndarray, int32, shape (F, 3)

    """
    angles = 2 * np.pi * np.arange(sides) / sides
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    vertices = np.concatenate([
        np.column_stack([radius * circle, np.full(sides, z)]) for radius, z in profile])
    return vertices, _ring_faces(len(profile), sides)


def _ring_faces(rings, sides):
    corner = np.arange(sides)
    following = (corner + 1) % sides
    faces = []
    for ring in range(rings - 1):
        low, high = ring * sides, (ring + 1) * sides
        faces.append(np.column_stack([low + corner, low + following, high + following]))
        faces.append(np.column_stack([low + corner, high + following, high + corner]))
    return np.concatenate(faces).astype(np.int32)


def tube_mesh(outer, bore, length, sides):
    """
    Return the mesh of a prism or cylinder with a round hole: a nut has 6 sides.

    Parameters
    ----------
    outer : float
        Distance of the outer faces from the axis, m: half the width across flats.
    bore : float
        Radius of the hole, m.
    length : float
        Extent along z, m.
    sides : int
        Outer faces; 96 = round.

    Returns
    -------
    vertices : numpy.ndarray, float64, shape (V, 3)
    faces : numpy.ndarray, int32, shape (F, 3)

    """
    corners = sides * max(1, 96 // sides)
    angles = 2 * np.pi * np.arange(corners) / corners
    sector = 2 * np.pi / sides
    to_face = (angles % sector) - sector / 2
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    rims = [(outer / np.cos(to_face)[:, None] * circle), bore * circle]
    half = length / 2
    rings = [(rims[0], -half), (rims[0], half), (rims[1], half), (rims[1], -half),
             (rims[0], -half)]
    vertices = np.concatenate([np.column_stack([rim, np.full(corners, z)]) for rim, z in rings])
    return vertices, _ring_faces(len(rings), corners)


def _from_mesh(build, smooth=False):
    def shapes(mitsuba, form):
        vertices, faces = build(form)
        return [(_Mesh(vertices, faces, smooth), np.eye(4))]
    return shapes


@dataclass(frozen=True, eq=False)
class _Mesh:
    """Triangles that go to Mitsuba by way of a PLY file."""

    vertices: np.ndarray
    faces: np.ndarray
    smooth: bool
    uv: np.ndarray = None
    inked: bool = False


def _board(mitsuba, form):
    white, black = board_meshes(form)
    return [(_Mesh(*white, False), np.eye(4)), (_Mesh(*black, False, inked=True), np.eye(4))]


def _relief(mitsuba, form):
    vertices, faces, uv = relief_mesh(form)
    return [(_Mesh(vertices, faces, True, uv), np.eye(4))]


def _mesh(mitsuba, form):
    kind = Path(form['file']).suffix.lower().lstrip('.')
    return [({'type': 'obj' if kind == 'obj' else 'ply', 'filename': form['file'],
              'face_normals': not form['smooth']},
             np.diag([form['scale']] * 3 + [1]))]


SHAPES = {
    'plane': (_sizes('size', [1.0, 1.0], 2), _plane),
    'sphere': (_lengths(radius=0.05), _sphere),
    'cylinder': (_lengths(radius=0.02, length=0.1), _cylinder),
    'box': (_sizes('size', [0.05, 0.05, 0.05], 3), _box),
    'tube': (_read_tube, _from_mesh(lambda form: tube_mesh(**form))),
    'revolved': (_read_revolved, _from_mesh(lambda form: revolved_mesh(**form))),
    'wire_grid': (_read_wire_grid, _wire_grid),
    'height_field': (read_relief, _relief),
    'mesh': (_read_mesh, _mesh),
    'board': (read_board, _board),
}
INK_MATERIAL = Material((INK,) * 3)
"""Of the parts of a shape that are printed black."""


def mitsuba_shapes(mitsuba, scene_object, folder):
    """
    Return Mitsuba's descriptions of an object, and which of them are printed black.

    Parameters
    ----------
    mitsuba : module
        With a variant chosen.
    scene_object : SceneObject
        One object of the scene.
    folder : pathlib.Path
        Takes the PLY files of generated meshes; they must live until the scene is loaded.

    Returns
    -------
    shapes : list of (dict, bool)
        Without materials. True: of INK_MATERIAL instead of that of the object.

    """
    shapes = []
    for shape, matrix in SHAPES[scene_object.shape][1](mitsuba, scene_object.form):
        inked = isinstance(shape, _Mesh) and shape.inked
        if isinstance(shape, _Mesh):
            shape = _through_file(shape, folder)
        world = mitsuba.ScalarTransform4f((scene_object.pose.matrix @ matrix).tolist())
        shapes.append(({**shape, 'to_world': world}, inked))
    return shapes


def _through_file(mesh, folder):
    path = folder / f'mesh_{len(list(folder.iterdir()))}.ply'
    columns = [('x', '<f4'), ('y', '<f4'), ('z', '<f4')]
    values = [mesh.vertices]
    if mesh.uv is not None:
        columns += [('u', '<f4'), ('v', '<f4')]
        values.append(mesh.uv)
    vertices = np.column_stack(values).astype('<f4')
    faces = np.empty(len(mesh.faces), [('n', 'u1'), ('i', '<i4', 3)])
    faces['n'], faces['i'] = 3, mesh.faces
    header = ['ply', 'format binary_little_endian 1.0', f'element vertex {len(vertices)}',
              *(f'property float {name}' for name, _ in columns), f'element face {len(faces)}',
              'property list uchar int vertex_indices', 'end_header', '']
    path.write_bytes('\n'.join(header).encode('ascii') + vertices.tobytes() + faces.tobytes())
    return {'type': 'ply', 'filename': str(path), 'face_normals': not mesh.smooth}

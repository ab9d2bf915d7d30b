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
"""Scenes and rigs as YAML: what is read, and what is refused with which words."""

import os
from pathlib import Path
import re
import subprocess
import sys

from color_stereo_ros.sim import load_scene, rig_names, SceneError, variant
from color_stereo_ros.sim.materials import MATERIALS, TEXTURES
from color_stereo_ros.sim.relief import FEATURES, relief_heights, relief_mesh
from color_stereo_ros.sim.shapes import revolved_mesh, SHAPES, tube_mesh
from color_stereo_ros.sim.transport import World
from color_stereo_ros.sim.truth import cast, find_truth

import cv2

import numpy as np

import pytest

from sim_scenes import CARD, scene_of, SIZE, small_rig

import yaml

BAD_SCENES = [
    ({}, r'objects is missing'),
    ({'objects': 5}, r'objects = 5, expected a list'),
    ({'objects': [], 'ambiant': 1}, r"ambiant is no known field; did you mean 'ambient'"),
    ({'objects': ['plane']}, r"objects\[0\] = 'plane', expected a mapping"),
    ({'objects': [{'shape': 'spere'}]}, r"objects\[0\].shape = 'spere' is not known; did you mean "
                                        r"'sphere'"),
    ({'objects': [{'shape': 'sphere', 'radius': -1}]}, r'objects\[0\].radius = -1, expected a '
                                                       r'number 1e-05 .. 100'),
    ({'objects': [{'shape': 'sphere', 'radius': '5 mm'}]}, r"radius = '5 mm', expected a number"),
    ({'objects': [{'shape': 'sphere', 'radios': 1}]}, r'radios is no known field; did you mean '
                                                      r"'radius'"),
    ({'objects': [CARD, {**CARD, 'position': [0, 1]}]}, r'objects\[1\].position = \[0, 1\], '
                                                        r'expected a list of 3 numbers'),
    ({'objects': [{**CARD, 'position': [0, 0, 'far']}]}, r"position\[2\] = 'far', expected"),
    ({'objects': [{**CARD, 'material': 'alumnium'}]}, r"material = 'alumnium' is not known; did "
                                                      r"you mean 'aluminium'"),
    ({'objects': [{**CARD, 'material': {'color': [2, 0, 0]}}]}, r'material.color\[0\] = 2, '
                                                                r'expected a number 0 .. 1'),
    ({'objects': [{**CARD, 'material': {'texture': {'pattern': 'cheker'}}}]},
     r"texture.pattern = 'cheker' is not known; did you mean 'checker'"),
    ({'objects': [{'shape': 'mesh', 'file': 'no.ply'}]}, r"file = 'no.ply', expected a file"),
    ({'objects': [{'shape': 'mesh'}]}, r'objects\[0\].file is missing'),
    ({'objects': [{'shape': 'tube', 'outer': 0.01, 'bore': 0.02}]}, r'bore = 0.02, expected less'),
    ({'objects': [{'shape': 'revolved', 'profile': [[0, 0]]}]}, r'expected two or more'),
    ({'objects': [{'shape': 'height_field', 'features': [{'kind': 'hole'}]}]},
     r"features\[0\].kind = 'hole' is not known"),
    ({'objects': [], 'indirect': 'yes'}, r"indirect = 'yes', expected true or false"),
    ({'objects': [], 'bounces': 0}, r'bounces = 0, expected an integer 1 .. 16'),
    ({'objects': [], 'rig': 'papr'}, r"rig = 'papr' is not known; did you mean 'paper'"),
    ({'objects': [], 'rig': small_rig(bayer='RGBG')}, r"rig.left.bayer = 'RGBG' is not known"),
    ({'objects': [], 'rig': small_rig(bits=20)}, r'rig.left.bits = 20, expected an integer'),
    ({'objects': [], 'rig': small_rig(distortion=[0.1])}, r'distortion = \[0.1\], expected 0 or 4 '
                                                          r'or 5 numbers for plumb_bob'),
    ({'objects': [], 'rig': small_rig({'fov': 40})}, r'rig.projector.fov is no known field'),
    ({'objects': [], 'rig': {**small_rig(), 'depth_limits': [0.5, 0.2]}},
     'the nearer limit first'),
    ({'objects': [], 'rig': {**small_rig(), 'right': {'width': 100}}},
     r'rig.right.width = 100, expected that of the left camera, 96'),
    ({'objects': [], 'rig': {'left': {}, 'right': {}}}, r'rig.left.width is missing'),
]


@pytest.mark.parametrize('description, words', BAD_SCENES)
def test_a_bad_scene_is_refused_with_field_value_and_what_is_legal(description, words):
    with pytest.raises(SceneError, match=words):
        load_scene(description)


def yaml_examples():
    """Return the YAML blocks of the manual."""
    text = (Path(__file__).parents[1] / 'docs' / 'simulation.md').read_text()
    return [yaml.safe_load(block) for block in re.findall(r'```yaml\n(.*?)```', text, re.DOTALL)]


def test_the_examples_of_the_manual_are_good_scenes_and_rigs():
    scene, rig = yaml_examples()
    assert load_scene(scene).frames == 2
    assert load_scene(scene, rig=rig).rig.right.sensitivity == (1.0, 0.9, 0.4)


def test_the_manual_names_every_shape_material_and_rig():
    text = (Path(__file__).parents[1] / 'docs' / 'simulation.md').read_text()
    missing = [name for name in (*SHAPES, *MATERIALS, *FEATURES, *TEXTURES, *rig_names())
               if name not in text]
    assert not missing


@pytest.mark.parametrize('name', rig_names())
def test_every_shipped_rig_can_be_calibrated(name):
    rig = load_scene('solids', rig=name).rig
    assert rig.name == name
    assert rig.calibration.geometry.baseline == pytest.approx(
        rig.right.pose.position[0] - rig.left.pose.position[0])


def test_an_unknown_scene_is_refused_with_the_nearest_name():
    with pytest.raises(SceneError, match="did you mean 'solids'"):
        load_scene('solid')


def test_a_file_that_is_no_yaml_is_refused_by_name(tmp_path):
    (tmp_path / 'bad.yaml').write_text('objects: [}')
    with pytest.raises(SceneError, match='bad.yaml is no YAML'):
        load_scene(tmp_path / 'bad.yaml')


def test_a_file_that_holds_a_list_is_refused(tmp_path):
    (tmp_path / 'list.yaml').write_text('- 1')
    with pytest.raises(SceneError, match='holds a list, expected a mapping'):
        load_scene(tmp_path / 'list.yaml')


def test_a_missing_file_is_refused_by_name(tmp_path):
    with pytest.raises(SceneError, match='none.yaml cannot be read'):
        load_scene(tmp_path / 'none.yaml')


def test_files_of_a_scene_are_found_beside_it(tmp_path):
    (tmp_path / 'triangle.obj').write_text('v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n')
    (tmp_path / 'scene.yaml').write_text(
        'objects: [{shape: mesh, file: triangle.obj, position: [-0.2, -0.2, 0.4], scale: 0.5}]')
    truth = find_truth(World(load_scene(tmp_path / 'scene.yaml', rig=small_rig())), (64, 64))
    np.testing.assert_allclose(truth.depth[np.isfinite(truth.depth)], 0.4, atol=1e-6)
    assert 0.05 < np.isfinite(truth.depth).mean() < 0.95


def test_a_rig_overrides_its_base_field_by_field():
    rig = load_scene({'objects': []}, rig={
        'base': 'paper', 'left': {'exposure': 0.5}, 'projector': {'gamma': 2.2}}).rig
    assert (rig.left.exposure, rig.right.exposure) == (0.5, 0.0)
    assert rig.left.width == 512 and rig.projector.gamma == 2.2
    np.testing.assert_allclose(rig.left.pose.position, [-0.1, 0, 0])


def first_hit(description, ray=(0.0, 0.0, 1.0)):
    """Return distance and normal where a ray from the origin of the rig meets an object."""
    world = World(load_scene({'objects': [description]}))
    direction = np.array([ray]) / np.linalg.norm(ray)
    distance, normal = cast(world, np.zeros((1, 3)), direction)
    return distance[0], normal[0]


@pytest.mark.parametrize('description, distance', [
    ({'shape': 'plane', 'position': [0, 0, 0.4]}, 0.4),
    ({'shape': 'sphere', 'position': [0, 0, 0.4], 'radius': 0.1}, 0.3),
    ({'shape': 'box', 'position': [0, 0, 0.4], 'size': [0.1, 0.2, 0.3]}, 0.25),
    ({'shape': 'box', 'position': [0, 0, 0.4], 'size': [0.1, 0.2, 0.3], 'rotation': [90, 0, 0]},
     0.3),
    ({'shape': 'cylinder', 'position': [0, 0, 0.4], 'radius': 0.05, 'length': 0.2}, 0.3),
    ({'shape': 'cylinder', 'position': [0, 0, 0.4], 'radius': 0.05, 'length': 0.2,
      'rotation': [90, 0, 0]}, 0.35),
    ({'shape': 'tube', 'position': [0, 0, 0.4], 'outer': 0.05, 'bore': 0.03, 'length': 0.2,
      'sides': 6, 'rotation': [90, 0, 0]}, 0.35),
    ({'shape': 'tube', 'position': [0, 0, 0.4], 'outer': 0.05, 'bore': 0.03, 'length': 0.2},
     np.inf),
    ({'shape': 'revolved', 'position': [0, 0, 0.4], 'profile': [[0, -0.1], [0.05, 0.1], [0, 0.1]]},
     0.3),
    ({'shape': 'height_field', 'position': [0, 0, 0.4], 'features': [
        {'kind': 'boss', 'center': [0, 0], 'radius': 0.05, 'height': 0.02}]}, 0.38),
    ({'shape': 'wire_grid', 'position': [0, 0, 0.4], 'size': [0.1, 0.1], 'pitch': 0.05,
      'wire': 0.004}, 0.4 - 0.004)])
def test_a_shape_stands_where_its_numbers_say(description, distance):
    # a ray a hair beside the axis: tips and seams of meshes are no good place to ask
    assert first_hit(description, (1e-6, 2e-6, 1.0))[0] == pytest.approx(distance, abs=2e-5)


def test_positive_heights_point_at_the_cameras():
    form = {'size': (0.2, 0.2), 'resolution': 21, 'fillet': 0.0, 'features': [
        {'kind': 'dome', 'center': (0, 0), 'radius': 0.05, 'height': 0.03}]}
    vertices, faces, _ = relief_mesh(form)
    assert vertices[:, 2].min() == pytest.approx(-0.03)
    first, second, third = (vertices[faces[:, corner]] for corner in range(3))
    assert (np.cross(second - first, third - first)[:, 2] < 0).all()


@pytest.mark.parametrize('feature, place, height', [
    ({'kind': 'boss', 'center': (0, 0), 'radius': 0.05, 'height': 0.02}, (0, 0), 0.02),
    ({'kind': 'bore', 'center': (0, 0), 'radius': 0.05, 'height': -0.02}, (0.03, 0), -0.02),
    ({'kind': 'pocket', 'center': (0, 0), 'size': (0.1, 0.02), 'height': -0.01}, (0.04, 0), -0.01),
    ({'kind': 'rib', 'from': (-0.08, 0), 'to': (0.08, 0), 'width': 0.02, 'height': 0.015},
     (0.06, 0), 0.015),
    ({'kind': 'roof', 'center': (0, 0), 'size': (0.2, 0.2), 'height': 0.05}, (0.05, 0), 0.025),
    ({'kind': 'wave', 'amplitude': 0.01, 'wavelength': 0.1, 'direction': 0, 'seed': 1},
     (0.025, 0), 0.01)])
def test_a_feature_of_a_height_field_has_the_height_that_it_says(feature, place, height):
    heights = relief_heights({'size': (0.2, 0.2), 'resolution': 201, 'fillet': 0.0,
                              'features': [feature]})
    column, row = (int(round((value + 0.1) / 0.2 * 200)) for value in place)
    assert heights[row, column] == pytest.approx(height, abs=1e-9)


def test_heights_come_from_a_picture_or_an_array(tmp_path):
    cv2.imwrite(str(tmp_path / 'h.png'), np.full((4, 4), 65535, np.uint16))
    np.save(tmp_path / 'h.npy', np.full((4, 4), 0.007))
    for name, expected in (('h.png', 0.01), ('h.npy', 0.007)):
        heights = relief_heights({'size': (0.2, 0.2), 'resolution': 5, 'fillet': 0.0,
                                  'features': [], 'file': str(tmp_path / name), 'height': 0.01})
        np.testing.assert_allclose(heights, expected)


@pytest.mark.parametrize('mesh', [tube_mesh(0.02, 0.01, 0.03, 6), tube_mesh(0.02, 0.01, 0.03, 96),
                                  revolved_mesh([(0, -1), (1, -1), (1, 1), (0, 1)], 12)])
def test_a_solid_of_triangles_is_closed(mesh):
    vertices, faces = mesh
    # every edge between distinct places is used by two triangles
    places = np.unique(np.round(vertices, 9), axis=0, return_inverse=True)[1].reshape(-1)
    edges = np.sort(places[faces][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges = edges[edges[:, 0] != edges[:, 1]]
    _, count = np.unique(edges, axis=0, return_counts=True)
    assert (count % 2 == 0).all()


def test_objects_and_rigs_move_from_frame_to_frame():
    moving = {**CARD, 'path': [{'position': [0, 0, 0.4]}, {'position': [0, 0, 0.5]}]}
    scene = scene_of(moving)
    assert scene.frames == 2
    assert [scene.at(frame).objects[0].pose.position[2] for frame in (0, 1, 7)] == [0.4, 0.5, 0.5]
    rig = {**small_rig(), 'path': [{'position': [0, 0, 0]}, {'position': [0, 0, 0.1]}, {}]}
    scene = scene_of(CARD, rig=rig)
    assert scene.frames == 3
    depths = [find_truth(World(scene.at(frame)), (64, 64)).depth.mean() for frame in range(3)]
    assert depths == pytest.approx([0.4, 0.3, 0.4])


def test_a_turned_rig_sees_the_scene_turned_the_other_way():
    rig = {**small_rig(base='effector'), 'path': [{'rotation': [0, 0, 90]}]}
    box = {'shape': 'box', 'position': [0, 0, 0.5], 'size': [0.2, 0.04, 0.01]}
    depth = find_truth(World(scene_of(box, rig=rig).at(0)), (64, 64)).depth
    height, width = (np.ptp(np.flatnonzero(np.isfinite(depth).any(axis=axis))) for axis in (1, 0))
    assert height > 3 * width


def test_each_frame_of_a_sequence_has_its_own_fingerprint():
    scene = scene_of({**CARD, 'path': [{'position': [0, 0, 0.4]}, {'position': [0, 0, 0.5]}]})
    assert scene.at(0).fingerprint != scene.at(1).fingerprint


def test_without_mitsuba_the_extra_is_named():
    code = ('import sys; sys.modules["mitsuba"] = None\n'
            'from color_stereo_ros.sim import load_scene, Renderer, SimulatorMissingError\n'
            'scene = load_scene("solids")\n'
            'try:\n'
            '    Renderer(scene).world\n'
            'except SimulatorMissingError as error:\n'
            '    print(error)\n')
    said = subprocess.run([sys.executable, '-c', code], check=True, capture_output=True, text=True,
                          env={**os.environ, 'COLOR_STEREO_SIM_VARIANT': 'scalar_rgb'}).stdout
    assert 'pip install "color_stereo_ros[sim]"' in said and 'Mitsuba' in said


VARIANT = """
from color_stereo_ros.sim.variant import is_vectorized, load_mitsuba
mitsuba = load_mitsuba()
print(mitsuba.variant())
if is_vectorized(mitsuba):
    import drjit
    print(drjit.maximum(mitsuba.Float([1.0, 2.0]), 1.5)[0])  # LLVM 15 ends the process here
"""


def loaded_variant(**environment):
    """Return what `load_mitsuba` chooses in a new process, and its warnings."""
    ended = subprocess.run(
        [sys.executable, '-c', VARIANT], check=True, capture_output=True, text=True,
        env={**os.environ, 'COLOR_STEREO_SIM_VARIANT': '', **environment})
    return ended.stdout.split(), re.findall('^rendering takes .*', ended.stderr, re.MULTILINE)


def test_a_useless_llvm_library_leads_to_the_scalar_variant_and_one_line(tmp_path):
    library = tmp_path / 'libLLVM.so'
    library.write_text('no library')
    said, told = loaded_variant(DRJIT_LIBLLVM_PATH=str(library))
    assert said == ['scalar_rgb']
    assert len(told) == 1 and str(library) in told[0] and 'install LLVM 17' in told[0]


def test_the_variant_that_is_chosen_computes():
    said, _ = loaded_variant()
    assert said in (['scalar_rgb'], ['llvm_ad_rgb', '1.5'])


@pytest.mark.parametrize('working, chosen', [
    ({19, 17, 15}, 19), ({17}, 17), ({15}, 15), (set(), None)])
def test_the_newest_llvm_library_that_works_is_taken(tmp_path, monkeypatch, working, chosen):
    names = ('libLLVM-14.so', 'libLLVM-15.so.1', 'libLLVM-17.so', 'libLLVM.so.19.1')
    for name in names:
        (tmp_path / name).write_text(name)
    (tmp_path / 'libLLVM-19.so').symlink_to('libLLVM.so.19.1')
    tried = []
    monkeypatch.delenv('DRJIT_LIBLLVM_PATH', raising=False)
    monkeypatch.setattr(variant, 'LLVM_PLACES', (f'{tmp_path}/libLLVM*',))
    monkeypatch.setattr(variant, '_works', lambda path: (
        tried.append(variant._version(path)) or variant._version(path) in working))
    found = variant.find_llvm()
    assert (found and variant._version(found)) == chosen
    assert tried == [version for version in (19, 17, 15) if version >= (chosen or 0)]


def test_importing_the_simulator_does_not_import_mitsuba():
    code = 'import sys, color_stereo_ros.sim; sys.exit("mitsuba" in sys.modules)'
    assert subprocess.run([sys.executable, '-c', code]).returncode == 0


def test_the_size_of_the_small_rig_is_what_the_tests_think():
    assert scene_of(CARD).rig.left.shape == (SIZE, SIZE)

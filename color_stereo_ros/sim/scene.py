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
"""Scenes and rigs as YAML."""

from dataclasses import dataclass, replace
import hashlib
import json
from pathlib import Path

from color_stereo_ros.files.yaml import load_yaml, UnreadableError

from .errors import SceneError
from .fields import Reader
from .rig import read_rig, Rig
from .shapes import read_object

SCENE_FOLDER = Path(__file__).parent / 'scenes'
RIG_FOLDER = Path(__file__).parent / 'rigs'


@dataclass(frozen=True, eq=False)
class Scene:
    """What the rig looks at."""

    name: str
    description: str
    rig: Rig
    objects: tuple
    ambient: tuple
    """Radiance of the surroundings, RGB."""
    indirect: bool
    """Whether light that bounces between objects is rendered."""
    bounces: int
    """Largest number of reflections on the way from a light to a camera."""
    fingerprint: str
    """Hash of the whole description, rig and referenced files included."""

    @property
    def frames(self):
        """Return the number of frames of the sequence, 1 for a scene at rest."""
        return max(1, len(self.rig.path), *(len(thing.path) for thing in self.objects))

    def at(self, frame):
        """Return the scene as it stands in one frame of its sequence, in the frame of the rig."""
        if self.frames == 1 and not self.rig.path:
            return self
        rig_pose = self.rig.pose_at(frame)
        objects = []
        for thing in self.objects:
            thing = thing.at(frame)
            objects.append(replace(thing, path=(), pose=rig_pose.inverse() @ thing.pose))
        return replace(self, objects=tuple(objects), rig=replace(self.rig, path=()),
                       fingerprint=f'{self.fingerprint}-{frame}')


def scene_names():
    """Return the names of the scenes that come with the package."""
    return sorted(path.stem for path in SCENE_FOLDER.glob('*.yaml'))


def rig_names():
    """Return the names of the rigs that come with the package."""
    return sorted(path.stem for path in RIG_FOLDER.glob('*.yaml'))


def load_scene(source, rig=None, **overrides):
    """
    Load a scene.

    Parameters
    ----------
    source : str, path-like or dict
        Name of a scene that comes with the package, a YAML file, or the description itself.
    rig : str, path-like or dict, optional
        A rig instead of the scene's own: name, YAML file, or description with `base`.
    **overrides
        Values for top-level fields of the scene, for example `ambient=0.1`.

    Returns
    -------
    scene : Scene

    Raises
    ------
    SceneError
        If the scene is unknown or malformed; names field, value and what is legal.

    """
    content, path, folder = _description(source, SCENE_FOLDER, scene_names(), 'scene')
    if not isinstance(content, dict):
        raise SceneError(f'{path} holds a {type(content).__name__}, expected a mapping')
    content = {**content, **overrides}
    if rig is not None:
        content['rig'] = rig if isinstance(rig, dict) else str(rig)
    node = Reader(content, path, folder)
    node.only('name', 'description', 'rig', 'objects', 'ambient', 'indirect', 'bounces')
    rig_content = rig_description(node.get('rig', 'paper'))
    objects = tuple(read_object(entry) for entry in node.get('objects').items())
    return Scene(
        name=node.get('name', path).text(), description=node.get('description', '').text(),
        rig=read_rig(Reader(rig_content, f'{path}.rig', folder)), objects=objects,
        ambient=_read_ambient(node.get('ambient', 0.0)),
        indirect=node.get('indirect', True).flag(),
        bounces=node.get('bounces', 4).integer(1, 16),
        fingerprint=_fingerprint(content, rig_content, objects))


def _read_ambient(node):
    if isinstance(node.value, (list, tuple)):
        return node.vector(3, 0.0, 1e6)
    return (node.number(0.0, 1e6),) * 3


def rig_description(node):
    """Return the complete mapping of a rig: a name, a file, or a mapping with `base`."""
    content, path, folder = _description(node.value, RIG_FOLDER, rig_names(), 'rig', node.folder)
    if not isinstance(content, dict):
        raise SceneError(f'{path} holds a {type(content).__name__}, expected a mapping')
    if 'base' not in content:
        return content
    base = rig_description(Reader(content['base'], f'{path}.base', folder))
    return _merged(base, {key: value for key, value in content.items() if key != 'base'})


def _merged(base, changes):
    """Return base with changes, mapping by mapping."""
    merged = dict(base)
    for key, value in changes.items():
        old = merged.get(key)
        merged[key] = _merged(old, value) if isinstance(old, dict) and isinstance(value, dict) \
            else value
    return merged


def _description(source, shipped, names, kind, folder=Path('.')):
    """Return (content, name for messages, folder of relative files)."""
    if isinstance(source, dict):
        return source, kind, folder
    path = Path(source)
    if path.suffix not in ('.yaml', '.yml'):
        if str(source) not in names:
            Reader(str(source), kind).choice(names)
        path = shipped / f'{source}.yaml'
    elif not path.is_absolute() and not path.is_file():
        path = folder / path
    try:
        return load_yaml(path), path.stem, path.parent
    except UnreadableError as error:
        raise SceneError(f'{kind} {path} {error}') from error


def _fingerprint(content, rig_content, objects):
    """Return a hash of all that the light depends on, named materials and files included."""
    digest = hashlib.sha256(json.dumps([content, rig_content], sort_keys=True,
                                       default=str).encode())
    for thing in objects:
        digest.update(repr(thing.material).encode())
        for file in (thing.form.get('file'), thing.material.texture.get('file')):
            if file:
                digest.update(Path(file).read_bytes())
    return digest.hexdigest()[:16]

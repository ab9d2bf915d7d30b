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
"""Materials by name, and the textures that can be printed on them."""

from dataclasses import dataclass, field

import numpy as np

from .fields import Reader

TEXTURE_SIZE = 512  # texels along either side of a generated texture


@dataclass(frozen=True)
class Material:
    """How a surface reflects: a diffuse part, and a gloss or metal part."""

    color: tuple
    """Albedo of the diffuse part, RGB, 0..1."""
    gloss: float = 0.0
    """Roughness of a dielectric coat (GGX alpha), 0 = no coat."""
    metal: tuple = ()
    """Reflectance of the metal part, RGB, 0..1; empty = no metal."""
    roughness: tuple = (0.3, 0.3)
    """GGX alpha of the metal part along u and v."""
    metal_share: float = 0.0
    """Share of the metal part, 0..1; the rest is diffuse."""
    texture: dict = field(default_factory=dict)
    """Printed texture: pattern, scale and contrast; see `texture_image`."""


# Albedos: measured orders of magnitude. The roughness of metals and dark plastic was chosen so
# that OpenCV's StereoSGBM answers for about as many pixels as on other renderings of such parts.
MATERIALS = {
    'white_cardboard': Material((0.82, 0.82, 0.80)),
    'gray_cardboard': Material((0.35, 0.35, 0.34)),
    'wood': Material((0.62, 0.44, 0.27), texture={'pattern': 'grain', 'contrast': 0.35,
                                                  'scale': 14.0}),
    'bright_plastic': Material((0.72, 0.68, 0.60), gloss=0.15),
    'glossy_plastic': Material((0.60, 0.60, 0.62), gloss=0.06),
    'dark_plastic': Material((0.04, 0.04, 0.044), gloss=0.12),
    'red_plastic': Material((0.55, 0.10, 0.08), gloss=0.15),
    'blue_plastic': Material((0.10, 0.16, 0.50), gloss=0.15),
    'green_plastic': Material((0.12, 0.42, 0.15), gloss=0.15),
    'foam': Material((0.70, 0.70, 0.66), texture={'pattern': 'speckle', 'contrast': 0.15,
                                                  'scale': 120.0}),
    'rubber': Material((0.04, 0.04, 0.04), gloss=0.45),
    'cast_iron': Material((0.16, 0.155, 0.15), metal=(0.56, 0.55, 0.54), roughness=(0.5, 0.5),
                          metal_share=0.35),
    'brushed_steel': Material((0.30, 0.30, 0.30), metal=(0.60, 0.58, 0.56),
                              roughness=(0.45, 0.22), metal_share=0.65),
    'aluminium': Material((0.45, 0.45, 0.46), metal=(0.91, 0.92, 0.92), roughness=(0.4, 0.4),
                          metal_share=0.5),
    'polished_brass': Material((0.25, 0.20, 0.10), metal=(0.90, 0.75, 0.40),
                               roughness=(0.14, 0.14), metal_share=0.92),
}
TEXTURES = ('none', 'checker', 'grain', 'speckle', 'print', 'stripes', 'image')


def read_material(node):
    """
    Return the Material of a scene's entry: a name, or a mapping with overrides.

    A mapping may hold `name` (default white_cardboard), `color` (an albedo or three), `gloss`,
    `metal`, `roughness`, `metal_share` and `texture` (pattern, scale, contrast, seed, file).

    """
    if isinstance(node.value, str):
        return MATERIALS[node.choice(MATERIALS)]
    node.only('name', 'color', 'gloss', 'metal', 'roughness', 'metal_share', 'texture')
    base = MATERIALS[node.get('name', 'white_cardboard').choice(MATERIALS)]
    return Material(
        color=node.get('color', base.color).color(),
        gloss=node.get('gloss', base.gloss).number(0.0, 1.0),
        metal=node.get('metal').color() if node.has('metal') else base.metal,
        roughness=node.get('roughness', base.roughness).pair(0.01, 1.0),
        metal_share=node.get('metal_share', base.metal_share).number(0.0, 1.0),
        texture=_read_texture(node.get('texture')) if node.has('texture') else base.texture)


def _read_texture(node: Reader):
    node.only('pattern', 'scale', 'contrast', 'seed', 'file')
    texture = {'pattern': node.get('pattern', 'print').choice(TEXTURES),
               'scale': node.get('scale', 24.0).number(0.1, 1000.0),
               'contrast': node.get('contrast', 0.8).number(0.0, 1.0),
               'seed': node.get('seed', 1).integer(0, 2**31 - 1)}
    if texture['pattern'] == 'image':
        texture['file'] = str(node.get('file').existing_file())
    return texture


def texture_image(texture, color):
    """
    Return the albedo of a printed texture.

    Parameters
    ----------
    texture : dict
        `pattern` (checker, grain, speckle, print, stripes, image), `scale` (repetitions over the
        surface), `contrast` (0..1), `seed`, `file`.
    color : tuple of 3 floats
        Albedo where nothing is printed.

    Returns
    -------
    albedo : numpy.ndarray, float32, shape (S, S, 3)

    """
    ink = _ink(texture)
    if ink.ndim == 2:
        ink = ink[..., None]
    albedo = np.asarray(color, np.float32) * (1 - texture.get('contrast', 0.8) * ink)
    return np.clip(albedo, 0.0, 1.0).astype(np.float32)


def _ink(texture):
    """Return how much ink covers each texel, 0..1, shape (S, S) or (S, S, 3)."""
    import cv2

    from color_stereo_ros.files.image import read_image
    pattern, scale = texture['pattern'], texture.get('scale', 24.0)
    generator = np.random.default_rng(texture.get('seed', 1))
    y, x = np.mgrid[0:TEXTURE_SIZE, 0:TEXTURE_SIZE] / TEXTURE_SIZE
    if pattern == 'checker':
        return ((np.floor(x * scale) + np.floor(y * scale)) % 2).astype(np.float32)
    if pattern == 'stripes':
        return (np.floor(x * scale) % 2).astype(np.float32)
    if pattern == 'image':
        return 1 - cv2.resize(read_image(texture['file']), (TEXTURE_SIZE, TEXTURE_SIZE),
                              interpolation=cv2.INTER_AREA).astype(np.float32) / 255
    if pattern == 'none':
        return np.zeros((TEXTURE_SIZE, TEXTURE_SIZE), np.float32)
    if pattern == 'grain':
        return _grain(generator, x, y, scale)
    blobs = _noise(generator, TEXTURE_SIZE / scale / 2)
    if pattern == 'speckle':
        return blobs
    return _print(generator, blobs)


def _noise(generator, sigma):
    """Return smooth periodic noise, 0..1, with a correlation length in texels."""
    import cv2
    size = TEXTURE_SIZE
    noise = np.tile(generator.standard_normal((size, size)).astype(np.float32), (2, 2))
    middle = slice(size // 2, -size // 2)
    noise = cv2.GaussianBlur(noise, (0, 0), max(sigma, 0.3))[middle, middle]
    return np.clip(0.5 + noise / (5 * noise.std()), 0, 1)


def _grain(generator, x, y, scale):
    """Return wood grain: bent rings cut along their axis, and pores."""
    bend = 0.35 * (_noise(generator, TEXTURE_SIZE / 6) - 0.5) + 0.1 * y
    rings = 0.5 + 0.5 * np.sin(2 * np.pi * scale * (x + bend))
    pores = _noise(generator, 0.8) > 0.75
    return (0.75 * rings ** 2 + 0.25 * pores).astype(np.float32)


def _print(generator, blobs):
    """Return colored patches, bars and disks: a printed package."""
    import cv2
    ink = np.zeros((TEXTURE_SIZE, TEXTURE_SIZE, 3), np.uint8)
    ink[blobs > 0.55] = (50, 128, 204)
    for _ in range(60):
        corner = generator.integers(0, TEXTURE_SIZE, 2)
        size = generator.integers(6, 70, 2)
        color = generator.integers(0, 256, 3).tolist()
        if generator.random() < 0.5:
            cv2.rectangle(ink, corner.tolist(), (corner + size).tolist(), color, -1)
        else:
            cv2.circle(ink, corner.tolist(), int(size[0] // 2), color, -1, cv2.LINE_AA)
    for row in range(40, TEXTURE_SIZE, 60):
        text = ''.join(chr(generator.integers(65, 91)) for _ in range(24))
        cv2.putText(ink, text, (5, row), cv2.FONT_HERSHEY_SIMPLEX, 0.9, (242, 242, 242), 2,
                    cv2.LINE_AA)
    return ink.astype(np.float32) / 255


def reflectance(mitsuba, material, color):
    """Return Mitsuba's description of an albedo: a constant, or a printed texture."""
    if not material.texture or material.texture.get('pattern') == 'none':
        return {'type': 'rgb', 'value': [float(c) for c in color]}
    bitmap = mitsuba.Bitmap(np.ascontiguousarray(texture_image(material.texture, color)))
    return {'type': 'bitmap', 'bitmap': bitmap, 'raw': True, 'filter_type': 'bilinear',
            'wrap_mode': 'repeat'}


def bsdf(mitsuba, material):
    """Return Mitsuba's description of a material, visible from both sides."""
    albedo = reflectance(mitsuba, material, material.color)
    if material.gloss > 0:
        diffuse = {'type': 'roughplastic', 'distribution': 'ggx', 'alpha': material.gloss,
                   'diffuse_reflectance': albedo}
    else:
        diffuse = {'type': 'diffuse', 'reflectance': albedo}
    if not material.metal or material.metal_share == 0:
        return {'type': 'twosided', 'surface': diffuse}
    metal = {'type': 'roughconductor', 'distribution': 'ggx', 'material': 'none',
             'alpha_u': material.roughness[0], 'alpha_v': material.roughness[1],
             'specular_reflectance': {'type': 'rgb', 'value': [float(c) for c in material.metal]}}
    return {'type': 'twosided', 'surface': {
        'type': 'blendbsdf', 'weight': material.metal_share, 'first': diffuse, 'second': metal}}

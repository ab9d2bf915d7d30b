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
The experiments of the report: the paper's section 3, complex scenes, sweeps.

Every experiment is a list of tasks; a task prepares one pair and runs every method on it. What
comes out is a list of records, plain data for the JSON file, and pictures for the report.

"""

from dataclasses import dataclass, field, replace

import numpy as np

from .methods import evaluate
from .renders import as_scene, default_pattern, paper_pattern
from ..core import ColorStereoError, PatternSettings
from ..core.false_color import false_color
from ..core.paper.color import ColorCorrection
from ..core.triangulation import disparity_from_depth

TABLE_31 = {250: 1.5, 300: 2.3, 350: 2.0, 400: 1.9, 450: 3.0, 500: 2.6, 550: 4.0}
"""The paper's table 3.1: distance of a white reflector, mm, and mean absolute error, mm."""

TABLE_32 = {'white_cardboard': 1.46, 'wood': 1.67, 'bright_plastic': 1.72, 'brushed_steel': 2.80,
            'aluminium': 2.80, 'dark_plastic': 3.74, 'polished_brass': 3.84}
"""The paper's table 3.2: material of the reflector at 350 mm and mean absolute error, mm."""

COMPLEX = ('prism', 'solids', 'airplane', 'casting', 'nut', 'printed', 'thin', 'bin', 'corner',
           'effector_bench', 'effector_bin', 'effector_flat', 'effector_nut', 'effector_thin')
SLOPES = (0, 10, 20, 30, 40, 50, 60)  # degrees
SWEEP_SCENE = 'solids'
ALBEDO_SCENE = 'flat_350'
ALBEDO = 0.82  # of the card of ALBEDO_SCENE

AS_PRINTED = {'matching.window_height': 1, 'matching.subpixel': 'none'}
"""The paper's own readings: a window of 9 pixels of one row, no sub-pixel step (sec. 3)."""

SWEEPS = {
    'noise': ('camera noise', 'times that of the rig', (0.25, 0.5, 1.0, 2.0, 4.0)),
    'albedo': ('albedo of a flat card, exposure fixed', 'albedo', (1.0, 0.5, 0.2, 0.1, 0.05)),
    'ambient': ('ambient light', 'share of all light', (0.0, 0.2, 0.4, 0.6, 0.8)),
    'slope': ('slope of a flat card', 'degrees', SLOPES),
    'blur': ('blur of the projector', 'px of the pattern, standard deviation',
             (0.4, 1.0, 2.0, 4.0)),
    'cycles': ('cycles of the sweep over the pattern', 'cycles', (1, 2, 4, 8, 16)),
    'search': ('width of the search range', 'times that of the rig', (1.0, 1.5, 2.0)),
}
"""Name to title, unit of the abscissa, and abscissae."""


@dataclass(frozen=True)
class Plan:
    """How much is done."""

    samples: int = 3
    """Rays per pixel along either axis."""
    distances: tuple = tuple(TABLE_31)
    materials: tuple = tuple(TABLE_32)
    complex: tuple = COMPLEX  # noqa: A003
    sweeps: dict = field(default_factory=lambda: {
        name: abscissae for name, (_, _, abscissae) in SWEEPS.items()})
    repeats: int = 3


QUICK = Plan(samples=2, distances=(250, 350, 550),
             materials=('white_cardboard', 'dark_plastic', 'polished_brass'),
             complex=('prism', 'solids'),
             sweeps={'noise': (1.0, 4.0), 'albedo': (1.0, 0.1), 'ambient': (0.0, 0.6)}, repeats=1)


@dataclass(frozen=True)
class Task:
    """One pair and all that is measured on it."""

    title: str
    run: object
    """Function without arguments; returns a list of records."""


class Laboratory:
    """
    Prepares and runs the experiments.

    Parameters
    ----------
    renders : Renders
    methods : sequence of str
    plan : Plan

    """

    def __init__(self, renders, methods, plan=Plan()):
        self.renders = renders
        self.methods = tuple(methods)
        self.plan = plan
        self.pictures = {}
        """(scene, pattern) to dict of title to uint8 (H, W, 3), and `limits` in m."""
        self.objects = {}
        """Scene to its left image under white light, uint8 (H, W, 3)."""
        self.profile = None
        """Figure 3.1: dict of title to float (W, 3)."""
        self.surfaces = {}
        """Figure 3.2: method to depth, float32 (H, W)."""
        self._benches = {}

    def tasks(self):
        """Return all tasks of the plan, a list of Task."""
        plan = self.plan
        tasks = [task for distance in plan.distances
                 for task in self._both('table_3_1', f'flat_{distance}', distance)]
        tasks += [task for material in plan.materials
                  for task in self._both('table_3_2', f'material_{material}', material)]
        tasks += [task for name in plan.complex for task in self._both('complex', name, name)]
        for sweep, abscissae in plan.sweeps.items():
            tasks += [Task(f'{sweep} {abscissa}', lambda s=sweep, a=abscissa: self._swept(s, a))
                      for abscissa in abscissae]
        return tasks

    def _both(self, experiment, name, abscissa):
        """Return the tasks of a scene under the paper's pattern and under our own."""
        return [Task(f'{name} {pattern.type}',
                     lambda p=pattern: self._pair(experiment, name, p, abscissa))
                for pattern in (paper_pattern(), default_pattern())]

    def _pair(self, experiment, name, pattern, abscissa):
        scene = self.renders.pair(name, pattern)
        records = []
        for method, values in self._contenders(experiment, pattern):
            record, run = self._measured(experiment, scene, method, values, abscissa)
            records.append(record)
            if experiment == 'complex' and not values:
                self._keep_pictures(scene, run, pattern)
            if name == 'prism' and not values and closed_loop(record):
                self.surfaces[method] = cut_out(run.result.depth, scene.truth)
        if name == f'flat_{min(self.plan.distances, key=lambda d: abs(d - 350))}' \
                and pattern.type == 'sweep':
            self.profile = color_profile(run.pair, run.settings)
        if name == SWEEP_SCENE and pattern.type == 'sweep':
            self.objects[name] = self._bench(name).under_white()
        return records

    def _contenders(self, experiment, pattern):
        """Yield (method, flat settings) for one pair."""
        for method in self.methods:
            yield method, {}
            if method == 'paper' and pattern.type == 'sweep' and experiment != 'sweep':
                yield method, AS_PRINTED

    def _measured(self, experiment, scene, method, values, abscissa, repeats=None):
        repeats = self.plan.repeats if repeats is None else repeats
        run, figures = evaluate(scene, method, values, repeats)
        return {'experiment': experiment, 'scene': scene.name, 'abscissa': abscissa,
                'pattern': run.settings.pattern.type, 'method': method, 'values': values,
                'figures': figures}, run

    def _keep_pictures(self, scene, run, pattern):
        near, far = picture_limits(scene.truth)
        kept = self.pictures.setdefault((scene.name, pattern.type), {
            'left image': run.pair.left,
            'truth': false_color(cut_out(scene.truth.depth, scene.truth), near, far),
            'limits': (near, far)})
        kept[run.method] = false_color(run.result.depth, near, far)
        kept[f'{run.method} error'] = error_picture(run.result, scene.truth)

    def _bench(self, name):
        if name not in self._benches:
            self._benches[name] = Bench(self.renders, name)
        return self._benches[name]

    def _swept(self, sweep, abscissa):
        """Return the records of one abscissa of a sweep."""
        records = []
        for pattern, methods in self._swept_patterns(sweep, abscissa):
            scene = self._swept_scene(sweep, abscissa, pattern)
            for method in methods:
                record, _ = self._measured(f'sweep_{sweep}', scene, method, {}, abscissa, 1)
                records.append(record)
        return records

    def _swept_patterns(self, sweep, abscissa):
        """Return (pattern, methods) pairs: ours for all; the paper's for the paper's method."""
        if sweep == 'cycles':
            return [(PatternSettings(type='sweep', cycles=abscissa), self.methods)]
        ours = [(default_pattern(), self.methods)]
        return ours + ([(paper_pattern(), ('paper',))] if 'paper' in self.methods else [])

    def _swept_scene(self, sweep, abscissa, pattern):
        if sweep == 'slope':
            return self.renders.pair(f'tilt_{abscissa}', pattern)
        if sweep == 'albedo':
            return self._bench(ALBEDO_SCENE).scene(pattern, brightness=abscissa / ALBEDO)
        bench = self._bench(SWEEP_SCENE)
        if sweep == 'search':
            return widened(bench.scene(pattern), abscissa)
        return bench.scene(pattern, **({} if sweep == 'cycles' else {sweep: abscissa}))


def closed_loop(record):
    """Return whether a method works with the pattern that it was made for."""
    own = 'sweep' if record['method'] == 'paper' else default_pattern().type
    return record['pattern'] == own


class Bench:
    """
    One scene in memory under any pattern, with cameras and light that can be changed.

    Parameters
    ----------
    renders : Renders
    name : str

    """

    def __init__(self, renders, name):
        from .. import sim
        self._description = sim.load_scene(name)
        self._renders = renders
        self._renderers = {}
        self._radiance = {}

    def scene(self, pattern, *, noise=1.0, brightness=1.0, ambient=0.0, blur=None):
        """
        Return the scene under a pattern, with changes.

        Parameters
        ----------
        pattern : PatternSettings
            Of the pattern that is projected.
        noise : float
            Multiplies the standard deviations of the cameras' noise.
        brightness : float
            Multiplies all light, while the exposure stays that of 1.
        ambient : float
            Share of all light that does not come from the projector.
        blur : float, optional
            Blur of the projector, px of the pattern; default that of the rig.

        Returns
        -------
        scene : color_stereo_ros.evaluation.datasets.Scene

        """
        from ..sim.electronics import expose, exposures_for
        renderer = self._renderer(blur)
        description = renderer.scene
        radiance = self._light(renderer, pattern, blur)
        if ambient > 0:
            radiance = self._with_ambient(renderer, radiance, ambient)
        cameras = [noisier(camera, noise)
                   for camera in (description.rig.left, description.rig.right)]
        exposures = exposures_for(radiance, cameras)
        images = [expose(brightness * light, camera, exposure,
                         np.random.SeedSequence([self._renders.seed, side]))
                  for side, (light, camera, exposure) in enumerate(
                      zip(radiance, cameras, exposures))]
        rig = replace(description.rig, left=cameras[0], right=cameras[1])
        truth = renderer.truth((pattern.height, pattern.width))
        rendering = _Pair(*images, rig.calibration, truth)
        return as_scene(replace(description, rig=rig), rendering, pattern)

    def under_white(self):
        """Return the left image under white light for people, gamma-encoded uint8 (H, W, 3)."""
        renderer = self._renderer(None)
        white = np.full((768, 1024, 3), 255, np.uint8)
        light = renderer.radiance(renderer.scene.rig.left, white)
        scaled = np.clip(light / np.percentile(light, 99), 0, 1)
        return np.rint(255 * scaled ** (1 / 2.2)).astype(np.uint8)

    def _renderer(self, blur):
        from .. import sim
        if blur is None or blur == self._description.rig.projector.blur:
            return self._renders.renderer(self._description)
        if blur not in self._renderers:
            rig = self._description.rig
            self._renderers[blur] = sim.Renderer(
                replace(self._description,
                        rig=replace(rig, projector=replace(rig.projector, blur=blur))),
                samples=self._renders.samples)
        return self._renderers[blur]

    def _light(self, renderer, pattern, blur):
        from ..core import make_pattern
        key = (pattern, blur)
        if key not in self._radiance:
            image = make_pattern(pattern)
            rig = renderer.scene.rig
            self._radiance[key] = tuple(renderer.radiance(camera, image)
                                        for camera in (rig.left, rig.right))
        return self._radiance[key]

    def _with_ambient(self, renderer, radiance, share):
        """Add light of the surroundings until it is the given share of the left image's light."""
        rig = renderer.scene.rig
        ambient = [renderer.direct(camera).ambient for camera in (rig.left, rig.right)]
        if not ambient[0].size:
            raise ColorStereoError(f'scene {renderer.scene.name!r} has ambient = 0: ambient light '
                                   'was not traced, expected ambient > 0')
        factor = share / (1 - share) * radiance[0].mean() / max(ambient[0].mean(), 1e-12)
        return tuple(light + factor * extra for light, extra in zip(radiance, ambient))


@dataclass(frozen=True, eq=False)
class _Pair:
    """What `renders.as_scene` needs of a rendering."""

    left_rgb: np.ndarray
    right_rgb: np.ndarray
    calibration: object
    truth: object


def noisier(camera, factor):
    """Return a simulated camera whose noise has `factor` times the standard deviation."""
    return replace(camera, full_well=camera.full_well / factor ** 2,
                   read_noise=camera.read_noise / factor, speckle=camera.speckle * factor)


def widened(scene, factor):
    """Return a scene whose disparities are searched over `factor` times as wide a range."""
    geometry = scene.calibration.geometry
    near, far = scene.settings['range.min_depth'], scene.settings['range.max_depth']
    largest, smallest = (disparity_from_depth(z, geometry) for z in (near, far))
    extra = 0.5 * (factor - 1) * (largest - smallest)
    infinity = geometry.principal_offset
    limits = {
        'range.min_depth': geometry.focal_baseline / (largest + extra - infinity),
        'range.max_depth': geometry.focal_baseline / max(smallest - extra - infinity, 1.0)}
    return replace(scene, settings={**scene.settings, **limits})


def picture_limits(truth):
    """Return the depths between which a scene is drawn, m."""
    depth = truth.depth[truth.visible]
    near, far = np.percentile(depth, (0.5, 99.5))
    margin = max(0.05 * (far - near), 0.005)
    return round(float(near - margin), 3), round(float(far + margin), 3)


def cut_out(depth, truth):
    """Return the depth where it is visible, NaN elsewhere, float32 (H, W), m."""
    return np.where(truth.visible, depth, np.float32(np.nan))


ERROR_COLORS = {'right': (236, 236, 232), 'small': (255, 196, 84), 'large': (214, 60, 42),
                'missing': (30, 34, 44), 'false': (150, 70, 190), 'hidden': (120, 128, 136)}
"""Colors of `error_picture`, RGB."""


def error_picture(result, truth):
    """
    Draw where a result is right and wrong.

    Returns
    -------
    picture : numpy.ndarray, uint8, shape (H, W, 3)
        Light: within 0.5 px; yellow: within 1 px; red: wrong; dark: visible without a range;
        gray: not visible, no range; purple: not visible, but with a range.

    """
    true = disparity_from_depth(truth.depth.astype(np.float64), result.geometry)
    error = np.abs(result.disparity - true)
    answered = np.isfinite(result.disparity)
    picture = np.empty((*error.shape, 3), np.uint8)
    picture[:] = ERROR_COLORS['hidden']
    picture[truth.visible] = ERROR_COLORS['missing']
    picture[~truth.visible & answered] = ERROR_COLORS['false']
    seen = truth.visible & answered
    picture[seen] = ERROR_COLORS['large']
    with np.errstate(invalid='ignore'):
        picture[seen & (error <= 1)] = ERROR_COLORS['small']
        picture[seen & (error <= 0.5)] = ERROR_COLORS['right']
    return picture


def color_profile(pair, settings):
    """
    Return the three channels along the middle row before and after the paper's correction.

    Returns
    -------
    profile : dict
        Title to float32 (W, 3), as in the paper's fig. 3.1.

    """
    row = pair.left.shape[0] // 2
    scaled, smooth = (ColorCorrection(replace(settings.color, smoothing=deviation)).correct(pair)
                      for deviation in (0.0, 3.0))
    return {'as recorded': pair.left[row].astype(np.float32),
            'after color correction (scaling)': scaled[0][0][row, :, :3],
            'after smoothing': smooth[0][0][row, :, :3]}


def run_tasks(tasks, progress):
    """
    Run tasks.

    Parameters
    ----------
    tasks : list of Task
        What is to be done, independent of each other.
    progress : callable
        Wraps the list for a progress bar, for example `tqdm.tqdm`.

    Returns
    -------
    records : list of dict

    """
    records = []
    bar = progress(tasks)
    for task in bar:
        if hasattr(bar, 'set_description'):
            bar.set_description(f'{task.title:28}')
        records += task.run()
    return records

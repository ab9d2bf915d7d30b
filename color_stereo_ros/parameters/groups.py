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
"""The settings that the nodes have beside those of the core, and all parameters of each node."""

from dataclasses import dataclass, fields

from ..core.cameras.covariance import StereoCovariance
from ..core.false_color import RANGE_COLORS, RANGE_LIMITS
from ..core.patterns.frames import FRAMES, PATTERN
from ..core.results import POINT_FIELDS
from ..core.settings import explained, Group, HealthSettings, PatternSettings, setting
from ..core.settings import Settings
from ..errors import brief, SettingsError


@dataclass(frozen=True)
class InputSettings(Group):
    """What arrives."""

    prefix = 'input'

    rectified: bool = setting(
        False, 'true: the images are rectified already, by image_proc for example; of the '
        'calibration P alone counts')
    mode: str = setting(
        'stream', 'stream: every pair is measured; capture: one pair for each call of the service '
        '~/capture', choices=('stream', 'capture'))
    significant_bits: int = setting(
        16, 'of 16-bit Bayer images: the values fill so many low bits, 12 for example = 0 .. '
        '4095; 16 = full scale is 65535', unit='bit', minimum=8, maximum=16)
    transport: str = setting(
        'raw', 'of the images: raw = left/image_raw and right/image_raw; compressed = JPEG or PNG '
        'on left/image_raw/compressed and right/image_raw/compressed',
        choices=('raw', 'compressed'))
    survive_right_loss: bool = setting(
        False, 'where the right camera is silent or covered and the projector is known, the node '
        'goes on with left camera and projector')


@dataclass(frozen=True)
class PictureSettings(Group):
    """The picture of the depth: `range_image` and the file range_image.png."""

    prefix = 'output'

    range_colors: str = setting(
        RANGE_COLORS[0], 'of range_image: viridis = near yellow .. far violet, perceptually '
        'uniform, safe with color blindness; paper = near purple .. far orange',
        choices=RANGE_COLORS)
    range_limits: str = setting(
        RANGE_LIMITS[0], 'of the colors of range_image: fixed = range.min_depth .. '
        'range.max_depth; automatic = where 99 % of the known depths of each image lie',
        choices=RANGE_LIMITS)


@dataclass(frozen=True)
class OutputSettings(PictureSettings):
    """What is published."""

    depth_encoding: str = setting(
        '32FC1', 'of depth/image: 32FC1 in m with NaN = unknown, or 16UC1 in mm with 0 = unknown',
        choices=('32FC1', '16UC1'))
    frame: str = setting(
        'rectified', 'frame of points: rectified = the rectified left camera, which depth/image '
        'and the peers use; camera = the physical left camera, rotated by R transposed',
        choices=('rectified', 'camera'))
    frame_id: str = setting(
        '', 'name of the rectified left camera, which all outputs carry; empty = the frame_id of '
        'the left image, with _rectified before _optical_frame (or at its end) where R turns the '
        'camera by more than 0.1 degrees')
    compact_points: bool = setting(
        False, 'points holds the known points only, in one row, instead of H x W with NaN')
    point_fields: str = setting(
        '', f'more fields of points, separated by spaces, of {", ".join(POINT_FIELDS)}')
    region: str = setting(
        '', 'box outside of which everything is unknown, six numbers x_min x_max y_min y_max '
        'z_min z_max in the frame of points; inf = no limit; empty = no box', unit='m')
    decimation: int = setting(
        1, '1, 2 or 4: every output holds the pixels 0, N, 2 N .. of rows and columns, and '
        'depth/camera_info fits them', minimum=1, maximum=4)
    diagnostics_period: float = setting(
        1.0, 'time between two messages on /diagnostics', unit='s', minimum=0.1, maximum=60.0)
    save_directory: str = setting(
        '', 'where the service ~/save writes; empty = the directory that the node runs in')
    save_directory_fixed: bool = setting(
        True, 'output.save_directory and output.save_limit cannot be changed while the node runs; '
        'false: any folder inside of the one given at the start can be chosen')
    save_limit: int = setting(
        1000, 'the service ~/save refuses once its folder holds so many files of the node, which '
        'guards the disk',
        minimum=0, maximum=1_000_000)
    save_format: str = setting(
        'ply', 'of the files that the service ~/save writes', choices=('ply', 'pcd'))

    @property
    def names_of_fields(self):
        """Return `point_fields` as names, in the order of `POINT_FIELDS`."""
        given = self.point_fields.replace(',', ' ').split()
        return tuple(name for name in POINT_FIELDS if name in given)

    @property
    def box(self):
        """Return `region` as ((x_min, x_max), (y_min, y_max), (z_min, z_max)), m; None: no box."""
        numbers = [float(number) for number in self.region.replace(',', ' ').split()]
        return tuple(zip(numbers[::2], numbers[1::2])) or None

    def check_together(self):
        """Refuse lists in texts that cannot be read, and a decimation between its values."""
        if self.decimation == 3:
            raise SettingsError('output.decimation = 3, expected 1, 2 or 4')
        for name in self.point_fields.replace(',', ' ').split():
            if name not in POINT_FIELDS:
                raise SettingsError(f'output.point_fields: {brief(name)} is not one of '
                                    f'{", ".join(POINT_FIELDS)}')
        if not self._is_box():
            raise SettingsError(f'output.region = {brief(self.region)} is no box, expected x_min '
                                'x_max y_min y_max z_min z_max in m, each minimum below its '
                                'maximum')

    def _is_box(self):
        """Return whether `region` is empty or can be read."""
        count = len(self.region.replace(',', ' ').split())
        try:
            return not count or count == 6 and all(low < high for low, high in self.box)
        except ValueError:
            return False


@dataclass(frozen=True)
class SyncSettings(Group):
    """How left and right find each other."""

    prefix = 'sync'

    tolerance: float = setting(
        0.0, 'largest difference of the stamps of a pair; 0 adapts to a little less than half the '
        'frame period', unit='s', minimum=0.0, maximum=1.0)
    queue_size: int = setting(
        8, 'images of each camera that wait for their partner; set more where one camera '
        'arrives late by more frames', minimum=1, maximum=100)
    warn_after: float = setting(
        3.0, 'time without a pair after which the reason is reported', unit='s', minimum=0.1,
        maximum=600.0)


@dataclass(frozen=True)
class CaptureSettings(Group):
    """What the service ~/capture does."""

    prefix = 'capture'

    timeout: float = setting(
        5.0, 'time after the call in which a pair must come that is exposed after the call, and '
        'after each pair the time for the next one; a pair that has come is measured to the end',
        unit='s', minimum=0.1, maximum=600.0)
    pairs: int = setting(
        1, 'pairs of a scene that stands still, which are fused to one result; 8 pairs have about '
        'a third of the noise of one', minimum=1, maximum=100)


@dataclass(frozen=True)
class NodeHealthSettings(HealthSettings):
    """The same, and how exact the calibration is."""

    covariance: str = setting(
        '', 'file stereo_covariance.yaml of the calibration in use, which says how exact it is; '
        'empty = that of a good calibration is assumed')

    def read_covariance(self):
        """Return the StereoCovariance of the file, None without one; CalibrationError."""
        return StereoCovariance.read(self.covariance) if self.covariance else None


@dataclass(frozen=True)
class MeasuringSettings:
    """The settings of the core, for those who add groups of their own."""

    pattern: PatternSettings = Settings().pattern
    color: Group = Settings().color
    matching: Group = Settings().matching
    range: Group = Settings().range  # noqa: A003
    health: Group = Settings().health

    @property
    def core(self):
        """Return the part that the core knows."""
        return Settings(pattern=self.pattern, color=self.color, matching=self.matching,
                        range=self.range, health=self.health)


@dataclass(frozen=True)
class RangeNodeSettings(MeasuringSettings):
    """All parameters of range_node."""

    input: InputSettings = InputSettings()  # noqa: A003
    output: OutputSettings = OutputSettings()
    sync: SyncSettings = SyncSettings()
    capture: CaptureSettings = CaptureSettings()
    health: NodeHealthSettings = NodeHealthSettings()


@dataclass(frozen=True)
class ProcessSettings(MeasuringSettings):
    """All settings of `color_stereo process`."""

    output: PictureSettings = PictureSettings()


@dataclass(frozen=True)
class ShownSettings(PatternSettings):
    """What the projector shows now: its pattern, or a frame for calibrations."""

    frame: str = setting(
        PATTERN, lambda: f'what is shown: {explained(FRAMES, PATTERN)}', choices=FRAMES)

    @property
    def expected(self):
        """Return the settings of the pattern alone, by which range_node knows it."""
        return PatternSettings(**{spec.name: getattr(self, spec.name)
                                  for spec in fields(PatternSettings)})


@dataclass(frozen=True)
class PatternNodeSettings:
    """All parameters of pattern_node."""

    pattern: ShownSettings = ShownSettings()


@dataclass(frozen=True)
class SimSettings(Group):
    """What is simulated."""

    prefix = 'sim'

    scene: str = setting(
        'solids', 'name of a scene of the package, which `color_stereo render --list` shows, or a '
        'YAML file')
    rig: str = setting('', "name of a rig of the package, or a YAML file; empty = the scene's own")
    rate: float = setting(5.0, 'frames of each camera', unit='1/s', minimum=0.01, maximum=200.0)
    samples: int = setting(
        3, 'samples per pixel along either axis, 3 = nine of them; more are slower and smoother',
        minimum=1, maximum=16)
    indirect: bool = setting(True, 'render light that bounces between objects')
    cache: str = setting('', 'folder that keeps what does not depend on the pattern; empty = none')
    seed: int = setting(
        1, 'of the camera noise; the same gives the same images', minimum=0, maximum=2**31 - 1)


@dataclass(frozen=True)
class SimRigSettings:
    """All parameters of sim_rig_node."""

    sim: SimSettings = SimSettings()

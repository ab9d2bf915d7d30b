# SPDX-License-Identifier: Apache-2.0
"""Build and installation, the same for pip and colcon."""

from pathlib import Path
import re

import setuptools
from setuptools import find_packages, setup

NAME = 'color_stereo_ros'
HERE = Path(__file__).resolve().parent
HOME = f'https://github.com/color-stereo-ros/{NAME}'

# Since version 77, setuptools writes an SPDX expression into a field of its own; Jazzy has 68.
LICENSE = 'license_expression' if int(setuptools.__version__.split('.')[0]) >= 77 else 'license'


def shared(folder):
    """Return a `data_files` row that installs the files of a folder into share/<package>."""
    files = sorted(path for path in (HERE / folder).glob('*') if path.is_file())
    return f'share/{NAME}/{folder}', [str(path.relative_to(HERE)) for path in files]


def readme():
    """Return README with links and pictures that the package index can follow."""
    text = (HERE / 'README.md').read_text(encoding='utf-8')
    raw = HOME.replace('github.com', 'raw.githubusercontent.com')
    text = re.sub(r'(!\[[^]]*\]\()(?![a-z]+:|#)', rf'\1{raw}/main/', text)
    return re.sub(r'(?<!!)(\[[^]]*\]\()(?![a-z]+:|#)', rf'\1{HOME}/blob/main/', text)


setup(
    name=NAME,
    # `catkin_prepare_release` changes this line and package.xml; a test holds them equal. The
    # package asks for the version that is installed.
    version='0.1.0',
    description='Single-shot range finder with two color cameras and a projected color pattern',
    long_description=readme(),
    long_description_content_type='text/markdown',
    **{LICENSE: 'Apache-2.0'},
    license_files=['LICENSE'],
    url=HOME,
    project_urls={
        'Documentation': f'{HOME}/blob/main/docs/index.md',
        'Changelog': f'{HOME}/blob/main/CHANGELOG.rst',
        'Issues': f'{HOME}/issues',
        'Source': HOME,
    },
    keywords=['3d camera', 'depth', 'point cloud', 'range finder', 'robotics', 'ros2', 'stereo',
              'structured light'],
    classifiers=[
        'Development Status :: 4 - Beta',
        'Intended Audience :: Developers',
        'Intended Audience :: Manufacturing',
        'Intended Audience :: Science/Research',
        'Operating System :: POSIX :: Linux',
        'Programming Language :: Python :: 3',
        'Programming Language :: Python :: 3.11',
        'Programming Language :: Python :: 3.12',
        'Programming Language :: Python :: 3.13',
        'Programming Language :: Python :: Implementation :: CPython',
        'Topic :: Scientific/Engineering :: Image Processing',
        'Topic :: Scientific/Engineering :: Image Recognition',
        'Typing :: Typed',
    ],
    maintainer='color_stereo_ros maintainers',
    maintainer_email='maintainers@color-stereo.example',
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_data={'': ['**/*.yaml', '**/*.json', '**/*.png', '**/*.webp', '**/*.ply', '**/*.html',
                       '**/*.xml'], NAME: ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
        shared('config'),
        shared('hook'),
        shared('launch'),
    ],
    python_requires='>=3.11',
    # Lower bounds: numpy, OpenCV and PyYAML of Ubuntu 24.04; numba .58 is the first that takes
    # this numpy. `make floor` runs the tests with constraints/oldest.txt. numba alone has an upper
    # bound, the first release that was not tested: core/compiled uses private parts of it, which
    # change from release to release. With a newer one, installed by hand, the kernels use public
    # functions only and are slower.
    install_requires=['numpy>=1.26', 'numba>=0.58,<0.69', 'opencv-python-headless>=4.6',
                      'PyYAML>=6.0'],
    extras_require={
        # ROS 2 Jazzy itself, for machines without /opt/ros
        'ros': ['ros-jazzy-rclpy[fastrtps]', 'ros-jazzy-common-interfaces'],
        'sim': ['mitsuba>=3.5', 'tqdm>=4.66'],
        'project': ['pygame>=2.1'],
        # rosbags up to 0.11.6 compresses by another library; mcap reads what is whole of damaged
        # files; distributed: `convert` in several processes
        'tools': ['rosbags>=0.11.7', 'mcap>=1.1', 'matplotlib>=3.6', 'tqdm>=4.66',
                  'distributed>=2023.1'],
        'cluster': ['distributed>=2023.1'],
        'view': ['viser>=1.1'],
        'docs': ['sphinx>=7.2', 'myst-parser>=2.0', 'furo>=2023.9'],
        'test': ['pytest>=7.4', 'pytest-xdist>=3.4', 'colcon-common-extensions', 'setuptools<80',
                 'playwright>=1.40', 'mypy>=1.8',
                 'ruff==0.17.6'],  # each minor version knows new rules; see pre-commit
    },
    zip_safe=False,
    entry_points={'console_scripts': [
        f'range_node = {NAME}.nodes.range_node:main',
        f'lifecycle_range_node = {NAME}.nodes.lifecycle_range_node:main',
        f'pattern_node = {NAME}.nodes.pattern_node:main',
        f'sim_rig_node = {NAME}.nodes.sim_rig_node:main',
        f'color_stereo = {NAME}.cli.main:main',
        f'show_rviz = {NAME}.nodes.launching:show_rviz',
        f'play_recording = {NAME}.nodes.launching:play_recording',
    ]},
)

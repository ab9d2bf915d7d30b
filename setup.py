# SPDX-License-Identifier: Apache-2.0
"""Build and installation, the same for pip and colcon."""

from pathlib import Path

from setuptools import find_packages, setup

NAME = 'color_stereo_ros'
HERE = Path(__file__).resolve().parent


def shared(folder):
    """Return a `data_files` row that installs the files of a folder into share/<package>."""
    files = sorted(path for path in (HERE / folder).glob('*') if path.is_file())
    return f'share/{NAME}/{folder}', [str(path.relative_to(HERE)) for path in files]


setup(
    name=NAME,
    version='0.1.0',
    description='Single-shot range finder with two color cameras and a projected color pattern',
    long_description=(HERE / 'README.md').read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    license='Apache-2.0',
    maintainer='color_stereo_ros maintainers',
    maintainer_email='maintainers@color-stereo.example',
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_data={'': ['**/*.yaml', '**/*.json', '**/*.png', '**/*.webp', '**/*.ply', '**/*.html',
                       '**/*.xml']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
        shared('config'),
        shared('hook'),
        shared('launch'),
    ],
    python_requires='>=3.11',
    # core/compiled uses private parts of numba, which change from release to release: the upper
    # bound is the first release that was not tested. Newer ones work, too, but more slowly.
    install_requires=['numpy>=1.26', 'numba>=0.58,<0.69', 'opencv-python-headless>=4.6',
                      'PyYAML>=6.0'],
    extras_require={
        # ROS 2 Jazzy itself, for machines without /opt/ros
        'ros': ['ros-jazzy-rclpy[fastrtps]', 'ros-jazzy-common-interfaces'],
        'sim': ['mitsuba>=3.5', 'tqdm>=4.66'],
        'project': ['pygame>=2.1'],
        # mcap reads what is whole of damaged files; distributed: `convert` in several processes
        'tools': ['rosbags>=0.11', 'mcap>=1.1', 'matplotlib>=3.6', 'tqdm>=4.66',
                  'distributed>=2023.1'],
        'cluster': ['distributed>=2023.1'],
        'view': ['viser>=1.1'],
        'test': ['pytest>=7.4', 'pytest-xdist>=3.4', 'colcon-common-extensions', 'setuptools<80',
                 'playwright>=1.40'],
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

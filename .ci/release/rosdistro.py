# SPDX-License-Identifier: Apache-2.0
"""
A stand-in for the index of ROS and the keys of rosdep, so that bloom runs without the network.

It knows the dependencies of package.xml alone: names of ROS packages as released in Jazzy, and
keys that are names of packages of Ubuntu.

"""

import gzip
from xml.etree import ElementTree

INDEX = """%YAML 1.1
---
distributions:
  jazzy:
    distribution: [distribution.yaml]
    distribution_cache: {base}/cache.yaml.gz
    distribution_status: active
    distribution_type: ros2
    python_version: 3
type: index
version: 4
"""
DISTRIBUTION = """release_platforms:
  ubuntu: [noble]
repositories:
{repositories}type: distribution
version: 2
"""
REPOSITORY = """  {name}:
    release:
      tags: {{release: 'release/jazzy/{{package}}/{{version}}'}}
      url: {base}/{name}.git
      version: 1.0.0-1
"""
CACHE = """%YAML 1.1
---
distribution_file:
- {distribution}
name: jazzy
release_package_xmls: {{}}
source_repo_package_xmls: {{}}
type: cache
version: 2
"""


def stand_in(places, package):
    """Write it for the package in a folder; return the variables by which bloom finds it."""
    folder = places.output / 'rosdistro'
    (folder / 'sources').mkdir(parents=True)
    base = folder.as_uri()
    keys = {element.text for element in ElementTree.parse(package / 'package.xml').getroot()
            if element.tag.endswith('_depend')}
    ros = sorted(key for key in keys if not key.startswith('python3-'))
    distribution = DISTRIBUTION.format(repositories=''.join(
        REPOSITORY.format(name=name, base=base) for name in ros))
    files = {
        'index.yaml': INDEX.format(base=base),
        'distribution.yaml': f'%YAML 1.1\n---\n{distribution}',
        'rosdep.yaml': ''.join(f'{key}: {{ubuntu: [{key}]}}\n' for key in sorted(keys - {*ros})),
        'sources/default.list': f'yaml {base}/rosdep.yaml\n'}
    for name, text in files.items():
        (folder / name).write_text(text, encoding='utf-8')
    with gzip.open(folder / 'cache.yaml.gz', 'wt') as cache:
        cache.write(CACHE.format(distribution=distribution.strip().replace('\n', '\n  ')))
    environment = {'ROSDISTRO_INDEX_URL': f'{base}/index.yaml', 'HOME': str(folder),
                   'ROSDEP_SOURCE_PATH': str(folder / 'sources'), 'ROS_HOME': str(folder),
                   'ROS_OS_OVERRIDE': 'ubuntu:noble'}
    places.run(places.tools.with_name('rosdep'), 'update', environment=environment)
    return environment

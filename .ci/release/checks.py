# SPDX-License-Identifier: Apache-2.0
"""The checks of a release, in the order in which they run."""

from dataclasses import dataclass
import hashlib
import os
import re
import shlex
import shutil
import sys
import tarfile
from typing import Callable
from xml.etree import ElementTree

from . import rosdistro
from .places import Failed, LeftOut, NotHere

PYTHONS = '3.11', '3.12', '3.13'
OWN = '.'.join(map(str, sys.version_info[:2]))
SAMPLE = 'process', '--sample', '--output', 'out'
CHECKS = []
EPOCH = {'SOURCE_DATE_EPOCH': '1700000000'}

MESSAGES = (
    (('color_stereo', 'render', 'nut', 'out'), 'color_stereo_ros[sim]'),
    (('color_stereo', 'convert', 'recording', 'out'), 'color_stereo_ros[tools]'),
    (('color_stereo', 'view', '--sample'), 'color_stereo_ros[view]'),
    (('color_stereo', 'project', '--level', '3'), 'color_stereo_ros[project]'),
    (('range_node',), 'color_stereo_ros[ros]'),
    (('pattern_node',), 'color_stereo_ros[ros]'),
)
"""Command of the bare wheel, and what pip should install for it."""


@dataclass(frozen=True)
class Check:
    """One row of the table."""

    name: str
    command: str
    """As a person would type it."""
    function: Callable
    """Takes the Places, returns what it has found as a text, raises what `places` defines."""


def check(name, command):
    """Return a decorator that lists a function as a check."""
    def listed(function):
        CHECKS.append(Check(name, command, function))
        return function
    return listed


def count(number, noun):
    """Return '1 file', '2 files'."""
    return f'{number} {noun}{"" if number == 1 else "s"}'


@check('build', 'python -m build')
def build(places):
    """Build source distribution and wheel; the wheel comes from the source distribution."""
    dist = places.output / 'dist'
    places.run(places.tools, '-m', 'build', '--outdir', dist, places.tree, environment=EPOCH)
    return ', '.join(f'{path.name} {path.stat().st_size / 1e6:.2f} MB'
                     for path in (places.sdist, places.wheel))


@check('the same wheel again', 'python -m build --wheel')
def reproducible(places):
    """Build the wheel from the unpacked source distribution and compare the bytes."""
    again = places.output / 'again'
    places.run(places.tools, '-m', 'build', '--wheel', '--outdir', again, unpacked(places),
               environment=EPOCH)
    one, other = (hashlib.sha256(path.read_bytes()).hexdigest()
                  for path in (places.wheel, next(again.glob('*.whl'))))
    if one != other:
        raise Failed('two builds differ')
    return f'sha256 {one[:12]}'


def unpacked(places):
    """Return the folder of the unpacked source distribution."""
    folder = places.output / 'unpacked'
    if not folder.exists():
        with tarfile.open(places.sdist) as archive:
            archive.extractall(folder, filter='data')
    return next(folder.iterdir())


@check('twine', 'twine check --strict dist/*')
def twine(places):
    """Ask whether the package index would take and render both."""
    places.run(places.tools, '-m', 'twine', 'check', '--strict', places.sdist, places.wheel)
    return '0 findings'


@check('check-wheel-contents', 'check-wheel-contents dist/*.whl')
def contents(places):
    """Look for files that do not belong into a wheel, or are missing."""
    places.run(places.tools.with_name('check-wheel-contents'), places.wheel)
    return '0 findings'


def installed(places, version=OWN):
    """Return the Python of an environment that holds the wheel, at first nothing else."""
    return places.environment(f'python-{version}', places.wheel, version=version)


@check('messages of the bare wheel', 'color_stereo render ...; color_stereo convert ...')
def messages(places):
    """Ask for what the wheel alone cannot do; each ends with one sentence and the extra."""
    folder = installed(places).parent
    for (program, *words), wanted in MESSAGES:
        ran = places.run(folder / program, *words, passes=False)
        lines = [line for line in ran.stdout.splitlines() if line.strip()]
        if ran.returncode != 1 or len(lines) != 1 or f'pip install "{wanted}"' not in lines[0]:
            raise Failed(f'{program} {" ".join(words)}: {lines[-1:]}')
    return count(len(MESSAGES), 'sentence')


@check('mypy', 'mypy --strict test/data/typed/right.py')
def types(places):
    """Check a user's script against the hints of the installed wheel."""
    installed(places)
    python = places.environment(f'python-{OWN}', 'mypy>=1.8')
    places.run(python, '-m', 'mypy', '--strict', '--no-incremental',
               places.tree / 'test/data/typed/right.py')
    return '0 findings'


def on_tree(name):
    """List the check by a linter of ROS that PyPI has."""
    @check(name, f'{name} .')
    def linted(places):
        """Run it as it is on Jazzy."""
        python = places.environment('linters', '-r', places.root / '.ci/release/linters.txt')
        places.run(python.with_name(name), '.', cwd=places.tree)
        return '0 findings'


for each in ('ament_flake8', 'ament_pep257'):
    on_tree(each)


@check('ament_copyright', 'ament_copyright .')
def copyrights(places):
    """Look for copyright and license of every source; apt has the linter, PyPI has not."""
    program = shutil.which('ament_copyright')
    if program is None:
        raise NotHere('apt install python3-ament-copyright')
    places.run(program, '.', cwd=places.clone)
    return '0 findings'


@check('xmllint', 'xmllint --noout --nonet ...')
def xml(places):
    """Check that every XML file is well-formed; the schema of package.xml needs the network."""
    if shutil.which('xmllint') is None:
        raise NotHere('apt install libxml2-utils')
    files = sorted(places.tree.rglob('*.xml'))
    places.run('xmllint', '--noout', '--nonet', *files)
    return f'{count(len(files), "file")}, 0 findings'


@check('ruff', 'ruff check .')
def ruff(places):
    """Ask for what breaks the rules of ruff.toml."""
    places.run(places.tools.with_name('ruff'), 'check', '--no-cache', '.', cwd=places.tree)
    return '0 findings'


@check('pre-commit', 'pre-commit run --all-files')
def hooks(places):
    """Run all hooks but the one that is a part of the tests, in a clone that they may change."""
    folder = places.output / 'hooked'
    places.run('git', 'clone', '--quiet', places.clone, folder)
    ran = places.run(places.tools.with_name('pre-commit'), 'run', '--all-files', cwd=folder,
                     environment={'SKIP': 'prose', **path_of(places.tools)}, passes=False)
    if 'Could not resolve host' in ran.stdout:
        raise NotHere('no network: the hooks come from GitHub')
    failed = re.findall(r'^(.*?)\.+Failed$', ran.stdout, re.MULTILINE)
    if ran.returncode:
        raise Failed(', '.join(failed) or ran.stdout.splitlines()[-1])
    return count(len(re.findall(r'\.Passed$', ran.stdout, re.MULTILINE)), 'hook')


@check('external links', '.ci/links')
def external(places):
    """Ask for every link that leaves the repository; the tests look at the others."""
    ran = places.run(sys.executable, places.tree / '.ci/links', passes=False)
    asked, silent = map(int, re.search(r'^(\d+) links, (\d+) ', ran.stdout, re.MULTILINE).groups())
    if silent == asked:
        raise NotHere(f'no network: none of {asked} links answers')
    if silent:
        raise Failed(f'{count(silent, "link")} without an answer')
    return count(asked, 'link')


@check('site', 'make docs')
def site(places):
    """Build manual and API from the wheel's docstrings; a warning is an error."""
    python = places.environment('site', f'{places.wheel}[docs]')
    places.run(python, '-m', 'sphinx', '-W', '--keep-going', '-q', places.tree / 'docs',
               places.output / 'site')
    return count(len(list((places.output / 'site').glob('*.html'))), 'page') + ', 0 warnings'


@check('rosdoc2', 'rosdoc2 build --package-path .')
def rosdoc2(places):
    """Build the same pages as the ROS build farm does; it does not fail by warnings."""
    places.environment('site', f'{places.wheel}[docs]')
    python = places.environment('site', 'rosdoc2>=0.2')
    folders = [word for option in ('output', 'doc-build', 'cross-reference')
               for word in (f'--{option}-directory', places.output / f'rosdoc2/{option}')]
    said = places.run(python.with_name('rosdoc2'), 'build', '--package-path', places.tree,
                      *folders, environment=path_of(python)).stdout
    if warnings := said.count('WARNING: '):
        raise Failed(count(warnings, 'warning'))
    return '0 warnings'


@check('reuse', 'reuse lint')
def reuse(places):
    """Ask whether every file has a holder of its rights and a license."""
    said = places.run(places.tools.with_name('reuse'), 'lint', cwd=places.clone).stdout
    return re.search(r'Files with license information: (.*)', said).group(1) + ' files'


def released(places):
    """Return a clone in which `catkin_prepare_release` has raised the version."""
    folder = places.output / 'released'
    if not folder.exists():
        places.run('git', 'clone', '--quiet', places.clone, folder)
        for words in (['config', 'user.name', 'release check'],
                      ['config', 'user.email', 'release-check@localhost'],
                      ['remote', 'set-url', 'origin', places.output / 'remote.git']):
            places.run('git', *words, cwd=folder)
        places.run(places.tools.with_name('catkin_prepare_release'), '--non-interactive',
                   '--bump', 'minor', cwd=folder, environment=path_of(places.tools))
    return folder


def path_of(python):
    """Return the variables by which the programs beside a Python are found."""
    return {'PATH': f'{python.parent}{os.pathsep}{os.environ["PATH"]}'}


@check('catkin_prepare_release', 'catkin_prepare_release; pytest test/test_package.py ...')
def prepared(places):
    """Raise the version in a clone, and run the tests that look at version and changelog."""
    folder = released(places)
    if places.run('git', 'status', '--porcelain', cwd=folder).stdout:
        raise Failed('the clone is not clean')
    version = ElementTree.parse(folder / 'package.xml').findtext('version')
    python = places.environment('prepared', f'{places.wheel}[tools]', 'pytest', 'setuptools<80')
    places.run(python, '-m', 'pip', 'install', '--quiet', '--no-deps', '-e', folder)
    ran = places.run(python, '-m', 'pytest', '-q', '-p', 'no:cacheprovider',
                     'test/test_package.py', 'test/test_linters.py', 'test/test_prose.py',
                     'test/test_readme.py::test_the_changelog_begins_with_what_comes_or_with_'
                     'the_version_of_the_package', '-k', 'not colcon and not workspace',
                     cwd=folder)
    return f'{version}: {ran.stdout.splitlines()[-1]}'


@check('bloom, noble', 'bloom-generate rosdebian --os-name ubuntu --os-version noble '
                       '--ros-distro jazzy')
def bloom(places):
    """Make the Debian files from a stand-in for the index of ROS, since there is no network."""
    folder = released(places)
    environment = rosdistro.stand_in(places, folder) | path_of(places.tools)
    places.run(places.tools.with_name('bloom-generate'), 'rosdebian', '--os-name', 'ubuntu',
               '--os-version', 'noble', '--ros-distro', 'jazzy', cwd=folder,
               environment=environment)
    control = (folder / 'debian/control').read_text(encoding='utf-8')
    return count(len(re.search(r'^Depends: (.*)$', control, re.MULTILINE).group(1).split(', ')),
                 'name') + ' in Depends'


@check('bloom, RHEL 9', 'bloom-generate rosrpm --os-name rhel --os-version 9 --ros-distro jazzy')
def rhel(places):
    """Say why it is left out."""
    raise LeftOut('rosdep has no key for numba and pygame on RHEL 9')


@check('sdist: tests collect', 'pytest --collect-only')
def collected(places):
    """Collect all tests where the source distribution is unpacked."""
    folder = unpacked(places)
    ran = places.run(sys.executable, '-m', 'pytest', '-p', 'no:cacheprovider', '-q',
                     '--collect-only', cwd=folder, environment={'PYTHONPATH': str(folder)})
    return ran.stdout.splitlines()[-1]


def on_python(version):
    """List the check of one version of Python."""
    @check(f'Python {version}', 'pip check; python -m color_stereo_ros process --sample')
    def measured(places):
        """Install the wheel alone, and measure the sample."""
        python = installed(places, version)
        places.run(python, '-m', 'pip', 'check')
        places.run(python, '-m', 'color_stereo_ros', *SAMPLE)
        listed = places.run(python, '-m', 'pip', 'list', '--format=freeze').stdout
        return ' '.join(re.findall(r'^((?:numpy|numba|opencv\S*?)==\S+)', listed, re.MULTILINE))


for each in PYTHONS:
    on_python(each)


@check('commands of README', 'color_stereo ... of its first section with commands')
def readme(places):
    """Run what README shows first, in order, in an empty folder, from the wheel."""
    commands = first_commands((places.tree / 'README.md').read_text(encoding='utf-8'))
    if not commands:
        raise Failed('README shows no command')
    installed(places)
    python = places.environment(f'python-{OWN}', f'{places.wheel}[sim,tools]')
    folder = places.empty()
    for command in commands:
        program, *words = shlex.split(command, comments=True)
        places.run(python.with_name(program), *words, cwd=folder)
    return '; '.join(commands)


def first_commands(text):
    """Return the lines `color_stereo ...` of the first section that has such lines."""
    for section in re.split(r'^## ', text, flags=re.MULTILINE):
        found = re.findall(r'^(?: {4})?(color_stereo .*?)\s*(?:#.*)?$', section, re.MULTILINE)
        if found:
            return found
    return []


@check('sdist: quick lane', 'make quick')
def quick(places):
    """Run the quick lane there, in an environment of its own."""
    ran = places.run('make', '--no-print-directory', 'quick', cwd=unpacked(places),
                     environment={'PYTHONPATH': None})
    return ran.stdout.splitlines()[-1].strip('= ')


@check('colcon test', 'colcon build; colcon test; colcon test-result')
def colcon(places):
    """Run all tests in a workspace, if asked by WHOLE=1: they take as long as `make test`."""
    if not os.environ.get('WHOLE'):
        raise LeftOut('takes as long as `make test`; WHOLE=1 asks for it')
    workspace = places.output / 'workspace'
    shutil.copytree(places.tree, workspace / 'src/color_stereo_ros')
    program = shutil.which('colcon') or os.path.join(os.path.dirname(sys.executable), 'colcon')
    for words in (['build'], ['test', '--event-handlers', 'console_direct+']):
        places.run(program, *words, cwd=workspace, timeout=2 * 3600)
    said = places.run(program, 'test-result', cwd=workspace).stdout
    return said.splitlines()[-1]

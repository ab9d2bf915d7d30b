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
The command `color_stereo`: finds its subcommands, runs one, turns known errors into one line.

A module beside this one is a subcommand of the same name if it has a SUMMARY (one line), NEEDS
(the extras, '' = none), `add_arguments(parser)` and `run(args)`, which returns an exit status or
None for 0. Only the module that runs is imported, so that `color_stereo --help` needs neither ROS
nor a simulator.

A module with a constant COMMANDS instead of the two functions holds commands of its own: it names
the folder beside it that holds their modules, which are made in the same way.

"""

import argparse
import ast
from contextlib import contextmanager
import difflib
import importlib
import itertools
import os
from pathlib import Path
import re
import signal
import sys
import threading

from .. import __version__

WRONG_USAGE = 2  # as argparse has it
FAILURE = 1
PARTLY = 3  # the result is written, but a part of the input was refused
INTERRUPTED = 130

OPTION = re.compile(r'--?[A-Za-z][\w.-]*')

EXTRAS = {
    'sim': ('mitsuba', 'drjit'),
    'project': ('pygame',),
    'tools': ('rosbags', 'mcap', 'matplotlib', 'tqdm', 'distributed', 'dask'),
    'view': ('viser',),
    'ros': ('rclpy', 'rosidl_runtime_py', 'sensor_msgs', 'std_msgs', 'stereo_msgs', 'std_srvs',
            'diagnostic_msgs', 'builtin_interfaces', 'rcl_interfaces', 'lifecycle_msgs'),
}


def main(argv=None):
    """
    Run `color_stereo`.

    Parameters
    ----------
    argv : list of str or None
        The arguments after the program's name; None takes them from the command line.

    Returns
    -------
    status : int
        0 = done, 1 = it failed, 2 = wrong arguments or settings, 3 = done, but a part of the
        input was refused, 130 = interrupted, 143 = ended by SIGTERM.

    """
    try:
        args = parsed(sys.argv[1:] if argv is None else list(argv))
        with _ended_in_order():
            return args.run(args) or 0
    except KeyboardInterrupt:
        return _fail('interrupted', INTERRUPTED)
    except BrokenPipeError:
        # The reader of our output has gone (`color_stereo settings | head`): not an error.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:
        return _fail(*_explained(error))


@contextmanager
def _ended_in_order():
    """Let SIGTERM and SIGHUP end the block as an error does, so that nothing unfinished stays."""
    def end(number, _):
        signal.signal(number, signal.SIG_IGN)  # the second one must not disturb the cleaning up
        raise SystemExit(128 + number)

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = [number for number in (signal.SIGTERM, signal.SIGHUP)
               if signal.getsignal(number) is signal.SIG_DFL]
    for number in numbers:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number in numbers:
            signal.signal(number, signal.SIG_DFL)


def parsed(argv):
    """
    Return the arguments of a command line; their attribute `run` is the function to call.

    Raises
    ------
    SystemExit
        With status 0 for `--help`, with 2 for wrong arguments; the text is printed.

    """
    parser = argparse.ArgumentParser(
        prog='color_stereo', description='Range images from two color cameras and a projector.',
        epilog='`color_stereo COMMAND --help` explains a command. Exit status: 0 = done; 1 = it '
        'failed, for example because a file is missing or damaged; 2 = the command line or a '
        'settings file is wrong; 3 = done, but a part of the input was refused; 130 = '
        'interrupted.',
        allow_abbrev=False)
    parser.add_argument('--version', action='version', version=f'color_stereo_ros {__version__}')
    _add_commands(parser, argv, __package__)
    return parser.parse_args(argv)


def _add_commands(parser, argv, package):
    """
    Add the commands of a package; the one that the first word of argv names gets its arguments.

    Underscores in the name of a module are hyphens of its command.

    """
    folder = Path(__file__).parent.joinpath(*package.split('.')[len(__package__.split('.')):])
    subparsers = parser.add_subparsers(title='commands', metavar='COMMAND', required=True)
    chosen = next((word for word in argv if not word.startswith('-')), None)
    needs = find_commands(folder, 'NEEDS')
    for module, summary in find_commands(folder).items():
        name = module.replace('_', '-')
        subparser = subparsers.add_parser(
            name, help=summary, description=summary, allow_abbrev=False,
            epilog=needs[module] and f'Extras of the package that it needs: {needs[module]}.')
        if name == chosen:
            _complete(subparser, argv[argv.index(name) + 1:], f'{package}.{module}')
    if chosen is not None and chosen not in subparsers.choices:
        parser.error(f'unknown command {chosen!r}{nearest(chosen, subparsers.choices)} (there '
                     f'are {", ".join(subparsers.choices)})')
    check_options(parser, itertools.takewhile(lambda word: word != chosen, argv))


def _complete(parser, argv, name):
    """Give the parser of a command its arguments, or its own commands."""
    module = importlib.import_module(name)
    if hasattr(module, 'COMMANDS'):
        _add_commands(parser, argv, f'{__package__}.{module.COMMANDS}')
        return
    from .arguments import Help
    parser.formatter_class = Help
    module.add_arguments(parser)
    parser.set_defaults(run=module.run)
    check_options(parser, argv)


def check_options(parser, words):
    """End with status 2 and the nearest known name where an option is unknown."""
    known = parser._option_string_actions  # argparse has no public name for it
    for word in itertools.takewhile(lambda word: word != '--', words):
        option = word.partition('=')[0]
        if OPTION.fullmatch(option) and option not in known and not option.startswith('-h'):
            parser.error(f'unknown option {option}{nearest(option, known)}')


def nearest(name, known):
    """Return `'; did you mean ...?'` for the known name nearest to a mistyped one, or ''."""
    bare = {each.lstrip('-').replace('_', '-'): each for each in known}
    near = difflib.get_close_matches(name.lstrip('-').replace('_', '-'), bare, n=1)
    near = near or [each for each in bare if each.rpartition('.')[2] == name.lstrip('-')]
    return f'; did you mean {bare[near[0]]}?' if near else ''


def find_commands(folder=None, constant='SUMMARY'):
    """
    Return a dict of command names to their summaries, sorted by name, importing nothing.

    The constant 'NEEDS' gives the extras that they need instead.

    """
    folder = Path(__file__).parent if folder is None else Path(folder)
    found = {path.stem: _constant(path, constant) for path in sorted(folder.glob('[!_]*.py'))}
    return {name: text for name, text in found.items() if text is not None}


def _constant(path, name):
    """Return the string that a module assigns to a name at its top level, or None."""
    for node in ast.parse(path.read_text(encoding='utf-8')).body:
        if (isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
                and node.targets[0].id == name):
            return ast.literal_eval(node.value)
    return None


def _explained(error):
    """Return (one line, exit status) for an error that a user can act on; raise any other."""
    # Imported here: the core takes a second to import, which `--help` should not pay.
    from ..errors import ColorStereoError, SettingsError
    if isinstance(error, ColorStereoError):
        return error, WRONG_USAGE if isinstance(error, SettingsError) else FAILURE
    if isinstance(error, ModuleNotFoundError):
        return _missing_extra(error), FAILURE
    if isinstance(error, OSError):
        known = error.filename is not None and error.strerror is not None
        return f'{error.filename}: {error.strerror}' if known else error, FAILURE
    raise error


def _missing_extra(error):
    """Return which extra installs a missing module; raise for modules of no extra."""
    missing = (error.name or '').partition('.')[0]
    for extra, modules in EXTRAS.items():
        if missing in modules:
            from ..errors import pip_install
            return (f'this command needs {missing!r}, which is not installed: '
                    + ('source the setup.bash of ROS 2, or ' if extra == 'ros' else '')
                    + pip_install(extra))
    raise error


def warn(message):
    """Print a warning on standard error."""
    print(f'color_stereo: warning: {message}', file=sys.stderr)


def _fail(message, status):
    from ..errors import bounded
    print(f'color_stereo: {bounded(str(message))}', file=sys.stderr)
    return status


if __name__ == '__main__':
    sys.exit(main())

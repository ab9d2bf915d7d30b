# SPDX-License-Identifier: Apache-2.0
"""`color_stereo calibrate`: the commands that find out what a rig is; see `calibrating/`."""

import importlib
from pathlib import Path

SUMMARY = 'calibrate a rig: geometry and what else is beside it, each a command of its own'
NEEDS = ''
COMMANDS = 'calibrating'


def add_arguments(parser):
    """Declare the commands below this one, each with its own arguments."""
    from .main import find_commands
    subparsers = parser.add_subparsers(title='commands', metavar='COMMAND', required=True)
    for name, summary in find_commands(Path(__file__).parent / COMMANDS).items():
        module = importlib.import_module(f'{__package__}.{COMMANDS}.{name}')
        command = subparsers.add_parser(
            name.replace('_', '-'), help=summary, description=summary, allow_abbrev=False,
            epilog=f'Needs the extras {module.NEEDS} of the package.' if module.NEEDS else None)
        module.add_arguments(command)
        command.set_defaults(run_calibration=module.run)


def run(args):
    """Run the command that the command line names."""
    return args.run_calibration(args)

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
"""`color_stereo inspect`: what a recording holds, and whether it can be measured."""

SUMMARY = 'tell in seconds what a recording holds and whether it can be measured'
NEEDS = '[tools]'


def add_arguments(parser):
    """Declare the arguments."""
    from ..parameters.groups import RangeNodeSettings
    from .arguments import add_settings_arguments
    from .recorded import add_recording_arguments
    add_recording_arguments(parser)
    parser.add_argument('--json', action='store_true', help='print the findings as JSON; lengths '
                        'in m, times in s')
    add_settings_arguments(parser, settings=RangeNodeSettings())


def run(args):
    """Print what is found; return 3 where something is damaged or cannot be measured."""
    import json

    from ..core import RecordingError
    from ..parameters.groups import RangeNodeSettings
    from ..recordings.inspection import Inspection
    from ..recordings.inspection_text import inspection_text
    from ..recordings.reading import open_readable
    from .arguments import settings_from
    from .main import PARTLY
    from .recorded import named_topics
    settings, lost = settings_from(args, RangeNodeSettings()), []
    try:
        recording = open_readable(args.recording, lost.append)
    except RecordingError as error:
        if args.json:
            print(json.dumps({'recording': args.recording, 'usable': False,
                              'problems': [str(error)]}, indent=2))
        raise
    with recording:
        found = Inspection(recording, settings, args.namespace, named_topics(args),
                           given_options(args), lost).look()
    print(json.dumps(found, indent=2, allow_nan=False) if args.json else inspection_text(found))
    return None if found['usable'] and not found['damage'] else PARTLY


def given_options(args):
    """Return the options of a command line that set something, as words."""
    from ..core.settings import flat
    from ..parameters.groups import RangeNodeSettings
    words = ['--config', args.config] if args.config else []
    for name in flat(RangeNodeSettings()):
        value = getattr(args, name, None)
        if value is not None:
            words += [f'--{name}', str(value).lower() if isinstance(value, bool) else str(value)]
    return words

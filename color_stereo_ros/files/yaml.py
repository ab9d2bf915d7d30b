# SPDX-License-Identifier: Apache-2.0
"""Read YAML files; what goes wrong is said in one line and without the words of programmers."""

from pathlib import Path

import yaml


class UnreadableError(Exception):
    """A file is missing or no YAML; the text says which, and in which line, but not the file."""


def load_yaml(path):
    """
    Return the content of a YAML file.

    Parameters
    ----------
    path : path-like

    Raises
    ------
    UnreadableError
        If the file cannot be read, is no text, or no YAML.

    """
    try:
        return yaml.safe_load(Path(path).read_text(encoding='utf-8'))
    except OSError as error:
        raise UnreadableError(f'cannot be read: {error.strerror}') from error
    except UnicodeDecodeError as error:
        raise UnreadableError('cannot be read: it is no text') from error
    except yaml.YAMLError as error:
        raise UnreadableError(f'is no YAML{_place(error)}') from error


def _place(error):
    mark, problem = getattr(error, 'problem_mark', None), getattr(error, 'problem', None)
    if mark is None:
        return ': it holds characters that are no text'
    return f', line {mark.line + 1}: {problem or "it ends too early"}'.replace('<stream end>',
                                                                               'the end')

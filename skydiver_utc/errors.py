# SPDX-License-Identifier: Apache-2.0
"""Errors of wrong input, and the exit codes of every command and node process."""

import difflib
from collections.abc import Sequence

FAILED = 1  # the run did not reach its end, or a result is wrong
REFUSED = 2  # nothing was started: an argument, a setting or a file cannot be used
STOPPED = 130  # interrupted by Ctrl-C or SIGTERM


class InputError(Exception):
    """An input cannot be used; the text is one sentence: what is wrong and what to do."""

    exit_code = REFUSED


class ParameterError(InputError, ValueError):
    """A parameter, file or name is wrong."""


class OwnClassError(ParameterError):
    """A `module:Class` of the user's own cannot be imported."""


class RecordingError(InputError):
    """A bag cannot be written or read."""


class AnalysisError(InputError):
    """A recording cannot be analysed."""


def hint(wrong: str, known: Sequence[str], otherwise: str) -> str:
    """The known name that was meant, or else other advice."""
    close = difflib.get_close_matches(wrong, known)
    return f"did you mean {close[0]}" if close else otherwise

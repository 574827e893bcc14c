# SPDX-License-Identifier: Apache-2.0
"""Errors of commands, as one sentence and an exit code."""

import errno
import os
import sys
from contextlib import suppress

import click

from skydiver_utc.errors import FAILED, REFUSED, STOPPED, InputError


def printable(text: str) -> str:
    """The text with control characters, which a terminal would obey, written as escapes; lines stay lines."""
    return "".join(c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text)


class CommandError(InputError):
    """A command cannot do its job; the text is one sentence, `exit_code` that of the process."""

    def __init__(self, sentence: str, exit_code: int = REFUSED) -> None:
        super().__init__(sentence)
        self.exit_code = exit_code


def exit_code_of(error: BaseException) -> int | None:
    """Print an error of wrong input; returns its exit code, or None for a fault of the program."""
    if isinstance(error, KeyboardInterrupt):
        click.echo("stopped", err=True)
        return STOPPED
    code, sentence = getattr(error, "exit_code", REFUSED), str(error)
    if isinstance(error, OSError):
        full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EIO)
        if error.filename is not None:
            sentence = (
                f"{error.filename} cannot be used ({error.strerror}): choose another path, or repair this one"
            )
        elif full:
            with suppress(OSError):  # a stdout without a file; nothing more can be written to it
                os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            sentence = f"the output cannot be written ({error.strerror}): make room, or write it elsewhere"
        else:
            return None
        code = FAILED if full else REFUSED
    elif not isinstance(error, InputError):
        return None
    click.echo(f"Error: {printable(sentence)}", err=True)
    return code

# SPDX-License-Identifier: Apache-2.0
"""The error of this room."""

from skydiver_utc.parameters.exit_codes import REFUSED


def printable(text: str) -> str:
    """The text with control characters, which a terminal would obey, written as escapes; lines stay lines."""
    return "".join(c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text)


class CommandError(Exception):
    """A command cannot do its job; the text is one sentence, `exit_code` that of the process."""

    def __init__(self, sentence: str, exit_code: int = REFUSED) -> None:
        super().__init__(sentence)
        self.exit_code = exit_code

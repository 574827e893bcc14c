"""Single keys from the terminal, where there is one."""

import os
import select
import sys
import termios
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_LONGEST = 64


@contextmanager
def keys() -> Iterator[Callable[[], str]]:
    """A function that gives the keys pressed since its last call; afterwards the terminal is as before."""
    if not sys.stdin.isatty():
        yield lambda: ""
        return
    terminal = sys.stdin.fileno()
    before = termios.tcgetattr(terminal)
    tty.setcbreak(terminal)
    try:
        yield lambda: _pressed(terminal)
    finally:
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)


def _pressed(terminal: int) -> str:
    ready, _, _ = select.select([terminal], [], [], 0.0)
    return os.read(terminal, _LONGEST).decode(errors="replace") if ready else ""

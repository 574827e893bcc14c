"""The word of a senior node counts when the graph has that node: anybody may publish a claim."""

import time
from collections.abc import Callable

from skydiver_utc.nodes.border import BorderError

# The graph may show a node a moment after its first words.
_SHOWN_WITHIN_S = 2.0
LOOK_AGAIN_PERIOD_S = 0.5


class SeniorsWord:
    """Lets a node leave for a senior that is there; `leave` is told the one sentence why.

    A word that the graph does not confirm is refused; the newest one is looked at again for two seconds.
    """

    def __init__(self, leave: Callable[[str], None]) -> None:
        self._leave = leave
        self._doubted: tuple[str, Callable[[], bool], float] | None = None

    def heed(self, told: str, remedy: str, is_there: Callable[[], bool], kind: str) -> None:
        """Leave for what is told, or raise `BorderError` of this kind where the senior is not there."""
        sentence = f"{told}: {remedy}"
        if is_there():
            self._leave(sentence)
            return
        self._doubted = sentence, is_there, time.monotonic()
        raise BorderError(kind, f"it says that {told}, which the graph does not confirm")

    def look_again(self) -> None:
        """Leave for the senior that was doubted, if by now it is there."""
        if self._doubted is None:
            return
        sentence, is_there, heard_at = self._doubted
        if is_there():
            self._leave(sentence)
        elif time.monotonic() - heard_at < _SHOWN_WITHIN_S:
            return
        self._doubted = None

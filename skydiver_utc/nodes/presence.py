"""Whether the process of another node lives: from the lease that its topic `alive/<kind>` carries. No rclpy here.

Nothing is ever sent on that topic. The middleware renews the lease as long as the process runs, whatever its node
does, so that a node that is silent and a process that is gone are told apart within half a second.
"""

from collections.abc import Callable
from enum import Enum
from typing import Any


class State(Enum):
    """What is known of the process."""

    UNKNOWN = "unknown"  # none has been heard of; a node that is not ours has no such topic
    ALIVE = "alive"
    DIED = "died"
    ENDED = "ended"


_WORDS = {
    State.UNKNOWN: "",
    State.ALIVE: "is alive but silent",
    State.DIED: "has died or stands still",
    State.ENDED: "has ended",
}


class Presence:
    """The processes of one kind of node, by the events of their leases."""

    def __init__(self, kind: str, tell: Callable[[str], object]) -> None:
        self.state = State.UNKNOWN
        self._kind = kind
        self._tell = tell

    def on_change(self, event: Any) -> None:
        """The middleware's count of leases has changed (a liveliness-changed event)."""
        before = self.state
        if event.alive_count > 0:
            self.state = State.ALIVE
        elif event.not_alive_count_change > 0:
            self.state = State.DIED
        elif before is State.ALIVE:
            self.state = State.ENDED
        if self.state is State.DIED:
            self._tell(self.sentence())
        elif before is State.DIED and self.state is State.ALIVE:
            self._tell(f"a process of the {self._kind} is there again")

    def sentence(self) -> str:
        """Why nothing is heard of this node, as far as its process tells; empty where nothing is known."""
        words = _WORDS[self.state]
        return f"the {self._kind}'s process {words}" if words else ""

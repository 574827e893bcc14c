"""Whether an outcome that was heard is that of the flight being recorded: its number of states tells."""

import json
import time
from collections import deque
from collections.abc import Callable

from skydiver_utc.nodes.border import BorderError

# The state that an outcome names as its last is looked for among so many: a stranger's may lie in between.
_NEWEST = 20


class EndOfFlight:
    """Hears the states and the outcomes; `states` is how many the flight had, None before its end is certain.

    An outcome counts when the last state of which it tells is one of the newest heard. Another one is held: the
    last states may have been lost and come again. The next state shows that the flight goes on, and the outcome is
    refused; it counts after `silence_s` without any.
    """

    def __init__(self, silence_s: float, refuse: Callable[[BorderError], object]) -> None:
        self.states: int | None = None
        self._silence_s, self._refuse = silence_s, refuse
        self._newest: deque[int] = deque(maxlen=_NEWEST)
        self._held: tuple[int, int] | None = None  # number of states, and when the outcome was sent
        self._heard_at = time.monotonic()

    def hear_state(self, step: int, sent_at_ns: int) -> None:
        """A state of this step was sent."""
        self._heard_at = time.monotonic()
        self._newest.append(step)
        if self._held is not None and not self._fits(self._held[0]) and sent_at_ns > self._held[1]:
            states, self._held = self._held[0], None
            sentence = f"it tells of {states} states, and the flight goes on at step {step}"
            self._refuse(BorderError("outcome", sentence))

    def hear_outcome(self, text: str, sent_at_ns: int) -> None:
        """An outcome was sent; one that cannot be read is refused."""
        try:
            states = json.loads(text)["states"]
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            sentence = f"it does not tell how many states the flight had ({error!r})"
            self._refuse(BorderError("outcome", sentence))
            return
        if type(states) is not int or states < 0:
            self._refuse(BorderError("outcome", f"it tells of {states!r} states: that is no number of them"))
            return
        self._held, self._heard_at = (states, sent_at_ns), time.monotonic()

    def is_certain(self) -> bool:
        """True from the flight's end on."""
        if self.states is None and self._held is not None:
            silent = time.monotonic() - self._heard_at > self._silence_s
            if silent or self._fits(self._held[0]):
                self.states = self._held[0]
        return self.states is not None

    def _fits(self, states: int) -> bool:
        return states - 1 in self._newest or (states == 0 and not self._newest)

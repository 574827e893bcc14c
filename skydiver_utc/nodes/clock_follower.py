"""Another plant's clock: a step is taken only when `/clock` shows it."""

import time
from collections.abc import Callable, Mapping
from typing import Any

from std_msgs.msg import String

from skydiver_utc.nodes import topics
from skydiver_utc.nodes.border import BorderError
from skydiver_utc.nodes.managed import UNCONFIGURED
from skydiver_utc.nodes.roll_call import Claim
from skydiver_utc.nodes.scenario_node import ScenarioNode
from skydiver_utc.nodes.shared_clock import SIGNS_OF_LIFE, Awaited, ClockSource, read, write


class ClockFollower:
    """The clock of a plant with `clock:=follow`; `moved` is called when it shows something new.

    Before the flight the plant whose clock it is may change; a flight keeps the one that it began with.
    """

    def __init__(self, node: ScenarioNode, moved: Callable[[], None], refuse: Callable[[str], None]) -> None:
        self.k = -1
        self._node, self._moved, self._refuse = node, moved, refuse
        self._lockstep = node.own["mode"] == "lockstep"
        self._patience_s: float = node.own["clock_patience_s"]
        self._source: ClockSource | None = None
        self._trouble = ""
        self._awaited = Awaited(node.get_namespace(), -1)
        self._shown_at = time.monotonic()
        self._awaits = node.advertise(topics.CLOCK_AWAITED)
        self._listener = node.listen(topics.CLOCK, self.on_clock)
        node.listen(topics.CLOCK_SOURCE, self.on_source)
        node.every(self._patience_s / SIGNS_OF_LIFE, self._say_that_it_is_there)

    def on_source(self, message: Any) -> None:
        """A plant that publishes `/clock`: one with other steps or in another mode is not followed."""
        try:
            source = read(message.data, ClockSource)
        except BorderError as error:
            self._node.refusals.add(topics.CLOCK_SOURCE.name, error)
            return
        if source.ended:
            self._source_ends(source)
            return
        grid = self._node.grid
        different = source.differs_from(self._node.own["mode"], grid.dt_ns, grid.epoch_ns)
        in_its_place = self._takes_the_place(source)
        if not different and (in_its_place or self.k < 0):
            self._take(source)
        elif different and in_its_place and not self._flies:
            self._refuse(
                f"it cannot follow the clock of the plant of {source.namespace}: {different}; give both the same"
            )
        else:
            sentence = (
                f"the plant of {source.namespace} has a clock, too; it is {self._whose()} that is followed"
            )
            self._node.refusals.add(topics.CLOCK_SOURCE.name, BorderError("source", sentence))

    def on_clock(self, message: Any) -> None:
        """The clock shows a step; before the plant is configured that is nothing to it."""
        if self._node.lifecycle == UNCONFIGURED:
            return
        try:
            k = self._node.grid.step_of(message.clock)
        except BorderError as error:
            self._node.refusals.add(topics.CLOCK.name, error)
            return
        if k < self.k:
            self._fail(f"the clock went back from step {self.k} to step {k}: its plant was started again")
        elif self._awaited.step <= 0 < k:
            self._fail(
                f"the clock shows step {k} already: a flight begins with its clock, start all plants anew"
            )
        elif self._lockstep and k > self._awaited.step > 0:
            self._fail(
                f"the clock went on without this plant, which waits for step {self._awaited.step}, to step {k}"
            )
        self.k, self._shown_at = k, time.monotonic()
        self._moved()

    def missing(self) -> list[str]:
        """What step 0 still waits for, in words."""
        if self._source is None or self._listener.get_publisher_count() == 0:
            return ["no plant that publishes /clock"]
        return []

    def await_step(self, k: int) -> bool:
        """Say that this plant is ready for step k; True when the clock shows it."""
        if k != self._awaited.step:
            self._awaited = Awaited(self._awaited.namespace, k)
            self._say_that_it_is_there()
        return self.k >= k

    def may_begin_by_the_clock(self, _k: int) -> bool:
        """True: it is the clock that waits."""
        return True

    def show(self, k: int) -> None:
        """The clock is not this plant's."""

    def serve(self, claim: Claim) -> None:
        """Nobody takes the clock from this plant."""

    def trouble(self) -> str:
        """Why the flight cannot go on, empty while the clock does."""
        silent_s = time.monotonic() - self._shown_at
        if not self._trouble and self.k >= 0 and silent_s > self._patience_s:
            self._fail(
                f"the clock of {self._whose()} stands still at step {self.k} for {silent_s:.1f} s: its plant has"
                " stopped or died"
            )
        return self._trouble

    def told(self) -> Mapping[str, object]:
        """Values for the diagnostics."""
        return {"follows": self._whose(), "clock_step": self.k}

    def end(self, done: Callable[[], None], _due: Callable[[], int] | None) -> None:
        """The flight is over: the clock need not wait any more."""
        self.leave()
        done()

    def reset(self) -> None:
        """Be ready for another flight."""
        self._forget_the_clock()
        self._awaited = Awaited(self._awaited.namespace, -1)

    def leave(self) -> None:
        """Say that nothing is waited for any more."""
        self._awaited = Awaited(self._awaited.namespace, self._awaited.step, ended=True)
        self._awaits.publish(String(data=write(self._awaited)))

    @property
    def _flies(self) -> bool:
        return self._node.newest_step() >= 0

    def _takes_the_place(self, source: ClockSource) -> bool:
        """True where `source` is the plant followed so far, or comes before it."""
        own = self._source
        if own is None or own.claim.id == source.claim.id or source.claim.senior_to(own.claim):
            return True
        # One that was killed before the flight says no last word, and is started again where it was.
        return own.namespace == source.namespace and not self._flies

    def _take(self, source: ClockSource) -> None:
        if self._source is not None and self._source.claim.id != source.claim.id and not self._flies:
            self._forget_the_clock()
        self._source = source

    def _source_ends(self, source: ClockSource) -> None:
        if self._source is None or source.claim.id != self._source.claim.id:
            return
        if self._flies:
            self._fail(f"the plant of {source.namespace}, whose clock it follows, has ended")
        else:
            self._forget_the_clock()
            self._source = None

    def _forget_the_clock(self) -> None:
        self.k, self._trouble = -1, ""

    def _whose(self) -> str:
        return "nobody yet" if self._source is None else self._source.namespace

    def _fail(self, sentence: str) -> None:
        self._trouble = self._trouble or sentence

    def _say_that_it_is_there(self) -> None:
        if self._awaited.step >= 0:
            self._awaits.publish(String(data=write(self._awaited)))

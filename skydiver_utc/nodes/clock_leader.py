"""The plant's own clock: it publishes `/clock`, and shows a step only when all who follow wait for it."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from rclpy.node import Node
from rclpy.timer import Timer
from std_msgs.msg import String

from skydiver_utc.nodes import topics
from skydiver_utc.nodes.border import BorderError
from skydiver_utc.nodes.messages import ClockWriter
from skydiver_utc.nodes.roll_call import Claim
from skydiver_utc.nodes.scenario_node import ScenarioNode
from skydiver_utc.nodes.seniors_word import LOOK_AGAIN_PERIOD_S, SeniorsWord
from skydiver_utc.nodes.shared_clock import SIGNS_OF_LIFE, Awaited, ClockSource, read, write


@dataclass
class _Follower:
    awaits: int
    heard_at: float = field(default_factory=time.monotonic)
    flying: bool = True


class ClockLeader:
    """The clock of a plant that follows nobody; without followers nothing is waited for.

    `moved` is called when a follower has said something. Where this plant's flight ends before those of its
    followers, the clock goes on for them.
    """

    def __init__(
        self, node: ScenarioNode, claim: Claim, moved: Callable[[], None], refuse: Callable[[str], None]
    ) -> None:
        self.k = -1
        self._node, self._claim, self._moved = node, claim, moved
        self._senior = SeniorsWord(refuse)
        self._expected: int = node.own["followers"]
        self._patience_s: float = node.own["clock_patience_s"]
        self._recorders = 1 if node.own["wait_for_recorder"] else 0
        self._followers: dict[str, _Follower] = {}
        self._write = ClockWriter(node.grid).fill
        self._clocks = node.advertise(topics.CLOCK)
        self._sources = node.advertise(topics.CLOCK_SOURCE)
        self._shown_at = time.monotonic()
        self._due: Callable[[], int] | None = None
        self._done: Callable[[], None] | None = None
        self._timer: Timer | None = None
        node.listen(topics.CLOCK_SOURCE, self.on_source)
        node.listen(topics.CLOCK_AWAITED, self.on_awaited)
        node.every(self._patience_s / SIGNS_OF_LIFE, self._look_after_followers)
        node.every(LOOK_AGAIN_PERIOD_S, self._senior.look_again)
        self._tell()

    def on_source(self, message: Any) -> None:
        """Another plant says that it publishes `/clock`: the newcomer of two leaves."""
        try:
            self._compare_with(read(message.data, ClockSource))
        except BorderError as error:
            self._node.refusals.add(topics.CLOCK_SOURCE.name, error)

    def _compare_with(self, other: ClockSource) -> None:
        # Two plants of one namespace settle it on its roll call.
        elsewhere = other.namespace != self._node.get_namespace()
        if not elsewhere or other.ended or not other.claim.senior_to(self._claim):
            return
        self._senior.heed(
            f"the plant of {other.namespace} (process {other.claim.pid} on {other.claim.host}) publishes /clock"
            " already",
            "let this one follow it by -p clock:=follow, or give it another ROS domain",
            lambda: _has_plant(self._node, other.namespace),
            "source",
        )

    def on_awaited(self, message: Any) -> None:
        """A follower waits for a step, or has ended."""
        try:
            awaited = read(message.data, Awaited)
        except BorderError as error:
            self._node.refusals.add(topics.CLOCK_AWAITED.name, error)
            return
        follower = self._followers.get(awaited.namespace)
        if self.k < 0:
            self._register(awaited)
        elif follower is not None:
            follower.awaits, follower.heard_at = awaited.step, time.monotonic()
            follower.flying = follower.flying and not awaited.ended
        self._goes_on()

    def _register(self, awaited: Awaited) -> None:
        """Before the flight the newest word of a follower counts, whatever it has said before."""
        if awaited.ended or self._node.done:
            self._followers.pop(awaited.namespace, None)
            return
        if awaited.namespace not in self._followers:
            self._node.get_logger().info(f"the plant of {awaited.namespace} follows this clock")
        self._followers[awaited.namespace] = _Follower(awaited.step)

    def missing(self) -> list[str]:
        """What step 0 still waits for, in words."""
        here = len(self._followers)
        if here < self._expected:
            return [f"{here} of {self._expected} plants that follow the clock"]
        # Of each skydiver the reference and the recorder hear the clock, of a follower the plant, too.
        listeners = here + (1 + here) * (1 + self._recorders) if here else 0
        return (
            ["no listener, or too few, on /clock"]
            if self._clocks.get_subscription_count() < listeners
            else []
        )

    def await_step(self, k: int) -> bool:
        """True when every follower is ready for step k."""
        return all(follower.awaits >= k for follower in self._followers.values() if follower.flying)

    may_begin_by_the_clock = await_step

    def show(self, k: int) -> None:
        """Step k is there."""
        self.k, self._shown_at = k, time.monotonic()
        self._clocks.publish(self._write(k))

    def serve(self, claim: Claim) -> None:
        """A flight has begun: no plant that comes later takes the clock."""
        self._claim = claim
        self._tell()

    def trouble(self) -> str:
        """Why this plant's flight cannot go on: never for want of a clock."""
        return ""

    def told(self) -> Mapping[str, object]:
        """Values for the diagnostics."""
        states = {name: "flying" if of.flying else "ended" for name, of in sorted(self._followers.items())}
        return {"followers": ", ".join(f"{name} {state}" for name, state in states.items())}

    def end(self, done: Callable[[], None], due: Callable[[], int] | None) -> None:
        """The own flight is over: go on for the followers, by the clock where `due` tells its step; then `done`."""
        self._done, self._due = done, due
        if self.k < 0:
            self.leave()
        elif due is not None and self._flying():
            self._timer = self._node.every(self._node.scenario.dt_s, self._goes_on)
        if self._flying() and self.k >= 0:
            self._node.get_logger().info(f"the clock goes on for {', '.join(self._flying())}")
        self._goes_on()

    def reset(self) -> None:
        """Be ready for another flight, and say so."""
        self.k, self._due, self._done = -1, None, None
        self._followers.clear()
        self._end_timer()
        self._tell()

    def _end_timer(self) -> None:
        if self._timer is not None:
            self._node.destroy_timer(self._timer)
            self._timer = None

    def leave(self) -> None:
        """Show no further step, and say so."""
        self._followers.clear()
        self._tell(ended=True)

    def _flying(self) -> list[str]:
        return [name for name, follower in self._followers.items() if follower.flying]

    def _goes_on(self) -> None:
        """Let the plant take its step; after its end show the steps that the followers wait for."""
        if self._done is None:
            self._moved()
            return
        while self._flying() and (self.await_step(self.k + 1) if self._due is None else self._due() > self.k):
            self.show(self.k + 1)
        if not self._flying():
            done, self._done = self._done, lambda: None
            self._end_timer()
            done()

    def _look_after_followers(self) -> None:
        """Say again where the clock stands; go on without a follower that says nothing any more."""
        now = time.monotonic()
        if self.k < 0:
            if not self._node.done:
                # A newcomer's word may have come in between.
                self._tell()
        elif self._flying() and now - self._shown_at > self._patience_s / SIGNS_OF_LIFE:
            self.show(self.k)
        for name in self._flying():
            silent_s = now - self._followers[name].heard_at
            if silent_s > self._patience_s:
                self._lose(name, silent_s)
        if self.k >= 0:
            self._goes_on()

    def _lose(self, name: str, silent_s: float) -> None:
        silence = f"the plant of {name} has said nothing for {silent_s:.1f} s, it has stopped or died"
        if self.k < 0:
            del self._followers[name]
            self._node.get_logger().warning(f"{silence}: it is not waited for")
        else:
            self._followers[name].flying = False
            self._node.get_logger().error(f"{silence}: the clock goes on without it")

    def _tell(self, ended: bool = False) -> None:
        grid, mode = self._node.grid, self._node.own["mode"]
        source = ClockSource(self._claim, self._node.get_namespace(), mode, grid.dt_ns, grid.epoch_ns, ended)
        self._sources.publish(String(data=write(source)))


def _has_plant(node: Node, namespace: str) -> bool:
    """True where the graph has a plant in this namespace, which may be any text."""
    its = f"{'' if namespace == '/' else namespace}/{topics.ALIVE[topics.PLANT].name}"
    return its in dict(node.get_topic_names_and_types()) and node.count_publishers(its) > 0


def too_many_clocks(node: Node) -> str:
    """Who publishes `/clock`, in words, where that is more than one, a player included; else empty."""
    publishers = node.get_publishers_info_by_topic(topics.CLOCK.name)
    if len(publishers) < 2:
        return ""
    names = sorted(f"{of.node_namespace.rstrip('/')}/{of.node_name}" for of in publishers)
    return f"{len(names)} publishers of /clock ({', '.join(names)}): there must be one"

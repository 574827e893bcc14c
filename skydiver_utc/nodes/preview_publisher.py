"""The reference as a node: previews in chunks on the global grid of steps, and the body rate now for plots."""

import time
from collections.abc import Mapping
from typing import Any

from rclpy.context import Context
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from skydiver_utc.nodes import topics
from skydiver_utc.nodes.border import BorderError
from skydiver_utc.nodes.diagnostics import Health, Level
from skydiver_utc.nodes.managed import UNCONFIGURED
from skydiver_utc.nodes.messages import SETPOINT_AXES, SetpointWriter
from skydiver_utc.nodes.presence import State
from skydiver_utc.nodes.preview import PreviewWriter
from skydiver_utc.nodes.scenario_node import ScenarioNode
from skydiver_utc.parameters import Scenario
from skydiver_utc.reference.profiles import ChangingReference, ReferenceProfile
from skydiver_utc.simulation.build import build_reference

_STARTUP_POLL_S = 0.02
_PATIENCE_S = 5.0
# How long a newcomer waits for the plant's claim, by which it knows a flight that goes on: a plant of one's own
# need not make any. Usually it is there sooner; after that a clock heard with best effort tells of the flight, too.
_CLAIM_WAIT_S = 2.0
_CLAIM_USUAL_S = 0.1


class ReferenceNode(ScenarioNode):
    """Publishes a chunk every `chunk_steps` steps of `/clock`; the newest one is latched for late listeners.

    A chunk reaches as far as the scenario's controller looks beyond the next two chunks, so that a controller
    never waits for one that is merely late. What a chunk has told is kept: a change of parameters takes effect at
    the first step that none has told yet.

    One that comes into a flight sends nothing before it has heard the clock: a chunk of other steps would replace
    what the controller still has. The reliable listener to `/clock` may have its first message a second late, and
    then all that were sent meanwhile; until then a newcomer listens with best effort, too.
    """

    def __init__(self, context: Context | None = None, overrides: Mapping[str, object] | None = None) -> None:
        super().__init__("reference", context, overrides)
        self._chunk_steps: int = self.own["chunk_steps"]
        self._count: int = self.scenario.preview_steps + 2 * self._chunk_steps + 1
        self._chunk = self._k = -1
        self._heard_at, self._told_silence = time.monotonic(), False
        signal = self.scenario.reference.signal
        self._write_preview = PreviewWriter(self.grid, signal, self._count).fill
        self._previews = self.advertise(topics.REFERENCE_PREVIEW)
        self._setpoints = self.advertise(topics.SETPOINT)
        self._has_setpoint = signal in SETPOINT_AXES
        if self._has_setpoint:
            self._write_setpoint = SetpointWriter(self.grid, signal).fill
        self._clock_listener = self.listen(topics.CLOCK, self.on_clock)
        self._newest_clock: Subscription | None = None  # best effort, while this node comes into a flight
        self._newest = -1  # the step that it told last
        self._startup: Timer | None = None
        self._clock_found_at = time.monotonic()
        self.start_unless_managed()

    def configure(self) -> None:
        """The profile of the scenario as it is now, from step 0 on."""
        super().configure()
        self._chunk = self._k = self._newest = -1
        self._reference = ChangingReference(self.rebuilt(self.scenario))

    def activate(self) -> None:
        """Follow the clock; after a pause with a preview at once."""
        if self._k < 0:
            self._startup = self.every(_STARTUP_POLL_S, self._begin_when_heard)
        else:
            self._chunk = -1
            self._publish_chunk(self._k // self._chunk_steps)

    def deactivate(self) -> None:
        """Publish nothing."""
        self._end_startup()
        self._end_newest_clock()

    def rebuilt(self, scenario: Scenario) -> ReferenceProfile:
        """The profile of this scenario."""
        return build_reference(scenario)

    def change_is_coming(self) -> None:
        """From the first step on that no preview has told."""
        if self.lifecycle != UNCONFIGURED:
            told = self._chunk * self._chunk_steps + self._count if self._chunk >= 0 else 0
            self._reference.follow(told, self.take_change())
            if self._k >= 0:
                self.tell_change(told)

    def tell_difference(self) -> None:
        """At once in flight; else it is told when one begins."""
        if self._k >= 0:
            self.tell_change(0)

    def on_clock(self, message: Any) -> None:
        """Publish the value at this step, and the next chunk when it is due.

        A plant that waits sends its clock again: the chunk goes out again, too, in case it is the chunk that is
        missing.
        """
        try:
            k = self.grid.step_of(message.clock)
        except BorderError as error:
            self.refusals.add(topics.CLOCK.name, error)
            return
        if self._k < 0:
            self._end_newest_clock()
            self._come_in(k)
            self.serve()
        if self._k < 0 or k < self._k:
            # A flight begins: its bag must tell.
            if self.live.changed:
                self.tell_change(self._reference.changed_at)
            elif self.differs:
                self.tell_change(0)
        if k < self._k:
            self._newest = -1
        repeated = k == self._k
        if not repeated:
            self._k, self._heard_at, self._told_silence = k, time.monotonic(), False
        # After the flight's end the clock goes on for another skydiver.
        if not self.active or k > self.scenario.steps:
            return
        # A chunk older than the newest step known would replace what the controller needs.
        if k >= self._newest and (repeated or k // self._chunk_steps != self._chunk):
            self._publish_chunk(k // self._chunk_steps)
        if self._has_setpoint:
            self._setpoints.publish(self._write_setpoint(k, self._reference.value(k)))

    def on_newest_clock(self, message: Any) -> None:
        """The step of a flight that this node comes into: send its chunk, later those that follow."""
        if self._newest_clock is None:
            return
        try:
            k = self.grid.step_of(message.clock)
        except BorderError as error:
            self.refusals.add(topics.CLOCK.name, error)
            return
        self._newest = k
        self._come_in(k)
        if k <= self.scenario.steps and k // self._chunk_steps != self._chunk:
            self._publish_chunk(k // self._chunk_steps)

    def newest_step(self) -> int:
        """The step of the clock heard last."""
        return self._k

    def health(self) -> Health:
        """Which step the clock shows, and whether it goes on."""
        values = {"step": self._k, "chunk": self._chunk}
        silent_s = time.monotonic() - self._heard_at
        if self._k < 0:
            return Health(Level.OK, "waiting for the clock", values)
        died = self.presences[topics.PLANT].state is State.DIED
        if self._k < self.scenario.steps and (died or silent_s > _PATIENCE_S):
            plant = self.presences[topics.PLANT].sentence() or "the plant waits, has stopped or died"
            sentence = f"the clock stands still after step {self._k}: {plant}"
            if not self._told_silence:
                self._told_silence = True
                self.get_logger().warning(sentence)
            return Health(Level.WARN, sentence, values)
        return Health(Level.OK, "following the clock", values)

    def _begin_when_heard(self) -> None:
        """The first chunk lets the controller begin: it waits until this node hears and is heard.

        A newcomer to a flight begins with the chunk of the clock's step instead.
        """
        if self._clock_listener.get_publisher_count() == 0:
            self._clock_found_at = time.monotonic()
        elif not self._comes_into_flight() and not self.unmatched():
            self._end_startup()
            self._end_newest_clock()
            self._publish_chunk(0)
            self.get_logger().info("ready")

    def _comes_into_flight(self) -> bool:
        """True while the clock of a flight is waited for, or the claim of a plant that would tell of one."""
        waited_s = time.monotonic() - self._clock_found_at
        plant = self.plant_claim
        if plant is not None and (self.serves or not plant.serving):
            return False
        if self._newest_clock is None and (plant is not None or waited_s > _CLAIM_USUAL_S):
            self._newest_clock = self.listen(topics.CLOCK, self.on_newest_clock, qos=topics.NEWEST)
        return waited_s < (_CLAIM_WAIT_S if plant is None else _PATIENCE_S)

    def _come_in(self, k: int) -> None:
        """The clock is heard: nothing more is waited for."""
        if self._startup is not None:
            self._end_startup()
            self.get_logger().info(f"ready: comes in at step {k} of the clock")

    def _end_newest_clock(self) -> None:
        if self._newest_clock is not None:
            self.destroy_subscription(self._newest_clock)
            self._newest_clock = None

    def _end_startup(self) -> None:
        if self._startup is not None:
            self.destroy_timer(self._startup)
            self._startup = None

    def _publish_chunk(self, chunk: int) -> None:
        self._chunk = chunk
        k0 = chunk * self._chunk_steps
        self._previews.publish(self._write_preview(k0, self._reference.preview(k0, self._count)))

# SPDX-License-Identifier: Apache-2.0
"""The reference as a node: previews in chunks on the grid of steps, and the values of each step for plots."""

import time
from typing import Any

from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from skydiver_utc.loop.build import build_plant, build_reference, preview_steps
from skydiver_utc.messages import StepGrid, fill_preview, read_fields
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.diagnostics import Health, Level
from skydiver_utc.nodes.node import ScenarioNode
from skydiver_utc.nodes.stamped_topic import StampedTopic
from skydiver_utc.parameters.nanoseconds import stamp_ns

_PATIENCE_S = 5.0


class ReferenceNode(ScenarioNode):
    """Publishes a chunk every `chunk_steps` steps of the clock; the newest ones are latched for late subscribers.

    A chunk reaches as far as the scenario's controller looks beyond the next two chunks, so that a controller never
    waits for one that is merely late. With a real vehicle the time is that of its states, and step 0 the first one.
    A live reference takes its values from the stick and publishes a chunk with each new one.
    """

    KIND = topics.REFERENCE
    MAIN = topics.REFERENCE_PREVIEW

    def build(self) -> None:
        self._reference = build_reference(self.scenario)
        self._chunk_steps: int = self.settings.chunk_steps
        self._count = preview_steps(self.scenario) + 2 * self._chunk_steps + 1
        self._k, self._chunk, self._received_at = -1, -1, time.monotonic()
        names = list(self._reference.outputs)
        points = [JointTrajectoryPoint() for _ in range(self._count)]
        self._preview = JointTrajectory(joint_names=names, points=points)
        self._previews = self.advertise(topics.REFERENCE_PREVIEW)
        self._setpoints = StampedTopic(self, topics.SETPOINT, names)
        self._scenario_received = False
        if self.settings.mode == "vehicle":
            self.grid = StepGrid(0, self.scenario.dt_ns, exact=False)
            state = topics.STATE.of_plant(build_plant(self.scenario))
            self.subscribe(state, self.on_state, topics.NEWEST)
        else:
            self._clocks = self.subscribe(topics.CLOCK, self.on_clock)
            # After the clock: a plant whose scenario arrives has matched the subscription to its clock, too.
            self._scenarios = self.subscribe(topics.SCENARIO, self.on_scenario)
        if hasattr(self._reference, "receive"):
            self.subscribe(topics.STICK, self.on_stick)

    def configure(self) -> None:
        """From step 0 on."""
        self._k = self._chunk = -1

    def activate(self) -> None:
        """Publish a first chunk, from which the controller can begin, as soon as the plant's clock is received."""
        self.begin_when(self._is_matched, self._begin)

    def on_clock(self, message: Any) -> None:
        """Publish what is due at a step of simulated time."""
        self._on_step(self.grid.step_of(message.clock))

    def on_scenario(self, _: Any) -> None:
        """The plant sends its messages to this node."""
        self._scenario_received = True

    def on_state(self, message: Any) -> None:
        """Publish what is due at the time of a vehicle's state; the first one is step 0."""
        if self.grid.epoch_ns == 0:
            self.grid.epoch_ns = stamp_ns(message.header.stamp)
        self._on_step(self.grid.step_of(message.header.stamp))

    def on_stick(self, message: Any) -> None:
        """Hold the values of a TwistStamped from the next step on."""
        reference: Any = self._reference
        reference.receive(read_fields(message.twist, reference.components))
        if self.active and (self._k >= 0 or self.grid.exact):
            self._publish_chunk(self._k + 1)

    def newest_step(self) -> int:
        return self._k

    def health(self) -> Health:
        values = {"step": self._k, "chunk": self._chunk}
        silent_s = time.monotonic() - self._received_at
        if self._k < 0:
            return Health(Level.OK, "waiting for the clock", values)
        if self._k < self.scenario.steps and silent_s > _PATIENCE_S:
            return Health(Level.WARN, f"no clock after step {self._k} for {silent_s:.1f} s", values)
        return Health(Level.OK, "following the clock", values)

    def _is_matched(self) -> bool:
        """True when no message of the clock will be missed; a plant of one's own may publish no scenario."""
        if self.unmatched():
            return False
        if not self.grid.exact:
            return True
        scenario = self._scenario_received or self._scenarios.get_publisher_count() == 0
        return self._clocks.get_publisher_count() > 0 and scenario

    def _begin(self) -> None:
        if self._k >= 0 or self.grid.exact:
            self._publish_chunk(max(0, self._k) // self._chunk_steps * self._chunk_steps)
        self.get_logger().info("ready")

    def _on_step(self, k: int) -> None:
        """Publish the values of this step, and the chunk when it is due.

        A plant that retransmits its state repeats its clock: the chunk is repeated, too, in case it is missing.
        """
        repeated, self._k, self._received_at = k == self._k, k, time.monotonic()
        if not self.active:
            return
        chunk = k // self._chunk_steps
        if repeated or chunk != self._chunk:
            self._publish_chunk(chunk * self._chunk_steps)
        self._setpoints.publish(k, self._reference.preview(k, 1)[0])

    def _publish_chunk(self, k0: int) -> None:
        self._chunk = k0 // self._chunk_steps
        values = self._reference.preview(k0, self._count)
        self._previews.publish(fill_preview(self._preview, self.grid, k0, values))

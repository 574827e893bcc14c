"""The reference as a node: previews in chunks on the global grid of steps, and the body rate now for plots."""

from collections.abc import Mapping
from typing import Any

from rclpy.context import Context

from skydiver_utc.nodes import topics
from skydiver_utc.nodes.border import BorderError
from skydiver_utc.nodes.messages import SETPOINT_AXES, SetpointWriter
from skydiver_utc.nodes.preview import PreviewWriter
from skydiver_utc.nodes.scenario_node import ScenarioNode
from skydiver_utc.simulation.build import build_reference

_STARTUP_POLL_S = 0.02


class ReferenceNode(ScenarioNode):
    """Publishes a chunk every `chunk_steps` steps of `/clock`; the newest one is latched for late listeners.

    A chunk reaches as far as the scenario's controller looks beyond the next two chunks, so that a controller
    never waits for one that is merely late.
    """

    def __init__(self, context: Context | None = None, overrides: Mapping[str, object] | None = None) -> None:
        super().__init__("reference", context, overrides)
        self._reference = build_reference(self.scenario)
        self._chunk_steps: int = self.own["chunk_steps"]
        self._count: int = self.scenario.preview_steps + 2 * self._chunk_steps + 1
        self._chunk = -1
        self._write_preview = PreviewWriter(self.grid, self._reference.signal, self._count).fill
        self._previews = self.advertise(topics.REFERENCE_PREVIEW)
        self._setpoints = self.advertise(topics.SETPOINT)
        self._has_setpoint = self._reference.signal in SETPOINT_AXES
        if self._has_setpoint:
            self._write_setpoint = SetpointWriter(self.grid, self._reference.signal).fill
        self._clock_listener = self.listen(topics.CLOCK, self.on_clock)
        self._startup = self.every(_STARTUP_POLL_S, self._begin_when_heard)

    def on_clock(self, message: Any) -> None:
        """Publish the value at this step, and the next chunk when it is due."""
        try:
            k = self.grid.step_of(message.clock)
        except BorderError as error:
            self.refusals.add(topics.CLOCK.name, error)
            return
        self._publish_chunk(k // self._chunk_steps)
        if self._has_setpoint:
            self._setpoints.publish(self._write_setpoint(k, self._reference.value(k)))

    def _begin_when_heard(self) -> None:
        """The first chunk lets the controller begin: it waits until this node hears and is heard."""
        if self._clock_listener.get_publisher_count() > 0 and not self.unmatched():
            self.destroy_timer(self._startup)
            if self._chunk < 0:
                self._publish_chunk(0)
            self.get_logger().info("ready")

    def _publish_chunk(self, chunk: int) -> None:
        if chunk == self._chunk:
            return
        self._chunk = chunk
        k0 = chunk * self._chunk_steps
        self._previews.publish(self._write_preview(k0, self._reference.preview(k0, self._count)))

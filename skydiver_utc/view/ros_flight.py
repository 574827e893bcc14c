# SPDX-License-Identifier: Apache-2.0
"""A flight over ROS as a page shows and changes it."""

from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.utc.unscented_transform_controller import UnscentedTransformController
from skydiver_utc.disturbances.air import in_moving_air
from skydiver_utc.disturbances.protocol import STILL_AIR
from skydiver_utc.loop.build import (
    build_compiled_controller,
    build_disturbances,
    build_reference,
    model_beside,
)
from skydiver_utc.loop.tuned_scenario import TunedScenario
from skydiver_utc.nodes.observed_run import ObservedRun
from skydiver_utc.parameters import leaves, override
from skydiver_utc.view.charts import Instant, Signals
from skydiver_utc.view.gusts import Gusts
from skydiver_utc.view.live_flight import look_ahead

_MOST_ROWS = 300  # ten seconds of frames


class RosFlight:
    """The newest messages of a run; its time is the run's own, whatever the page's speed.

    The controller of its scenario predicts here from the newest state and applied command, and draws its sigma points
    by the standard deviations of the newest telemetry.
    """

    def __init__(self, node: ObservedRun) -> None:
        self._node = node
        self.name, self.plant, self.tracked = node.namespace, node.plant, node.tracked
        self.ended = ""
        self.gusts, self._gust, self._paused = Gusts(node.plant), STILL_AIR, False
        self._disturbance = build_disturbances(node.scenario, node.plant)
        self._rows: deque[Array] = deque(maxlen=_MOST_ROWS)
        in_force = node.controller_parameters()
        self.changes: tuple[str, ...] = ("controller",) if in_force else ()
        self.scenario = override(node.scenario, in_force)
        self._model, self._reference = model_beside(node.plant, node.scenario), build_reference(node.scenario)
        self._controller = build_compiled_controller(self.scenario, self._model, self._reference)
        self.signals = Signals(node.plant, node.tracked, self._controller.telemetry_names)

    def advance(self, seconds: float) -> None:
        """Keep the signals of this instant, and send what a gust has changed since the last one."""
        row = self.signals.row(self.now())
        if self._rows and row[0] < self._rows[-1][0]:
            self._rows.clear()
            self.gusts.reset()
            self._gust = STILL_AIR
        if not self._rows or row[0] > self._rows[-1][0]:
            self._rows.append(row)
        wind, state = self.gusts.wind(self._node.k), self._node.state
        if (wind != self._gust).any():
            pushed = in_moving_air(state, wind, self._gust, 0.0) - state
            self._node.push(dict(zip(self.plant.state_names[7:10], pushed[7:10].tolist(), strict=True)))
            self._gust = wind
        self.ended = "the flight has ended" if self._node.ended else ""

    def change(self, values: Mapping[str, Any]) -> None:
        """Set parameters of the controller node. Raises `ParameterError` where it refuses them."""
        scenario = override(self.scenario, values)
        new = {leaf.name: leaf.value for leaf in leaves(scenario)}
        self._node.set_controller(TunedScenario(self.scenario, 0).news(new))
        self.scenario = scenario
        self._controller = build_compiled_controller(scenario, self._model, self._reference)

    def pause(self, paused: bool) -> None:
        """Let the run stand still, or go on where it stands. Raises `ParameterError` where the plant refuses."""
        if paused or self._paused:
            self._paused = False
            self._node.pause(paused)
            self._paused = paused

    def blow(self) -> None:
        """Let a gust begin now: as pushes of the velocity relative to the air."""
        self.gusts.blow(self._node.k)

    def reset(self) -> None:
        """Reset the body's state; the run goes on. Raises `ParameterError` where the plant refuses."""
        self._node.reset()
        self.gusts.reset()
        self._gust = STILL_AIR

    def push(self, name: str, by: float) -> None:
        """Change one state at the plant's next step."""
        self._node.push({name: by})

    def now(self) -> Instant:
        """The newest instant."""
        node = self._node
        return Instant(
            time_s=node.k * node.scenario.dt_s,
            state=node.state,
            applied=node.applied,
            reference=node.reference,
            wind=self._disturbance.wind(node.k) + self._gust,
            telemetry=node.telemetry,
        )

    def history(self) -> Array:
        """Rows of the signals (R, columns) of the last seconds."""
        return np.array(self._rows).reshape(-1, self.signals.count)

    def look_ahead(self, seconds: float = 0.0) -> tuple[Array, Array]:
        """States (S, steps + 1, n) to the horizon, or further, and what the actuators then hold (S, a)."""
        k, now, controller = self._node.k, self.now(), self._controller
        control = now.applied[: len(self.plant.control_names)]
        if isinstance(controller, UnscentedTransformController):
            deviations = self.signals.deviations(now)
            controller.reset(control, np.diag(deviations**2) if np.isfinite(deviations).all() else None)
            controller.explain(now.state, self._reference.preview(k, controller.preview_steps + 1))
        return look_ahead(controller, self._model, self._reference, k, now.state, control, seconds)

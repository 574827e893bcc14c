# SPDX-License-Identifier: Apache-2.0
"""A flight over ROS as a page shows it."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.loop.build import build_disturbances
from skydiver_utc.nodes.observed_run import ObservedRun
from skydiver_utc.view.live_signals import Instant, Signals

Array = NDArray[np.float64]
_MOST_ROWS = 300  # ten seconds of frames


class RosFlight:
    """The newest messages of a run; its time is the run's own, whatever the page's speed."""

    def __init__(self, node: ObservedRun) -> None:
        self._node = node
        self.name, self.plant, self.tracked = node.namespace, node.plant, node.tracked
        self.signals, self.ended = Signals(node.plant, node.tracked, deviates=True), ""
        self._disturbance = build_disturbances(node.scenario, node.plant)
        self._rows: deque[Array] = deque(maxlen=_MOST_ROWS)

    def advance(self, seconds: float) -> None:
        """Keep the signals of this instant."""
        row = self.signals.row(self.now())
        if self._rows and row[0] < self._rows[-1][0]:
            self._rows.clear()
        if not self._rows or row[0] > self._rows[-1][0]:
            self._rows.append(row)
        self.ended = "the flight has ended" if self._node.ended else ""

    def now(self) -> Instant:
        """The newest instant."""
        node, telemetry = self._node, self._node.telemetry
        return Instant(
            time_s=node.k * node.scenario.dt_s,
            state=node.state,
            applied=node.applied,
            reference=node.reference,
            wind=self._disturbance.wind(node.k),
            deviations=np.array([telemetry.get(f"std_{name}", np.nan) for name in self.plant.control_names]),
            solve_time_s=telemetry.get("solve_time", np.nan),
        )

    def history(self) -> Array:
        """Rows of the signals (R, columns) of the last seconds."""
        return np.array(self._rows).reshape(-1, self.signals.count)

    def look_ahead(self, seconds: float = 0.0) -> tuple[Array, Array]:
        """Nothing: the controller flies in another process."""
        return np.empty((0, 1, len(self._node.state))), np.empty((0, len(self._node.applied)))

# SPDX-License-Identifier: Apache-2.0
"""A recorded run as a page plays it."""

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters import ParameterError
from skydiver_utc.view.charts import Instant, Signals

_MOST_ROWS = 1500


class RecordedFlight:
    """A run at a time that moves on with `advance` and jumps with `seek`; begins_s, ends_s: its first and last time.

    Raises `ParameterError` for a run without a step.
    """

    def __init__(self, run: Run, name: str) -> None:
        self._present = np.flatnonzero(np.isfinite(run.states).all(axis=1))
        if not (len(self._present) and len(run.commands)):
            raise ParameterError(f"{name} has no step to show: {run.reason or 'no state was recorded'}")
        self.name, self.plant, self.tracked = name, run.plant, run.tracked_names
        self.begins_s, self.ends_s, self.ended = float(run.time_s[0]), float(run.time_s[-1]), ""
        self._run, self._time_s = run, self.begins_s
        columns = [i for i, name in enumerate(run.disturbance_names) if name.startswith("wind_")]
        self._wind = np.nan_to_num(run.disturbance[:, columns]) if columns else np.zeros((len(run.states), 3))
        self.signals = Signals(run.plant, run.tracked_names, run.telemetry_names)
        every = max(1, len(run.commands) // _MOST_ROWS)
        self._rows = np.array([self.signals.row(self._at(i)) for i in self._present[::every]])

    def advance(self, seconds: float) -> None:
        """Play on, up to the end."""
        self.seek(self._time_s + seconds)

    def seek(self, time_s: float) -> None:
        """Go to a time of the run."""
        self._time_s = min(max(time_s, self.begins_s), self.ends_s)
        self.ended = self._run.reason if self._time_s == self.ends_s else ""

    def now(self) -> Instant:
        """The instant of the newest recorded state until now."""
        row = round((self._time_s - self.begins_s) / self._run.scenario.dt_s)
        until = self._present[self._present <= row]
        return self._at(int(until[-1]) if len(until) else row)

    def history(self) -> Array:
        """Rows of the signals (R, columns) until now."""
        return self._rows[: np.searchsorted(self._rows[:, 0], self._time_s, side="right")]

    def look_ahead(self, seconds: float = 0.0) -> tuple[Array, Array]:
        """Nothing, S = 0: a recording has no controller."""
        return np.empty((0, 1, len(self.plant.state_names))), np.empty((0, len(self.plant.initial_applied())))

    def _at(self, i: int) -> Instant:
        """The instant of a row; the last state has the control of the step before."""
        run, step = self._run, max(0, min(i, len(self._run.commands) - 1))
        telemetry = dict(zip(run.telemetry_names, run.telemetry[step].tolist(), strict=True))
        applied = self.plant.initial_applied()
        applied[: run.applied.shape[1]] = run.applied[step]
        return Instant(
            time_s=float(run.time_s[i]),
            state=run.states[i],
            applied=applied,
            reference=run.reference[i],
            wind=self._wind[i],
            telemetry=telemetry | {"solve_time": float(run.solve_time_s[step])},
        )

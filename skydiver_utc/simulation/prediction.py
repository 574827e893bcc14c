"""What UTC's sigma points do to the skydiver over the horizon: the plant, and the dynamics assumed for alpha."""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.jit import kernel
from skydiver_utc.parameters import UtcParameters
from skydiver_utc.plant.dynamics import STATE_SIZE, WORK_SIZE, limit_control, rk4_step
from skydiver_utc.plant.model import PlantModel

Array = NDArray[np.float64]

_ALPHA_DYNAMICS = {"unknown": 0, "incremental": 1, "positional": 2}
_SAVED = {"drawn": 0, "first_step": 1, "horizon": 2}


class SkydiverPrediction:
    """The predict function of the skydiver's UTC; the output is the yaw rate at the horizon, l = 1."""

    def __init__(self, model: PlantModel, parameters: UtcParameters) -> None:
        self._model = model
        self._steps = parameters.horizon_steps
        self._dynamics = _ALPHA_DYNAMICS[parameters.alpha_dynamics]
        self._saved = _SAVED[parameters.saved_control_reading]
        self._gains = (parameters.K_p, parameters.K_FF)
        self._tau = round(parameters.tau_s / model.dt)
        self.preview_steps = self._steps + self._tau
        self._work = np.empty(WORK_SIZE + STATE_SIZE + 8)
        self.reset()

    def reset(self) -> None:
        """Forget the yaw rate and reference of the step before."""
        self._before: tuple[float, float, float] | None = None

    def __call__(
        self, state: Array, applied: Array, points: Array, preview: Array, outputs: Array, saved: Array
    ) -> None:
        """See `skydiver_utc.control.utc.Predict`; preview starts at the step of `state`."""
        ahead = float(preview[self._tau])
        now = (float(preview[0]), ahead, float(state[12]))
        before = now if self._before is None else self._before
        propagate(
            self._model, state, applied, points, preview, before, self._steps, self._tau,
            self._dynamics, self._saved, self._gains, outputs, saved, self._work,
        )  # fmt: skip
        self._before = now


@kernel
def propagate(
    model: PlantModel,
    state: Array,
    applied: Array,
    points: Array,
    preview: Array,
    before: tuple[float, float, float],
    steps: int,
    tau: int,
    dynamics: int,
    save: int,
    gains: tuple[float, float],
    outputs: Array,
    saved: Array,
    work: Array,
) -> None:
    """Drive the plant with each sigma point (2m+1, 4) over the horizon.

    `before` holds the reference, the reference tau ahead and the yaw rate, all of one step ago [rad/s].
    Writes the yaw rates at the horizon to outputs (2m+1, 1) and U^i to saved (2m+1, 4).
    """
    x, wanted, control = work[:STATE_SIZE], work[STATE_SIZE : STATE_SIZE + 4], work[STATE_SIZE + 4 : STATE_SIZE + 8]
    scratch = work[STATE_SIZE + 8 :]
    for i in range(points.shape[0]):
        x[:] = state
        wanted[:] = points[i]
        control[:] = applied
        rate_before = before[2]
        if save == 0:
            saved[i, :] = points[i]
        for j in range(steps):
            if dynamics == 1:
                r_before = preview[j - 1] if j > 0 else before[0]
                ahead_before = preview[j + tau - 1] if j > 0 else before[1]
                base = points[i, 3] if j == 0 else control[3]
                wanted[3] = (
                    base
                    + gains[0] * (preview[j] - r_before)
                    - gains[0] * (x[12] - rate_before)
                    + gains[1] * (preview[j + tau] - ahead_before)
                )
                rate_before = x[12]
            elif dynamics == 2:
                wanted[3] = gains[0] * (preview[j] - x[12]) + gains[1] * preview[j + tau]
            limit_control(model, wanted, control, control)
            if save == 1 and j == 0:
                saved[i, :] = control
            rk4_step(model, x, control, x, scratch)
        if save == 2:
            saved[i, :] = control
        outputs[i, 0] = x[12]

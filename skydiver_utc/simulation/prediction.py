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
    """The predict function of the skydiver's UTC.

    Outputs at the horizon: the tracked body rate, and where the parameters ask for them roll rate and fall rate.
    """

    def __init__(self, model: PlantModel, parameters: UtcParameters, tracked: int) -> None:
        self._model = model
        self._tracked = tracked
        self._steps = parameters.horizon_steps
        self._with_roll_rate = parameters.P_err_roll_rate > 0.0
        self._with_fall_rate = parameters.P_err_fall_rate > 0.0
        self._dynamics = _ALPHA_DYNAMICS[parameters.alpha_dynamics]
        self._saved = _SAVED[parameters.saved_control_reading]
        self._gains = (parameters.K_p, parameters.K_FF)
        self._tau = parameters.tau_steps(model.dt)
        self._measured = parameters.first_increment_reading == "measured"
        self._work = np.empty(WORK_SIZE + STATE_SIZE + 8)
        self.reset()

    def reset(self) -> None:
        """Forget the rate measured last."""
        self._measured_before: float | None = None

    def __call__(
        self, state: Array, applied: Array, points: Array, preview: Array, outputs: Array, saved: Array
    ) -> None:
        """See `skydiver_utc.control.utc.Predict`; preview starts at the step of `state`."""
        rate = float(state[self._tracked])
        rate_before = rate if self._measured_before is None else self._measured_before
        if self._measured:
            self._measured_before = rate
        propagate(
            self._model, state, applied, points, preview, rate_before, self._steps, self._tau,
            self._dynamics, self._saved, self._gains, self._tracked, self._with_roll_rate, self._with_fall_rate,
            outputs, saved, self._work,
        )  # fmt: skip


@kernel
def fall_rate(state: Array) -> float:
    """Downward speed in the world [m/s]."""
    qx, qy, qz, qw = state[3], state[4], state[5], state[6]
    up_x, up_y, up_z = 2 * (qx * qz - qy * qw), 2 * (qy * qz + qx * qw), 1 - 2 * (qx * qx + qy * qy)
    downwards: float = -(up_x * state[7] + up_y * state[8] + up_z * state[9])
    return downwards


@kernel
def propagate(
    model: PlantModel,
    state: Array,
    applied: Array,
    points: Array,
    preview: Array,
    first_rate_before: float,
    steps: int,
    tau: int,
    dynamics: int,
    save: int,
    gains: tuple[float, float],
    tracked: int,
    with_roll_rate: bool,
    with_fall_rate: bool,
    outputs: Array,
    saved: Array,
    work: Array,
) -> None:
    """Drive the plant with each sigma point (2m+1, 4) over the horizon.

    On [t_k+j, t_k+j+1) the dynamics of alpha take the reference at k+j+1 and the tracked rate at k+j, the newest
    that is known when the control is set; `first_rate_before` stands for the tracked rate at k-1 [rad/s].
    Writes the tracked rate, roll rate [rad/s] and fall rate [m/s] at the horizon to outputs (2m+1, l) and U^i to
    saved (2m+1, 4).
    """
    K_p, K_FF = gains
    x, wanted, control = (
        work[:STATE_SIZE],
        work[STATE_SIZE : STATE_SIZE + 4],
        work[STATE_SIZE + 4 : STATE_SIZE + 8],
    )
    scratch = work[STATE_SIZE + 8 :]
    for i in range(points.shape[0]):
        x[:] = state
        wanted[:] = points[i]
        control[:] = applied
        rate_before = first_rate_before
        if save == 0:
            saved[i, :] = points[i]
        for j in range(steps):
            ahead = j + 1 + tau
            if dynamics == 1:
                own = points[i, 3] if j == 0 else control[3]
                wanted[3] = (
                    own
                    + K_p * (preview[j + 1] - preview[j])
                    - K_p * (x[tracked] - rate_before)
                    + K_FF * (preview[ahead] - preview[ahead - 1])
                )
                rate_before = x[tracked]
            elif dynamics == 2:
                wanted[3] = K_p * (preview[j + 1] - x[tracked]) + K_FF * preview[ahead]
            limit_control(model, wanted, control, control)
            if save == 1 and j == 0:
                saved[i, :] = control
            rk4_step(model, x, control, x, scratch)
        if save == 2:
            saved[i, :] = control
        outputs[i, 0] = x[tracked]
        if with_roll_rate:
            outputs[i, 1] = x[10]
        if with_fall_rate:
            outputs[i, outputs.shape[1] - 1] = fall_rate(x)

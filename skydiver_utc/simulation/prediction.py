"""What UTC's sigma points do to the skydiver over the horizon: the plant, and the dynamics assumed for alpha."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control import utc_square_root, utc_step
from skydiver_utc.control.utc_memory import Rules, memory
from skydiver_utc.jit import kernel
from skydiver_utc.parameters import UtcParameters
from skydiver_utc.plant.dynamics import STATE_SIZE, WORK_SIZE, limit_control, rk4_step
from skydiver_utc.plant.model import PlantModel

Array = NDArray[np.float64]

_ALPHA_DYNAMICS = {"unknown": 0, "incremental": 1, "positional": 2}
_SAVED = {"drawn": 0, "first_step": 1, "horizon": 2}


class Assumed(NamedTuple):
    """What the prediction assumes of alpha (`_ALPHA_DYNAMICS`, `_SAVED`) and which outputs it gives, as numbers."""

    steps: int
    tau: int
    dynamics: int
    save: int
    K_p: float
    K_FF: float
    tracked: int
    with_roll_rate: bool
    with_fall_rate: bool
    drawn_to_rest: tuple[bool, ...]


class SkydiverPrediction:
    """The predict function of the skydiver's UTC.

    Outputs at the horizon: the tracked body rate, and where the parameters ask for them roll rate, fall rate, and
    controls, whose reference is their rest.
    """

    def __init__(self, model: PlantModel, parameters: UtcParameters, tracked: int) -> None:
        self._model = model
        self._tracked = tracked
        self._assumed = Assumed(
            steps=parameters.horizon_steps,
            tau=parameters.tau_steps(model.dt),
            dynamics=_ALPHA_DYNAMICS[parameters.alpha_dynamics],
            save=_SAVED[parameters.saved_control_reading],
            K_p=parameters.K_p,
            K_FF=parameters.K_FF,
            tracked=tracked,
            with_roll_rate=parameters.P_err_roll_rate > 0.0,
            with_fall_rate=parameters.P_err_fall_rate > 0.0,
            drawn_to_rest=tuple(variance > 0.0 for variance in parameters.P_rest),
        )
        self._plain = (tuple(self._model), tuple(self._assumed))
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
        propagate(
            self._model, self._assumed, state, applied, points, preview, self._rate_before(state),
            outputs, saved, self._work,
        )  # fmt: skip

    def whole_step(
        self, rules: Rules, block: Array, state: Array, preview: Array, reference: Array, Qu: Array
    ) -> tuple[int, int, int, float]:
        """See `skydiver_utc.control.utc.WholeStep`."""
        compiled = whole_step_in_square_root_form if rules.square_root else whole_step
        return compiled(
            self._plain,
            tuple(rules),
            block,
            state,
            preview,
            self._rate_before(state),
            reference,
            Qu,
            self._work,
        )

    def _rate_before(self, state: Array) -> float:
        """The tracked rate that stands for that at k-1 [rad/s]."""
        rate = float(state[self._tracked])
        before = rate if self._measured_before is None else self._measured_before
        if self._measured:
            self._measured_before = rate
        return before


@kernel
def fall_rate(state: Array) -> float:
    """Downward speed in the world [m/s]."""
    qx, qy, qz, qw = state[3], state[4], state[5], state[6]
    up_x, up_y, up_z = 2 * (qx * qz - qy * qw), 2 * (qy * qz + qx * qw), 1 - 2 * (qx * qx + qy * qy)
    downwards: float = -(up_x * state[7] + up_y * state[8] + up_z * state[9])
    return downwards


@kernel
def whole_step(
    model_and_assumed: tuple[tuple[Any, ...], tuple[Any, ...]],
    rules_values: tuple[Any, ...],
    block: Array,
    state: Array,
    preview: Array,
    rate_before: float,
    reference: Array,
    Qu: Array,
    work: Array,
) -> tuple[int, int, int, float]:
    """A UTC step of the skydiver in one compiled call.

    Plain tuples of the fields of `PlantModel`, `Assumed` and `Rules`: numba takes them in a quarter of the time.
    """
    model, assumed = PlantModel(*model_and_assumed[0]), Assumed(*model_and_assumed[1])
    rules = Rules(*rules_values)
    own = memory(block, rules.m, rules.outputs)
    repaired = utc_step.draw(rules, own)
    propagate(
        model, assumed, state, own.control, own.points, preview, rate_before, own.outputs, own.saved, work
    )  # fmt: skip
    return utc_step.move(rules, own, reference, Qu, repaired)


@kernel
def whole_step_in_square_root_form(
    model_and_assumed: tuple[tuple[Any, ...], tuple[Any, ...]],
    rules_values: tuple[Any, ...],
    block: Array,
    state: Array,
    preview: Array,
    rate_before: float,
    reference: Array,
    Qu: Array,
    work: Array,
) -> tuple[int, int, int, float]:
    """The same with control/utc_square_root.py."""
    model, assumed = PlantModel(*model_and_assumed[0]), Assumed(*model_and_assumed[1])
    rules = Rules(*rules_values)
    own = memory(block, rules.m, rules.outputs)
    repaired = utc_square_root.draw(rules, own)
    propagate(
        model, assumed, state, own.control, own.points, preview, rate_before, own.outputs, own.saved, work
    )  # fmt: skip
    return utc_square_root.move(rules, own, reference, Qu, repaired)


@kernel
def propagate(
    model: PlantModel,
    assumed: Assumed,
    state: Array,
    applied: Array,
    points: Array,
    preview: Array,
    first_rate_before: float,
    outputs: Array,
    saved: Array,
    work: Array,
) -> None:
    """Drive the plant with each sigma point (2m+1, 4) over the horizon.

    On [t_k+j, t_k+j+1) the dynamics of alpha take the reference at k+j+1 and the tracked rate at k+j, the newest
    that is known when the control is set; `first_rate_before` stands for the tracked rate at k-1 [rad/s].
    Writes the tracked rate, roll rate [rad/s] and fall rate [m/s] at the horizon and the controls that are drawn to
    rest to outputs (2m+1, l), and U^i to saved (2m+1, 4).
    """
    K_p, K_FF, dynamics, save, tracked = (
        assumed.K_p,
        assumed.K_FF,
        assumed.dynamics,
        assumed.save,
        assumed.tracked,
    )
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
        for j in range(assumed.steps):
            ahead = j + 1 + assumed.tau
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
        column = 1
        if assumed.with_roll_rate:
            outputs[i, column] = x[10]
            column += 1
        if assumed.with_fall_rate:
            outputs[i, column] = fall_rate(x)
            column += 1
        for a in range(4):
            if assumed.drawn_to_rest[a]:
                outputs[i, column] = saved[i, a]
                column += 1

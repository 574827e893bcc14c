"""The Unscented Transform Controller for a plant that is given as a function: the library's front door."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skydiver_utc.control import arguments, plant_functions
from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.control.plant_functions import ControlDynamics, Output, Plant
from skydiver_utc.control.protocol import Status
from skydiver_utc.control.result import UtcResult, limits_met, lost_in_words
from skydiver_utc.control.roll_out import RollOut
from skydiver_utc.control.utc import UtcLaw
from skydiver_utc.control.utc_step import Recovery

Array = NDArray[np.float64]


class UnscentedTransformController:
    """Moves a control (m,) so that the plant's output (l,) at the horizon meets a reference.

    plant: plant(state (n,), control (m,), dt) -> state one step later, or plant(state, control, dt, out) that
        writes it; plain Python or jitted by numba (then the whole prediction is compiled)
    output: output(state) -> outputs (l,), or one number; None: the whole state
    state: a state (n,) that the plant can start from, used to check the functions, and to compile them
    control: initial control (m,), to which `reset` returns
    dt: length of one step, in the unit of the plant
    horizon: steps N to the point at which the output is predicted; of several, rising, each is tracked
    minimum, maximum, rate: bounds of each control and of its change per unit of time; one number for all or (m,)
    P_err: covariance of the tracking error: a variance, variances (l,) or a matrix (l, l); small is accurate
    W0: weight of the central sigma point, below 1
    Pu: initial covariance of the control, given like P_err; None: (a tenth of each control's range) squared
    Qu: what is added to Pu in each step, given like P_err; None: Qu_ratio times the initial Pu
    control_dynamics: control_dynamics(point, control, state, preview, j) -> control on step j of the horizon, where
        point is the sigma point, control that of the step before (for j = 0 the one now applied) and preview[j] the
        reference at step j; U^i of eq:xpred is then the control on the first step. None: the sigma point is held
    rest, P_rest: where each control is drawn to, one number or (m,), and the variance of its distance from there,
        inf for a control that is free. Such controls are further outputs, whose reference is rest. None: the
        initial control, and no control is drawn
    leak: share of Pu that is forgotten after each step, so that directions no output sees settle at Qu / leak
    square_root: keep a factor S of Pu = S S' and move that on; Qu should then have no negative eigenvalues
    iterations: how often the update is done, each time with sigma points from where it has led; for outputs that
        bend much within the spread of Pu. Costs as many predictions; takes W0 >= 0, and not square_root
    covariance_floor: smallest eigenvalue that the repair of Pu leaves; None: 1e-9 of the smallest initial variance
    """

    def __init__(
        self,
        plant: Plant,
        output: Output | None = None,
        *,
        state: ArrayLike,
        control: ArrayLike,
        dt: float,
        horizon: int | Sequence[int],
        minimum: ArrayLike | None = None,
        maximum: ArrayLike | None = None,
        rate: ArrayLike | None = None,
        P_err: ArrayLike = 1e-4,
        W0: float = 0.25,
        Pu: ArrayLike | None = None,
        Qu: ArrayLike | None = None,
        Qu_ratio: float = 0.1,
        control_dynamics: ControlDynamics | None = None,
        rest: ArrayLike | None = None,
        P_rest: ArrayLike | None = None,
        leak: float = 0.0,
        square_root: bool = False,
        iterations: int = 1,
        covariance_floor: float | None = None,
    ) -> None:
        start = np.atleast_1d(arguments.numbers("state", state))
        self._initial_control = np.atleast_1d(arguments.numbers("control", control))
        for name, array in (("state", start), ("control", self._initial_control)):
            if array.ndim != 1 or array.size == 0:
                raise ValueError(f"{name} has shape {array.shape}; it must be a vector.")
        self._n, m = len(start), len(self._initial_control)
        dt = arguments.number("dt", dt, above=0.0)
        self._limits = _limits(minimum, maximum, rate, self._initial_control, dt)
        self._steps = _horizon(horizon)
        output = _same if output is None else output
        self._l = plant_functions.outputs(plant, output, start, self._initial_control, dt)
        drawn, self._rest, P_rest_drawn = _rest(rest, P_rest, self._initial_control, self._limits)
        self._of_plant = self._l * len(self._steps)
        l_all = self._of_plant + len(drawn)
        preview = np.zeros((self._steps[-1] + 1, self._l))
        if control_dynamics is not None:
            plant_functions.try_dynamics(control_dynamics, self._initial_control, start, preview)

        P_err = arguments.positive_definite("P_err", P_err, self._l, "outputs")
        P_err_all = np.diag(np.concatenate([np.zeros(self._of_plant), P_rest_drawn]))
        P_err_all[: self._of_plant, : self._of_plant] = np.kron(np.eye(len(self._steps)), P_err)
        self._initial_Pu = _initial_Pu(Pu, self._limits, m)
        if Qu is None:
            self._Qu = arguments.number("Qu_ratio", Qu_ratio, least=0.0) * self._initial_Pu
        else:
            self._Qu = arguments.covariance("Qu", Qu, m, "controls")
        floor = 1e-9 * float(np.diag(self._initial_Pu).min())
        if covariance_floor is not None:
            floor = arguments.number("covariance_floor", covariance_floor, least=0.0)

        self._roll_out = RollOut(
            plant, output, control_dynamics, self._steps, dt, self._limits, self._n, self._l, drawn
        )
        self._law = UtcLaw(
            self._roll_out,
            self._limits,
            P_err_all,
            arguments.number("W0", W0, below=1.0),
            covariance_floor=floor,
            leak=arguments.number("leak", leak, least=0.0, below=1.0),
            square_root=arguments.flag("square_root", square_root),
            iterations=_iterations(iterations, W0, square_root),
        )
        points = np.tile(self._initial_control, (2 * m + 1, 1))
        self._roll_out.check(
            start, self._initial_control, points, preview,
            np.empty((2 * m + 1, l_all)), np.empty((2 * m + 1, m)),
        )  # fmt: skip
        self.reset()

    def reset(self, control: ArrayLike | None = None, Pu: ArrayLike | None = None) -> None:
        """Start again from the initial control and covariance, or warm from others."""
        m = len(self._initial_control)
        if control is None:
            start = self._initial_control
        else:
            start = arguments.vector("control", control, m, "controls")
            arguments.bounds(self._limits.minimum, self._limits.maximum, start)
        self._law.reset(start, self._initial_Pu if Pu is None else _given_Pu(Pu, m))

    @property
    def control(self) -> Array:
        """The control now in force (m,), a copy."""
        return self._law.control.copy()

    @property
    def Pu(self) -> Array:
        """The covariance of the control now (m, m), a copy."""
        return self._law.covariance.copy()

    @property
    def jitted(self) -> bool:
        """Whether the prediction is compiled."""
        return self._roll_out.jitted

    def step(self, state: ArrayLike, reference: ArrayLike, *, Qu: ArrayLike | None = None) -> UtcResult:
        """The control to apply until the next step.

        state: (n,), as measured now
        reference: the output wanted at the horizon, (l,) or one number; or a preview (N+1, l) whose row j is wanted
            j steps from now, of which the rows at the steps of the horizon are tracked
        Qu: what is added to Pu in this step instead of the usual (m, m)

        A state or reference that is not finite keeps the control; a wrong shape is a ValueError. What an error of
        plant, output or control dynamics means: `skydiver_utc.control.guarded_functions`.
        """
        before = self.control
        x = arguments.exactly("state", state, (self._n,))
        preview = self._preview(reference)
        noise = self._Qu if Qu is None else arguments.covariance("Qu", Qu, len(before), "controls")
        for name, array in (("state", x), ("reference", preview)):
            if not np.isfinite(array).all():
                return self._kept(f"{name} is not finite")
        wanted = np.concatenate([preview[list(self._steps)].ravel(), self._rest])
        step = self._law.step(x, preview, wanted, noise)
        reason = ""
        if step.status is Status.KEPT_PREVIOUS:
            reason = "the update of eq:utc_controller is not finite"
            if step.lost == 2 * len(before) + 1:
                reason = lost_in_words(
                    step.lost, len(before), "diverged inside the horizon", self._roll_out.cause
                )
        return UtcResult(
            control=step.control,
            predicted=step.predicted[: self._of_plant],
            innovation=step.innovation[: self._of_plant],
            covariance=self.Pu,
            repaired=step.repaired,
            lost=step.lost,
            cause=self._roll_out.cause,
            recovery=step.recovery,
            status=step.status,
            limited=limits_met(step.control, before, *self._limits),
            reason=reason,
        )

    def _preview(self, reference: ArrayLike) -> Array:
        """The reference (N+1, l) at the steps 0 .. N."""
        rows = self._steps[-1] + 1
        array = arguments.any_numbers("reference", reference)
        if array.ndim <= 1 and array.size == self._l:
            return np.tile(array.reshape(1, self._l), (rows, 1))
        if array.shape == (rows,) and self._l == 1:
            return array.reshape(rows, 1)
        if array.shape != (rows, self._l):
            raise ValueError(
                f"reference has shape {array.shape}; give the output wanted at the horizon, ({self._l},),"
                f" or a preview, ({rows}, {self._l})."
            )
        return array

    def _kept(self, reason: str) -> UtcResult:
        """The result of a step that could not begin."""
        predicted = self._law.predicted[: self._of_plant].copy()
        return UtcResult(
            control=self.control,
            predicted=predicted,
            innovation=np.zeros_like(predicted),
            covariance=self.Pu,
            repaired=0.0,
            lost=0,
            cause="",
            recovery=Recovery.NONE,
            status=Status.KEPT_PREVIOUS,
            limited=(),
            reason=reason,
        )


def _same(state: Array) -> Array:
    return state


def _limits(
    minimum: ArrayLike | None, maximum: ArrayLike | None, rate: ArrayLike | None, control: Array, dt: float
) -> ControlLimits:
    low, high = arguments.bounds(minimum, maximum, control)
    fastest = arguments.vector(
        "rate", np.inf if rate is None else rate, len(control), "controls", finite=False
    )
    if not (fastest > 0.0).all():
        raise ValueError("rate must be above zero for every control; leave a limit out with inf.")
    return ControlLimits(low, high, fastest * dt)


def _rest(
    rest: ArrayLike | None, P_rest: ArrayLike | None, control: Array, limits: ControlLimits
) -> tuple[NDArray[np.int64], Array, Array]:
    """Which controls are drawn to rest, where that is for them, and the variances of their distance from there."""
    if P_rest is None:
        if rest is not None:
            raise ValueError("rest is given without P_rest: say how far from rest each control may be.")
        return np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0)
    m = len(control)
    where = arguments.vector("rest", control if rest is None else rest, m, "controls")
    variances = arguments.vector("P_rest", P_rest, m, "controls", finite=False)
    if not (variances > 0.0).all():
        raise ValueError("P_rest must be above zero for every control; leave one free with inf.")
    drawn = np.flatnonzero(np.isfinite(variances))
    for j in drawn:
        low, high = limits.minimum[j], limits.maximum[j]
        if not low <= where[j] <= high:
            raise ValueError(
                f"rest of control {j} is {where[j]:g}, outside its bounds {low:g} .. {high:g}: change one."
            )
    return drawn, where[drawn], variances[drawn]


def _iterations(iterations: int, W0: float, square_root: bool) -> int:
    number = arguments.count("iterations", iterations)
    if number > 1 and (square_root or W0 < 0.0):
        raise ValueError(f"iterations is {number}; it takes a W0 of zero or more, and square_root=False.")
    return number


def _horizon(horizon: int | Sequence[int]) -> tuple[int, ...]:
    plain = horizon.tolist() if isinstance(horizon, np.ndarray) else horizon
    given = plain if isinstance(plain, Sequence) and not isinstance(plain, (str, bytes)) else (plain,)
    steps = tuple(arguments.count("horizon", step) for step in given)
    if not steps or list(steps) != sorted(set(steps)):
        raise ValueError(f"horizon is {horizon!r}; several steps must be in rising order.")
    return steps


def _initial_Pu(Pu: ArrayLike | None, limits: ControlLimits, m: int) -> Array:
    if Pu is not None:
        return _given_Pu(Pu, m)
    spans = limits.maximum - limits.minimum
    if not (np.isfinite(spans) & (spans > 0.0)).all():
        raise ValueError("Pu is needed, because not every control has a finite range to take it from.")
    return np.diag((0.1 * spans) ** 2)


def _given_Pu(Pu: ArrayLike, m: int) -> Array:
    given = arguments.covariance("Pu", Pu, m, "controls")
    if not (np.diag(given) > 0.0).all():
        raise ValueError("Pu has a variance of zero: that control would never be tried; give it a small one.")
    return given

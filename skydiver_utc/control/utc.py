"""The law of the Unscented Transform Controller (section 3 of the paper), apart from any plant.

`UtcLaw` works with a predict function that drives the plant; `UnscentedTransformController` in
control/unscented_controller.py builds one from a plant.

One step: draw sigma points of the control from Pu (eq:sigp), bound them (eq:minmax_utc, eq:movep), let each drive
the plant to the horizon (the predict function), take the means and covariances of controls and outputs (eq:zpred,
eq:xpred, eq:pu_pred), move the control towards the reference with the gain K = C_uy C_y^-1 (eq:utc_controller),
bound it again. The arithmetic stands in control/utc_step.py,
and in control/utc_square_root.py.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control import utc_square_root, utc_step
from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.control.protocol import Status
from skydiver_utc.control.utc_iterated import IteratedUpdate
from skydiver_utc.control.utc_memory import Memory, Rules, memory, new_block
from skydiver_utc.control.utc_step import Recovery
from skydiver_utc.unscented.covariance import symmetric_root
from skydiver_utc.unscented.sigma_points import weights

Array = NDArray[np.float64]

# predict(state, control now applied (m,), points (2m+1, m), preview, outputs (2m+1, l), saved (2m+1, m)) writes the
# outputs at the horizon and the controls U^i that stand for each point in eq:xpred. One that is compiled can have a
# method `whole_step` beside it, which does draw, predict and move in one compiled call. The library's has none: the
# law would have to be compiled again with each plant, for seconds, to save microseconds.
Predict = Callable[[Array, Array, Array, Array, Array, Array], None]
# (rules, block of arrays, state, preview, reference, Qu) -> status, recovery, lost points, repair of Pu.
WholeStep = Callable[[Rules, Array, Array, Array, Array, Array], tuple[int, int, int, float]]

_STATUS, _RECOVERY = tuple(Status), tuple(Recovery)


class UtcStep(NamedTuple):
    """Result of one step: control (m,), predicted output and innovation (l,), repair of Pu, status, lost points.

    A step that keeps the previous control repeats the last prediction and has no innovation.
    """

    control: Array
    predicted: Array
    innovation: Array
    repaired: float
    status: Status
    lost: int
    recovery: Recovery


class UtcLaw:
    """Keeps U and Pu; `step` moves them on.

    P_err (l, l) covariance of the tracking error; `covariance_floor` is the smallest eigenvalue kept in Pu.
    The readings are those of `UtcParameters`; `leak` is the share of Pu that is forgotten after each step;
    `square_root` keeps a factor S of Pu = S S' and moves that on, the same law in exact arithmetic; `iterations`
    above 1 repeats the update from where it has led, not in square-root form.

    A sigma point that diverges inside the horizon (an output that is not finite, or beyond 1e100) is left out: the
    weights of the others are scaled to the same sum, and made equal if W0 < 0. Mean and spread so move away from
    where the model diverges. Where a negative W0 makes C_y indefinite, the covariances are taken about the central
    point; where rounding does, that step is computed in square-root form.

    The previous control is kept when no point is left or the update is not finite. Such a step could fail again
    and again, so the next one begins from the initial Pu; but a state or reference that is not finite is no reason
    to forget Pu.
    """

    def __init__(
        self,
        predict: Predict,
        limits: ControlLimits,
        P_err: Array,
        W0: float,
        *,
        covariance_floor: float = 1e-9,
        keep_indefinite: bool = False,
        move_unclipped: bool = True,
        output_weights: Array | None = None,
        leak: float = 0.0,
        square_root: bool = False,
        iterations: int = 1,
    ) -> None:
        m = len(limits.minimum)
        P_err = np.ascontiguousarray(P_err, dtype=float)
        self._predict = predict
        self._rules = Rules(
            m=m,
            outputs=len(P_err),
            W0=W0,
            floor=covariance_floor,
            kept_share=1.0 - leak,
            keep_indefinite=keep_indefinite,
            move_unclipped=move_unclipped,
            square_root=square_root,
        )
        self._block = new_block(m, len(P_err))
        own = self._own = memory(self._block, m, len(P_err))
        own.minimum[:], own.maximum[:], own.slew[:] = limits
        own.P_err[:] = P_err
        own.P_err_factor[:] = np.linalg.cholesky(P_err)
        own.weights[:] = weights(m, W0)
        own.output_weights[:] = own.weights if output_weights is None else output_weights
        form = utc_square_root if square_root else utc_step
        self._draw: Callable[[Rules, Memory], float] = form.draw
        self._move: Callable[[Rules, Memory, Array, Array, float], tuple[int, int, int, float]] = form.move
        self._run: WholeStep = getattr(predict, "whole_step", self._in_three_calls)
        if iterations > 1:
            self._run = IteratedUpdate(own, predict, iterations)
        self.reset(np.zeros(m), np.eye(m))

    @property
    def control(self) -> Array:
        """U now (m,): the law's own array, like the three that follow."""
        return self._own.control

    @property
    def covariance(self) -> Array:
        """Pu now (m, m)."""
        return self._own.covariance

    @property
    def deviations(self) -> Array:
        """Standard deviations of U now (m,)."""
        return self._own.deviations

    @property
    def predicted(self) -> Array:
        """Output predicted last (l,)."""
        return self._own.predicted

    def reset(self, control: Array, covariance: Array) -> None:
        """Start from a control (m,) and its covariance (m, m)."""
        self.hold(control)
        self._initial = np.array(covariance, dtype=float)
        self.begin_from(self._initial)
        self._own.predicted[:] = 0.0

    def hold(self, control: Array) -> None:
        """Go on from a control (m,) that was found elsewhere, with Pu as it is."""
        self._own.control[:] = control

    def begin_from(self, covariance: Array) -> None:
        """Go on from the control as it is, with another Pu (m, m); the next step tells of its repair."""
        own = self._own
        own.covariance[:] = covariance
        own.deviations[:] = np.sqrt(np.maximum(covariance.diagonal(), 0.0))
        self._repaired_before, self._trace_before = 0.0, float(covariance.trace())
        if self._rules.square_root:
            self._repaired_before = symmetric_root(
                own.covariance, self._rules.floor, False, own.factor, own.values, own.vectors
            )

    def step(self, state: Array, preview: Array, reference: Array, Qu: Array) -> UtcStep:
        """Move the control towards `reference` (l,), the output wanted at the horizon."""
        own = self._own
        status, recovery, lost, repaired = self._run(self._rules, self._block, state, preview, reference, Qu)
        failed = status == Status.KEPT_PREVIOUS
        sound = failed and all(bool(np.isfinite(given).all()) for given in (state, preview, reference))
        if sound and not self._rules.square_root and lost < len(own.points):
            # Called from here, so that only those who need it wait for its compilation.
            status, recovery, lost, repaired = utc_square_root.factor_instead(
                self._rules, own, reference, Qu, lost, repaired
            )
            failed = status == Status.KEPT_PREVIOUS
        if self._repaired_before > 0.0:
            repaired += self._repaired_before
            if not failed and self._repaired_before > utc_step.ROUNDING * self._trace_before:
                status = Status.REPAIRED
            self._repaired_before = 0.0
        control, predicted = own.control.copy(), own.predicted.copy()
        if not failed:
            innovation = own.innovation.copy()
            return UtcStep(
                control, predicted, innovation, repaired, _STATUS[status], lost, _RECOVERY[recovery]
            )
        if sound:
            self.begin_from(self._initial)
        return UtcStep(
            control, predicted, np.zeros_like(predicted), repaired, Status.KEPT_PREVIOUS, lost,
            Recovery.RESTARTED if sound else Recovery.NONE,
        )  # fmt: skip

    def _in_three_calls(
        self, rules: Rules, block: Array, state: Array, preview: Array, reference: Array, Qu: Array
    ) -> tuple[int, int, int, float]:
        """`WholeStep` around a prediction that is a function of Python, or compiled apart."""
        own = self._own
        repaired = self._draw(rules, own)
        self._predict(state, own.control, own.points, preview, own.outputs, own.saved)
        return self._move(rules, own, reference, Qu, repaired)

"""The law of the Unscented Transform Controller (section 3 of the paper), apart from any plant.

`UtcLaw` works with a predict function that drives the plant; `UnscentedTransformController` in
control/unscented_controller.py builds one from a plant.

One step: draw sigma points of the control from Pu (eq:sigp), bound them (eq:minmax_utc, eq:movep), let each drive
the plant to the horizon (the predict function), take the means and covariances of controls and outputs (eq:zpred,
eq:xpred, eq:pu_pred), move the control towards the reference with the gain K = C_uy C_y^-1 (eq:utc_controller),
bound it again.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.control.protocol import Status
from skydiver_utc.jit import kernel
from skydiver_utc.unscented.covariance import symmetric_root
from skydiver_utc.unscented.linear_algebra import cholesky, divide_by_lower, divide_by_upper
from skydiver_utc.unscented.sigma_points import add_cross_covariance, spread, weighted_mean, weights

Array = NDArray[np.float64]

# predict(state, control now applied (m,), points (2m+1, m), preview, outputs (2m+1, l), saved (2m+1, m)) writes the
# outputs at the horizon and the controls U^i that stand for each point in eq:xpred.
Predict = Callable[[Array, Array, Array, Array, Array, Array], None]


# An output beyond this is lost: its square would overflow.
_LARGEST_OUTPUT = 1e100


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


class UtcLaw:
    """Keeps U and Pu; `step` moves them on.

    P_err (l, l) covariance of the tracking error; `covariance_floor` is the smallest eigenvalue kept in Pu.
    The readings are those of `UtcParameters`; `leak` is the share of Pu that is forgotten after each step.

    A sigma point that diverges inside the horizon (an output that is not finite, or beyond 1e100) is left out: the
    weights of the others are scaled to the same sum. Mean and spread so move away from where the model diverges.
    The previous control and Pu are kept when no weight is left or the update is not finite.
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
    ) -> None:
        m, outputs = len(limits.minimum), len(P_err)
        self._predict = predict
        self._limits = limits
        self._P_err = np.ascontiguousarray(P_err, dtype=float)
        self._W0 = W0
        self._floor = covariance_floor
        self._keep = keep_indefinite
        self._move = move_unclipped
        self._kept_share = 1.0 - leak
        self._weights = weights(m, W0)
        self._output_weights = self._weights if output_weights is None else output_weights
        self._points = np.empty((2 * m + 1, m))
        self._saved = np.empty((2 * m + 1, m))
        self._outputs = np.empty((2 * m + 1, outputs))
        self._scratch = _Scratch(m, outputs)
        self.reset(np.zeros(m), np.eye(m))

    def reset(self, control: Array, covariance: Array) -> None:
        """Start from a control (m,) and its covariance (m, m)."""
        self.control = np.array(control, dtype=float)
        self.covariance = np.array(covariance, dtype=float)
        self.predicted = np.zeros(self._outputs.shape[1])

    def step(self, state: Array, preview: Array, reference: Array, Qu: Array) -> UtcStep:
        """Move the control towards `reference` (l,), the output wanted at the horizon."""
        s = self._scratch
        repaired = draw_points(
            self.control, self.covariance, self._floor, self._keep, self._W0,
            self._limits.minimum, self._limits.maximum, self._move, self._points, s.root, s.values, s.vectors,
        )  # fmt: skip
        self._predict(state, self.control, self._points, preview, self._outputs, self._saved)
        lost = drop_lost(
            self._outputs, self._saved, self._weights, self._output_weights, s.weights, s.output_weights
        )
        if lost == len(self._points) or not update(
            self._saved, self._outputs, s.weights, s.output_weights, reference, Qu, self._P_err,
            s.control, s.predicted, s.covariance, s.output_covariance, s.gain, s.innovation,
        ):  # fmt: skip
            return UtcStep(
                self.control.copy(), self.predicted.copy(), np.zeros_like(self.predicted),
                repaired, Status.KEPT_PREVIOUS, lost,
            )  # fmt: skip
        control = self._limits.apply(s.control, self.control)
        status = Status.SOLVED
        if (control != s.control).any():
            status = Status.SATURATED
        if repaired > 0.0 or lost > 0:
            status = Status.REPAIRED
        self.control = control
        np.multiply(s.covariance, self._kept_share, out=self.covariance)
        self.predicted[:] = s.predicted
        return UtcStep(control.copy(), s.predicted.copy(), s.innovation.copy(), repaired, status, lost)


class _Scratch:
    """Work space of one controller, so that a step does not allocate in its kernels."""

    def __init__(self, m: int, outputs: int) -> None:
        self.root = np.empty((m, m))
        self.values = np.empty(m)
        self.vectors = np.empty((m, m))
        self.control = np.empty(m)
        self.covariance = np.empty((m, m))
        self.predicted = np.empty(outputs)
        self.output_covariance = np.empty((outputs, outputs))
        self.gain = np.empty((m, outputs))
        self.innovation = np.empty(outputs)
        self.weights = np.empty(2 * m + 1)
        self.output_weights = np.empty(2 * m + 1)


@kernel
def draw_points(
    control: Array,
    covariance: Array,
    floor: float,
    keep_indefinite: bool,
    W0: float,
    minimum: Array,
    maximum: Array,
    move_unclipped: bool,
    points: Array,
    root: Array,
    values: Array,
    vectors: Array,
) -> float:
    """Sigma points (2m+1, m) inside the bounds; returns by how much the covariance was repaired.

    A coordinate of the control that lies on its bound would leave points on one side identical: eq:movep mirrors
    them to the inner side, at half the distance.
    """
    repaired = symmetric_root(covariance, floor, keep_indefinite, root, values, vectors)
    spread(control, root, W0, points)
    for i in range(points.shape[0]):
        for j in range(points.shape[1]):
            value = points[i, j]
            below = control[j] == minimum[j] and value < minimum[j]
            above = control[j] == maximum[j] and value > maximum[j]
            if move_unclipped and (below or above):
                value = 1.5 * control[j] - 0.5 * value
            points[i, j] = min(max(value, minimum[j]), maximum[j])
    return repaired


@kernel
def drop_lost(
    outputs: Array, saved: Array, weight: Array, output_weight: Array, left: Array, output_left: Array
) -> int:
    """Weights (2m+1,) without the points that diverged, scaled to the same sum; returns how many those are.

    Lost rows of outputs (2m+1, l) and saved (2m+1, m) are overwritten with zeros. All points count as lost when the
    others have no weight.
    """
    lost: int = 0
    total, remaining = 0.0, 0.0
    for i in range(outputs.shape[0]):
        alive = True
        for k in range(outputs.shape[1]):
            if not abs(outputs[i, k]) <= _LARGEST_OUTPUT:
                alive = False
        for j in range(saved.shape[1]):
            if not abs(saved[i, j]) <= _LARGEST_OUTPUT:
                alive = False
        left[i], output_left[i] = weight[i], output_weight[i]
        total += weight[i]
        if alive:
            remaining += weight[i]
        else:
            lost += 1
            left[i], output_left[i] = 0.0, 0.0
            outputs[i, :] = 0.0
            saved[i, :] = 0.0
    if lost > 0:
        if remaining < 1e-6 * total:
            return len(outputs)
        for i in range(outputs.shape[0]):
            left[i] *= total / remaining
            output_left[i] *= total / remaining
    return lost


@kernel
def update(
    saved: Array,
    outputs: Array,
    weight: Array,
    output_weight: Array,
    reference: Array,
    Qu: Array,
    P_err: Array,
    control: Array,
    predicted: Array,
    covariance: Array,
    output_covariance: Array,
    gain: Array,
    innovation: Array,
) -> bool:
    """eq:xpred to eq:utc_controller before the bounds; False if the result would not be finite.

    Writes control (m,), predicted (l,), covariance (m, m), output_covariance (l, l), gain (m, l), innovation (l,).
    """
    m, n = control.shape[0], predicted.shape[0]
    weighted_mean(saved, weight, control)
    weighted_mean(outputs, output_weight, predicted)
    covariance[:, :] = Qu
    add_cross_covariance(saved, control, saved, control, weight, covariance)
    output_covariance[:, :] = P_err
    add_cross_covariance(outputs, predicted, outputs, predicted, weight, output_covariance)
    gain[:, :] = 0.0
    add_cross_covariance(saved, control, outputs, predicted, weight, gain)
    for i in range(n):
        innovation[i] = reference[i] - predicted[i]
    if not cholesky(output_covariance):
        return False
    # With C_y = L L' and G = C_uy L^-T: K C_y K' = G G' and K = G L^-1.
    divide_by_upper(gain, output_covariance)
    for a in range(m):
        for b in range(m):
            for i in range(n):
                covariance[a, b] -= gain[a, i] * gain[b, i]
    divide_by_lower(gain, output_covariance)
    for a in range(m):
        for i in range(n):
            control[a] += gain[a, i] * innovation[i]
    for a in range(m):
        # Comparisons, because the compiler may fold np.isfinite (x - x == 0) of a sum.
        if not abs(control[a]) < np.inf:
            return False
        for b in range(m):
            if not abs(covariance[a, b]) < np.inf:
                return False
    return True

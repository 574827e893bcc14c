"""The arithmetic of one UTC step on arrays that the law owns: `draw`, then any prediction, then `move`.

Both are kernels, so that a compiled prediction can stand between them in one compiled call
(`skydiver_utc.simulation.prediction.whole_step`); `skydiver_utc.control.utc.UtcLaw` calls them around any other.
"""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control.protocol import Status
from skydiver_utc.control.utc_memory import Memory, Rules
from skydiver_utc.jit import kernel
from skydiver_utc.unscented.covariance import symmetric_root
from skydiver_utc.unscented.linear_algebra import cholesky, divide_by_lower, divide_by_upper
from skydiver_utc.unscented.sigma_points import add_cross_covariance, spread, weighted_mean

Array = NDArray[np.float64]

# An output beyond this is lost: its square would overflow.
_LARGEST_OUTPUT = 1e100
# A repair of Pu below this share of its trace is rounding, and no reason to call a step repaired.
ROUNDING = 1e-15
# Weights that are left after losses are not scaled up beyond the inverse of this.
_LEAST_WEIGHT = 1e-6
_SOLVED, _SATURATED = int(Status.SOLVED), int(Status.SATURATED)
_REPAIRED, KEPT_PREVIOUS = int(Status.REPAIRED), int(Status.KEPT_PREVIOUS)


class Recovery(IntEnum):
    """What was done about a step that had no answer as eq:utc_controller stands."""

    NONE = 0
    ABOUT_CENTRE = 1
    RESTARTED = 2
    FACTORED = 3


# Literals for the kernels.
NONE, ABOUT_CENTRE, FACTORED = int(Recovery.NONE), int(Recovery.ABOUT_CENTRE), int(Recovery.FACTORED)


@kernel
def draw(rules: Rules, x: Memory) -> float:
    """Sigma points (eq:sigp) inside the bounds; returns by how much the covariance was repaired."""
    repaired = symmetric_root(x.covariance, rules.floor, rules.keep_indefinite, x.root, x.values, x.vectors)
    place(rules, x)
    return repaired


@kernel
def place(rules: Rules, x: Memory) -> None:
    """Points around the control from the root of Pu, inside the bounds (eq:minmax_utc).

    A coordinate of the control that lies on its bound would leave points on one side identical: eq:movep mirrors
    them to the inner side, at half the distance.
    """
    control, points, minimum, maximum = x.control, x.points, x.minimum, x.maximum
    spread(control, x.root, rules.W0, points)
    for i in range(points.shape[0]):
        for j in range(points.shape[1]):
            value = points[i, j]
            below = control[j] == minimum[j] and value < minimum[j]
            above = control[j] == maximum[j] and value > maximum[j]
            if rules.move_unclipped and (below or above):
                value = 1.5 * control[j] - 0.5 * value
            points[i, j] = min(max(value, minimum[j]), maximum[j])


@kernel
def move(
    rules: Rules, x: Memory, reference: Array, Qu: Array, drawing_repaired: float
) -> tuple[int, int, int, float]:
    """eq:xpred to eq:utc_controller and the bounds; returns status, recovery, lost points, repair of Pu in all.

    A negative W0 can make C_y indefinite. The covariances are then taken about the central point, which so has no
    part in them and leaves them positive (the modified form of Julier and Uhlmann, 2000). Rounding can do so with
    any W0, where the outputs' covariance has eigenvalues further apart than the digits of a number: the step is
    then left to `utc_square_root.factor_instead`.
    Control, covariance and predicted output stay as they are where the previous control is kept.
    """
    lost = means(x)
    recovery, possible = NONE, False
    if lost < x.points.shape[0]:
        for reading in (NONE, ABOUT_CENTRE):
            recovery = reading
            control = x.next_control if reading == NONE else x.saved[0]
            output = x.next_predicted if reading == NONE else x.outputs[0]
            possible = covariances(x, Qu, control, output)
            if possible or not x.left[0] < 0.0:
                break
    return conclude(rules, x, reference, possible, recovery, lost, drawing_repaired)


@kernel
def means(x: Memory) -> int:
    """eq:xpred and eq:zpred over the points that did not diverge; returns how many did."""
    lost: int = drop_lost(x.outputs, x.saved, x.weights, x.output_weights, x.left, x.output_left)
    weighted_mean(x.saved, x.left, x.next_control)
    weighted_mean(x.outputs, x.output_left, x.next_predicted)
    return lost


@kernel
def conclude(
    rules: Rules, x: Memory, reference: Array, possible: bool, recovery: int, lost: int, repaired: float
) -> tuple[int, int, int, float]:
    """Move the control and adopt what was found, if that was possible; returns what `move` does."""
    return settle(rules, x, possible and update(x, reference), recovery, lost, repaired)


@kernel
def settle(
    rules: Rules, x: Memory, found: bool, recovery: int, lost: int, repaired: float
) -> tuple[int, int, int, float]:
    """Adopt the next control and covariance, if they were found; returns what `move` does."""
    if not found:
        return KEPT_PREVIOUS, recovery, lost, repaired
    trace = 0.0
    for a in range(x.covariance.shape[0]):
        trace += x.covariance[a, a]
    saturated = adopt(rules, x)
    if repaired > ROUNDING * trace or lost > 0 or recovery != NONE:
        return _REPAIRED, recovery, lost, repaired
    return _SATURATED if saturated else _SOLVED, recovery, lost, repaired


@kernel
def drop_lost(
    outputs: Array, saved: Array, weight: Array, output_weight: Array, left: Array, output_left: Array
) -> int:
    """Weights (2m+1,) without the points that diverged, scaled to the same sum; returns how many those are.

    Beside a negative central weight the others may sum to nothing or less; equal weights take their place then, as
    they do where hardly any weight is left. Lost rows of outputs (2m+1, l) and saved (2m+1, m) are overwritten with
    zeros.
    """
    lost: int = 0
    count = outputs.shape[0]
    total, remaining = 0.0, 0.0
    for i in range(outputs.shape[0]):
        alive = True
        for k in range(outputs.shape[1]):
            if not abs(outputs[i, k]) <= _LARGEST_OUTPUT:
                alive = False
        for j in range(saved.shape[1]):
            if not abs(saved[i, j]) <= _LARGEST_OUTPUT:
                alive = False
        total += weight[i]
        left[i] = 1.0 if alive else 0.0
        if alive:
            remaining += weight[i]
        else:
            lost += 1
            outputs[i, :] = 0.0
            saved[i, :] = 0.0
    equal = lost > 0 and (weight[0] < 0.0 or remaining < _LEAST_WEIGHT * total)
    scale = total / remaining if lost > 0 else 1.0
    for i in range(count):
        if left[i] == 0.0:
            output_left[i] = 0.0
        elif equal:
            left[i] = output_left[i] = total / (count - lost)
        else:
            left[i], output_left[i] = scale * weight[i], scale * output_weight[i]
    return lost


@kernel
def covariances(x: Memory, Qu: Array, control: Array, predicted: Array) -> bool:
    """C_y = L L' (eq:zpred), C_uy L^-T, and Pu of eq:pu_pred less K C_y K', of deviations from these means.

    False if C_y is not positive definite.
    """
    outputs, saved, weight = x.outputs, x.saved, x.left
    covariance, factor, gain = x.next_covariance, x.output_factor, x.gain
    covariance[:, :] = Qu
    add_cross_covariance(saved, control, saved, control, weight, covariance)
    factor[:, :] = x.P_err
    add_cross_covariance(outputs, predicted, outputs, predicted, weight, factor)
    gain[:, :] = 0.0
    add_cross_covariance(saved, control, outputs, predicted, weight, gain)
    if not cholesky(factor):
        return False
    # With C_y = L L' and G = C_uy L^-T: K C_y K' = G G' and K = G L^-1.
    divide_by_upper(gain, factor)
    for a in range(gain.shape[0]):
        for b in range(gain.shape[0]):
            for i in range(gain.shape[1]):
                covariance[a, b] -= gain[a, i] * gain[b, i]
    return True


@kernel
def update(x: Memory, reference: Array) -> bool:
    """eq:utc_controller before the bounds; False if the result would not be finite."""
    control, covariance, gain = x.next_control, x.next_covariance, x.gain
    m, n = gain.shape
    for i in range(n):
        x.innovation[i] = reference[i] - x.next_predicted[i]
    divide_by_lower(gain, x.output_factor)
    for a in range(m):
        for i in range(n):
            control[a] += gain[a, i] * x.innovation[i]
    for a in range(m):
        # Comparisons, because the compiler may fold np.isfinite (x - x == 0) of a sum.
        if not abs(control[a]) < np.inf:
            return False
        for b in range(m):
            if not abs(covariance[a, b]) < np.inf:
                return False
    return True


@kernel
def adopt(rules: Rules, x: Memory) -> bool:
    """Make the new control, inside bounds and slew rate, Pu and predicted output the present ones.

    Returns whether the bounds or the slew rate changed the control.
    """
    m, saturated = x.control.shape[0], False
    for j in range(m):
        wanted, before = x.next_control[j], x.control[j]
        value = min(max(wanted, x.minimum[j]), x.maximum[j])
        value = min(max(value, before - x.slew[j]), before + x.slew[j])
        saturated = saturated or value != wanted
        x.control[j] = value
    for a in range(m):
        for b in range(m):
            x.covariance[a, b] = rules.kept_share * x.next_covariance[a, b]
        x.deviations[a] = np.sqrt(max(x.covariance[a, a], 0.0))
    x.predicted[:] = x.next_predicted
    return saturated

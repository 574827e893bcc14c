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
from skydiver_utc.unscented.covariance import eigen_symmetric, symmetric_root
from skydiver_utc.unscented.linear_algebra import cholesky, divide_by_lower, divide_by_upper
from skydiver_utc.unscented.sigma_points import add_cross_covariance, spread, weighted_mean
from skydiver_utc.unscented.square_root import lower_triangular, root_of_factor, take_away

Array = NDArray[np.float64]

# An output beyond this is lost: its square would overflow.
_LARGEST_OUTPUT = 1e100
_SOLVED, _SATURATED = int(Status.SOLVED), int(Status.SATURATED)
_REPAIRED, _KEPT_PREVIOUS = int(Status.REPAIRED), int(Status.KEPT_PREVIOUS)


class Recovery(IntEnum):
    """What was done about a step that had no answer as eq:utc_controller stands."""

    NONE = 0
    ABOUT_CENTRE = 1
    RESTARTED = 2


_NONE, _ABOUT_CENTRE = int(Recovery.NONE), int(Recovery.ABOUT_CENTRE)


@kernel
def draw(rules: Rules, x: Memory) -> float:
    """Sigma points inside the bounds (eq:sigp, eq:minmax_utc); returns by how much the covariance was repaired.

    A coordinate of the control that lies on its bound would leave points on one side identical: eq:movep mirrors
    them to the inner side, at half the distance.
    """
    control, points, minimum, maximum = x.control, x.points, x.minimum, x.maximum
    if rules.square_root:
        repaired = root_of_factor(x.factor, rules.floor, x.root, x.values, x.vectors, x.rows)
    else:
        repaired = symmetric_root(
            x.covariance, rules.floor, rules.keep_indefinite, x.root, x.values, x.vectors
        )
    spread(control, x.root, rules.W0, points)
    for i in range(points.shape[0]):
        for j in range(points.shape[1]):
            value = points[i, j]
            below = control[j] == minimum[j] and value < minimum[j]
            above = control[j] == maximum[j] and value > maximum[j]
            if rules.move_unclipped and (below or above):
                value = 1.5 * control[j] - 0.5 * value
            points[i, j] = min(max(value, minimum[j]), maximum[j])
    return repaired


@kernel
def move(
    rules: Rules, x: Memory, reference: Array, Qu: Array, drawing_repaired: float
) -> tuple[int, int, int, float]:
    """eq:xpred to eq:utc_controller and the bounds; returns status, recovery, lost points, repair of Pu in all.

    A negative W0 can make C_y indefinite. The covariances are then taken about the central point, which so has no
    part in them and leaves them positive (the modified form of Julier and Uhlmann, 2000).
    Control, covariance and predicted output stay as they are where the previous control is kept.
    """
    recovery, repaired = _NONE, drawing_repaired
    lost = drop_lost(x.outputs, x.saved, x.weights, x.output_weights, x.left, x.output_left)
    if lost == x.points.shape[0]:
        return _KEPT_PREVIOUS, recovery, lost, repaired
    weighted_mean(x.saved, x.left, x.next_control)
    weighted_mean(x.outputs, x.output_left, x.next_predicted)
    refused = -1.0
    for reading in (_NONE, _ABOUT_CENTRE):
        recovery = reading
        control = x.next_control if reading == _NONE else x.saved[0]
        output = x.next_predicted if reading == _NONE else x.outputs[0]
        refused = covariances(rules, x, Qu, control, output)
        if refused >= 0.0:
            break
    repaired += refused
    if refused < 0.0 or not update(x, reference):
        return _KEPT_PREVIOUS, recovery, lost, drawing_repaired
    saturated = adopt(rules, x)
    if repaired > 0.0 or lost > 0 or recovery != _NONE:
        return _REPAIRED, recovery, lost, repaired
    return _SATURATED if saturated else _SOLVED, recovery, lost, repaired


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
def covariances(rules: Rules, x: Memory, Qu: Array, control: Array, predicted: Array) -> float:
    """C_y = L L' (eq:zpred), C_uy L^-T, and Pu of eq:pu_pred less K C_y K', of deviations from these means.

    Returns -1 if C_y is not positive definite, else what of Pu could not be taken away to keep it so.
    """
    if rules.square_root:
        return factored(x, Qu, control, predicted)
    return plain(x, Qu, control, predicted)


@kernel
def plain(x: Memory, Qu: Array, control: Array, predicted: Array) -> float:
    """The covariances themselves."""
    outputs, saved, weight = x.outputs, x.saved, x.left
    covariance, factor, gain = x.next_covariance, x.output_factor, x.gain
    covariance[:, :] = Qu
    add_cross_covariance(saved, control, saved, control, weight, covariance)
    factor[:, :] = x.P_err
    add_cross_covariance(outputs, predicted, outputs, predicted, weight, factor)
    gain[:, :] = 0.0
    add_cross_covariance(saved, control, outputs, predicted, weight, gain)
    if not cholesky(factor):
        return -1.0
    # With C_y = L L' and G = C_uy L^-T: K C_y K' = G G' and K = G L^-1.
    divide_by_upper(gain, factor)
    for a in range(gain.shape[0]):
        for b in range(gain.shape[0]):
            for i in range(gain.shape[1]):
                covariance[a, b] -= gain[a, i] * gain[b, i]
    return 0.0


@kernel
def factored(x: Memory, Qu: Array, control: Array, predicted: Array) -> float:
    """The square-root form.

    The weighted deviations of outputs and controls beside the roots of P_err and Qu are an array A with
    A A' = (C_y, C_uy'; C_uy, Pu). Its lower triangle is (L, 0; C_uy L^-T, S) where S S' is Pu less K C_y K'.
    What has a negative sign, the central point if W0 < 0 and negative eigenvalues of Qu, is taken away afterwards.
    """
    array, vector = x.array, x.vector
    count, outputs = x.outputs.shape
    m = x.saved.shape[1]
    size = outputs + m
    array[:, :] = 0.0
    for i in range(count):
        if x.left[i] > 0.0:
            _deviation(x, i, control, predicted, np.sqrt(x.left[i]), array[:, i])
    array[:outputs, count : count + outputs] = x.P_err_factor
    x.rows[:, :] = Qu
    eigen_symmetric(x.rows, x.values, x.vectors)
    for k in range(m):
        for a in range(m):
            array[outputs + a, count + outputs + k] = np.sqrt(max(x.values[k], 0.0)) * x.vectors[a, k]
    lower_triangular(array)
    refused = 0.0
    for i in range(count):
        if x.left[i] < 0.0:
            _deviation(x, i, control, predicted, np.sqrt(-x.left[i]), vector)
            taken = take_away(array, size, outputs, vector)
            if taken < 0.0:
                return -1.0
            refused += taken
    for k in range(m):
        if x.values[k] < 0.0:
            vector[:outputs] = 0.0
            for a in range(m):
                vector[outputs + a] = np.sqrt(-x.values[k]) * x.vectors[a, k]
            refused += take_away(array, size, outputs, vector)
    x.output_factor[:, :] = array[:outputs, :outputs]
    x.gain[:, :] = array[outputs:, :outputs]
    for a in range(m):
        for b in range(m):
            total = 0.0
            for k in range(min(a, b) + 1):
                total += array[outputs + a, outputs + k] * array[outputs + b, outputs + k]
            x.next_covariance[a, b] = total
    return refused


@kernel
def _deviation(x: Memory, i: int, control: Array, predicted: Array, scale: float, out: Array) -> None:
    """How far outputs and control of point i are from their means, (l + m,), times a scale."""
    outputs = predicted.shape[0]
    for k in range(outputs):
        out[k] = scale * (x.outputs[i, k] - predicted[k])
    for a in range(control.shape[0]):
        out[outputs + a] = scale * (x.saved[i, a] - control[a])


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
    if rules.square_root:
        first = x.outputs.shape[1]
        for a in range(m):
            for b in range(m):
                x.factor[a, b] = np.sqrt(rules.kept_share) * x.array[first + a, first + b]
    x.predicted[:] = x.next_predicted
    return saturated

# SPDX-License-Identifier: Apache-2.0
"""The two halves of a UTC step, before and after the roll-out: sigma points of the control, and its update."""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.controllers.protocol import Status
from skydiver_utc.jit import kernel, program
from skydiver_utc.unscented.covariance import symmetric_root
from skydiver_utc.unscented.linear_algebra import gain
from skydiver_utc.unscented.sigma_points import add_cross_covariance, spread, weighted_mean

Array = NDArray[np.float64]


class Recovery(IntEnum):
    """The remedy of a step in which eq:utc_controller has no answer.

    ABOUT_CENTRE: a negative W0 made C_y indefinite, so covariances are taken about the central point, which so has no
    part in them (the modified form of Julier and Uhlmann, 2000); OUTPUTS_REPAIRED: eigenvalues of C_y lie further
    apart than the digits of a number, so its diagonal was raised; RESTARTED: the next step begins from the initial Pu
    """

    NONE = 0
    ABOUT_CENTRE = 1
    OUTPUTS_REPAIRED = 2
    RESTARTED = 3


# An output beyond this is lost: its square would overflow.
_LARGEST_OUTPUT = 1e100
# A repair of Pu below this share of its trace is rounding, and no reason to call a step repaired.
ROUNDING = 1e-15
# Weights that are left after losses are not scaled up beyond the inverse of this.
_LEAST_WEIGHT = 1e-6
# Share of its trace that is added to the diagonal of a C_y that rounding made indefinite.
_LEAST_OUTPUT_SHARE = 1e-14
# Literals for the kernels.
_SOLVED, _SATURATED = int(Status.SOLVED), int(Status.SATURATED)
_REPAIRED, _KEPT_PREVIOUS = int(Status.REPAIRED), int(Status.KEPT_PREVIOUS)
_NONE, _ABOUT_CENTRE, _OUTPUTS_REPAIRED = 0, 1, 2


@program
def draw(control: Array, Pu: Array, W0: float, floor: float, limits: Array, points: Array) -> float:
    """Sigma points (2m+1, m) of eq:sigp inside the bounds (eq:minmax_utc); repairs Pu, returns by how much.

    A coordinate of the control that lies on its bound would leave points on one side identical: eq:movep mirrors
    them to the inner side, at half the distance. limits (3, m): minimum, maximum, largest change.
    """
    root = np.empty(Pu.shape)
    repaired = symmetric_root(Pu, floor, root)
    spread(control, root, W0, points)
    for i in range(points.shape[0]):
        for c in range(points.shape[1]):
            value, low, high = points[i, c], limits[0, c], limits[1, c]
            if (control[c] == low and value < low) or (control[c] == high and value > high):
                value = 1.5 * control[c] - 0.5 * value
            points[i, c] = min(max(value, low), high)
    return repaired


@program
def update(
    weights: Array,
    outputs: Array,
    saved: Array,
    nominal: NDArray[np.int64],
    P_err: Array,
    Qu: Array,
    reference: Array,
    limits: Array,
    kept_share: float,
    repaired: float,
    control: Array,
    Pu: Array,
    predicted: Array,
    innovation: Array,
) -> tuple[int, int, int]:
    """eq:xpred to eq:utc_controller and the bounds; returns status, recovery, lost points.

    outputs (2m+1, l) and saved (2m+1, m), U^i, come from the roll-out; the last outputs are the controls `nominal`.
    Moves control, Pu, predicted and innovation on; where no update is possible all stay as they are.
    """
    m, l = saved.shape[1], outputs.shape[1]
    for i in range(outputs.shape[0]):
        for k in range(nominal.shape[0]):
            outputs[i, l - nominal.shape[0] + k] = saved[i, nominal[k]]
    left = np.empty(weights.shape[0])
    lost = _weights_left(weights, outputs, saved, left)
    recovery = _NONE
    if lost == outputs.shape[0]:
        return _KEPT_PREVIOUS, recovery, lost
    U, Y = np.empty(m), np.empty(l)
    weighted_mean(saved, left, U)
    weighted_mean(outputs, left, Y)
    following, C_y, K = np.empty((m, m)), np.empty((l, l)), np.empty((m, l))
    found = False
    for attempt in range(3):
        if found or (attempt == _ABOUT_CENTRE and not left[0] < 0.0):
            continue
        recovery = attempt
        _covariances(saved, outputs, U, Y, left, attempt == _ABOUT_CENTRE, Qu, P_err, following, C_y, K)
        if attempt == _OUTPUTS_REPAIRED:
            trace = 0.0
            for k in range(l):
                trace += C_y[k, k]
            for k in range(l):
                C_y[k, k] += _LEAST_OUTPUT_SHARE * trace
        found = gain(C_y, K, following)
    if not found:
        return _KEPT_PREVIOUS, _NONE, lost
    for a in range(m):
        for k in range(l):
            U[a] += K[a, k] * (reference[k] - Y[k])
        if not abs(U[a]) < np.inf:
            return _KEPT_PREVIOUS, recovery, lost
        for b in range(m):
            if not abs(following[a, b]) < np.inf:
                return _KEPT_PREVIOUS, recovery, lost
    trace, saturated = 0.0, False
    for a in range(m):
        trace += Pu[a, a]
        value, before = min(max(U[a], limits[0, a]), limits[1, a]), control[a]
        value = min(max(value, before - limits[2, a]), before + limits[2, a])
        saturated = saturated or value != U[a]
        control[a] = value
    for a in range(m):
        for b in range(m):
            Pu[a, b] = kept_share * following[a, b]
    for k in range(l):
        predicted[k], innovation[k] = Y[k], reference[k] - Y[k]
    if repaired > ROUNDING * trace or lost > 0 or recovery != _NONE:
        return _REPAIRED, recovery, lost
    return _SATURATED if saturated else _SOLVED, recovery, lost


@kernel
def _weights_left(weights: Array, outputs: Array, saved: Array, left: Array) -> int:
    """Weights (2m+1,) without the points that diverged, scaled to the same sum; returns how many those are.

    Beside a negative central weight the others may sum to nothing or less; equal weights take their place then, as
    they do where hardly any weight is left. Lost rows of outputs and saved are overwritten with zeros.
    """
    lost, total, remaining = 0, 0.0, 0.0
    for i in range(weights.shape[0]):
        alive = True
        for k in range(outputs.shape[1]):
            alive = alive and abs(outputs[i, k]) <= _LARGEST_OUTPUT
        for c in range(saved.shape[1]):
            alive = alive and abs(saved[i, c]) <= _LARGEST_OUTPUT
        total += weights[i]
        left[i] = 1.0 if alive else 0.0
        if alive:
            remaining += weights[i]
        else:
            lost += 1
            for k in range(outputs.shape[1]):
                outputs[i, k] = 0.0
            for c in range(saved.shape[1]):
                saved[i, c] = 0.0
    equal = lost > 0 and (weights[0] < 0.0 or remaining < _LEAST_WEIGHT * total)
    for i in range(weights.shape[0]):
        if left[i] > 0.0:
            left[i] = total / (weights.shape[0] - lost) if equal else weights[i]
            if lost > 0 and not equal:
                left[i] *= total / remaining
    return lost


@kernel
def _covariances(
    saved: Array,
    outputs: Array,
    U: Array,
    Y: Array,
    left: Array,
    about_centre: bool,
    Qu: Array,
    P_err: Array,
    Pu: Array,
    C_y: Array,
    C_uy: Array,
) -> None:
    """Pu of eq:pu_pred, C_y and C_uy of eq:zpred, of deviations from the means or from the central point."""
    mean_U, mean_Y = U, Y
    if about_centre:
        mean_U, mean_Y = saved[0], outputs[0]
    for a in range(Pu.shape[0]):
        for b in range(Pu.shape[0]):
            Pu[a, b] = Qu[a, b]
        for k in range(C_y.shape[0]):
            C_uy[a, k] = 0.0
    for i in range(C_y.shape[0]):
        for k in range(C_y.shape[0]):
            C_y[i, k] = P_err[i, k]
    add_cross_covariance(saved, mean_U, saved, mean_U, left, Pu)
    add_cross_covariance(outputs, mean_Y, outputs, mean_Y, left, C_y)
    add_cross_covariance(saved, mean_U, outputs, mean_Y, left, C_uy)

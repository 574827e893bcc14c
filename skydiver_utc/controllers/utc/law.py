# SPDX-License-Identifier: Apache-2.0
"""A step of UTC: sigma points of the control, the roll-out of the model under each, and the control's update."""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.controllers.protocol import Status
from skydiver_utc.jit import contents, kernel, program
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


class Law(NamedTuple):
    """What a step of the law works with and on, besides the state and the preview.

    steps (T,) of the horizon that count; points (2m+1, m): sigma points; of_roll_out (2m+1, T l): of the roll-out
    outputs (2m+1, L): these, then the controls `nominal`; saved (2m+1, m): U^i of eq:xpred
    tracked: how many outputs the preview is for, of `per_step` at each step of the horizon that counts
    tangent: the reference is continued from now and its next change, instead of taken from the preview
    reference, predicted and innovation (L,), control (m,), Pu (m, m): moved on by each step
    repaired_Pu (m, m): Pu without eigenvalues below the floor
    events (3,): status, recovery and lost points of the step
    """

    steps: NDArray[np.int64]
    points: Array
    of_roll_out: Array
    weights: Array
    W0: float
    floor: float
    kept_share: float
    limits: Array
    P_err: Array
    Qu: Array
    nominal: NDArray[np.int64]
    tracked: int
    per_step: int
    tangent: bool
    outputs: Array
    saved: Array
    reference: Array
    predicted: Array
    innovation: Array
    control: Array
    Pu: Array
    repaired_Pu: Array
    events: NDArray[np.int64]


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
def draw(state: Array, preview: Array, numbers: Law, out: Array) -> None:
    """Sigma points (2m+1, m) of eq:sigp inside the bounds (eq:minmax_utc), and the reference of the horizon.

    A coordinate of the control that lies on its bound would leave points on one side identical: eq:movep mirrors
    them to the inner side, at half the distance.
    """
    law = contents(numbers)
    steps, control, limits, points = law.steps, law.control, law.limits, law.points
    for t in range(steps.shape[0]):
        j = steps[t]
        for k in range(law.tracked):
            wanted = preview[0, k] + j * (preview[1, k] - preview[0, k]) if law.tangent else preview[j, k]
            law.reference[t * law.per_step + k] = wanted
    m = control.shape[0]
    for a in range(m):
        for b in range(m):
            law.repaired_Pu[a, b] = law.Pu[a, b]
    root = np.empty((m, m))
    out[2 * law.tracked + m] = symmetric_root(law.repaired_Pu, law.floor, root)
    spread(control, root, law.W0, points)
    for i in range(points.shape[0]):
        for c in range(m):
            value, low, high = points[i, c], limits[0, c], limits[1, c]
            if (control[c] == low and value < low) or (control[c] == high and value > high):
                value = 1.5 * control[c] - 0.5 * value
            points[i, c] = min(max(value, low), high)


@program
def update(state: Array, preview: Array, numbers: Law, out: Array) -> None:
    """eq:xpred to eq:utc_controller and the bounds; where no update is possible the control stays.

    out: predicted and innovation (l,) each, standard deviation of the controls (m,), what was added to eigenvalues of
    Pu, recovery
    """
    law = contents(numbers)
    outputs, saved, nominal, limits = law.outputs, law.saved, law.nominal, law.limits
    weights, control, reference = law.weights, law.control, law.reference
    m, L = saved.shape[1], outputs.shape[1]
    repaired = out[2 * law.tracked + m]
    for i in range(outputs.shape[0] if nominal.shape[0] > 0 else 0):
        for k in range(law.of_roll_out.shape[1]):
            outputs[i, k] = law.of_roll_out[i, k]
        for k in range(nominal.shape[0]):
            outputs[i, L - nominal.shape[0] + k] = saved[i, nominal[k]]
    left = np.empty(weights.shape[0])
    lost = _weights_left(weights, outputs, saved, left)
    law.events[0], law.events[1], law.events[2] = _KEPT_PREVIOUS, _NONE, lost
    if lost == outputs.shape[0]:
        return
    U, Y = np.empty(m), np.empty(L)
    weighted_mean(saved, left, U)
    weighted_mean(outputs, left, Y)
    following, C_y, K = np.empty((m, m)), np.empty((L, L)), np.empty((m, L))
    found, recovery = False, _NONE
    for attempt in range(3):
        if found or (attempt == _ABOUT_CENTRE and not left[0] < 0.0):
            continue
        recovery = attempt
        _covariances(
            saved, outputs, U, Y, left, attempt == _ABOUT_CENTRE, law.Qu, law.P_err, following, C_y, K
        )  # fmt: skip
        if attempt == _OUTPUTS_REPAIRED:
            trace = 0.0
            for k in range(L):
                trace += C_y[k, k]
            for k in range(L):
                C_y[k, k] += _LEAST_OUTPUT_SHARE * trace
        found = gain(C_y, K, following)
    if not found:
        return
    finite = True
    for a in range(m):
        for k in range(L):
            U[a] += K[a, k] * (reference[k] - Y[k])
        finite &= abs(U[a]) < np.inf
        for b in range(m):
            finite &= abs(following[a, b]) < np.inf
    if not finite:
        return
    trace, saturated = 0.0, False
    for a in range(m):
        trace += law.repaired_Pu[a, a]
        value, before = min(max(U[a], limits[0, a]), limits[1, a]), control[a]
        value = min(max(value, before - limits[2, a]), before + limits[2, a])
        saturated = saturated or value != U[a]
        control[a] = value
    for a in range(m):
        for b in range(m):
            law.Pu[a, b] = law.kept_share * following[a, b]
    for k in range(L):
        law.predicted[k], law.innovation[k] = Y[k], reference[k] - Y[k]
    status = _SATURATED if saturated else _SOLVED
    if repaired > ROUNDING * trace or lost > 0 or recovery != _NONE:
        status = _REPAIRED
    law.events[0], law.events[1] = status, recovery
    for k in range(law.tracked):
        out[k], out[law.tracked + k] = law.predicted[k], law.innovation[k]
    for a in range(m):
        out[2 * law.tracked + a] = np.sqrt(max(law.Pu[a, a], 0.0))
    out[2 * law.tracked + m + 1] = recovery


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

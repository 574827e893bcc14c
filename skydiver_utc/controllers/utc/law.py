# SPDX-License-Identifier: Apache-2.0
"""A step of UTC: sigma points of the control, the roll-out of the model under each, and the control's update."""

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from skydiver_utc.arrays import Array, Flags, Integers
from skydiver_utc.controllers.protocol import Status
from skydiver_utc.controllers.utc.survivors import next_spread, survived_range, weights_left
from skydiver_utc.controllers.utc.verdict import not_reached, without_effect
from skydiver_utc.jit import kernel, program
from skydiver_utc.unscented.covariance import symmetric_root
from skydiver_utc.unscented.linear_algebra import gain, raise_diagonal, trace
from skydiver_utc.unscented.sigma_points import TURN, add_cross_covariance, spread, unwrap, weighted_mean


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
    """Numbers and arrays of a step of the law, besides the state and the preview.

    steps (T,) of the horizon that count; points (2m+1, m): sigma points; of_roll_out (2m+1, T l): of the roll-out
    outputs (2m+1, L): these, then the controls `nominal`; saved (2m+1, m): U^i of eq:xpred
    tracked: how many outputs the preview is for, of `per_step` at each step of the horizon that counts
    tangent: the reference is continued from now and its next change, instead of taken from the preview
    angles: which of the L outputs are angles, whose means and differences are those on the circle
    of_control: the innovation counts from the output of the control itself instead of from the mean output
    offset (L,): what the plant's output is above the model's, as estimated
    reference, mean Y, predicted and innovation (L,), control (m,), Pu (m, m): moved on by each step
    repaired_Pu (m, m): Pu without eigenvalues below the floor
    gain (m, L): K; unmoved (per_step,): whether no control moves an output over its range
    alive (2m+1,): 1 for the points that did not diverge, else 0
    spread (1,): at which share of their distance from the centre points are drawn
    watch (2 + L,): the smallest innovation since the reference last moved, in units of sqrt(P_err), the steps since
        then, and the reference there; patience: after how many of them it counts as not reached
    singly (1,): whether controls are tried one by one, without covariances in Pu and Qu
    scratch: root and following (m, m), vectors (m+1, m), left (2m+1,), U (m,), at (L,), C_y (L, L); of the R =
        T l outputs of the roll-out found (1, R), and rest (1, 1)
    """

    steps: Integers
    points: Array
    of_roll_out: Array
    weights: Array
    floor: float
    kept_share: float
    limits: Array
    P_err: Array
    Qu: Array
    nominal: Integers
    tracked: int
    per_step: int
    tangent: bool
    angles: Integers
    of_control: bool
    outputs: Array
    saved: Array
    offset: Array
    reference: Array
    predicted: Array
    innovation: Array
    control: Array
    Pu: Array
    repaired_Pu: Array
    gain: Array
    unmoved: Flags
    alive: Array
    spread: Array
    watch: Array
    patience: int
    singly: Flags
    root: Array
    following: Array
    vectors: Array
    left: Array
    U: Array
    Y: Array
    at: Array
    C_y: Array
    found: Array
    rest: Array


# A repair of Pu below this share of its trace is rounding, and no reason to call a step repaired.
ROUNDING = 1e-15
# Share of its trace that is added to the diagonal of a C_y that rounding made indefinite.
_LEAST_OUTPUT_SHARE = 1e-14
# Literals for the kernels.
_SOLVED, _SATURATED = int(Status.SOLVED), int(Status.SATURATED)
_REPAIRED, _KEPT_PREVIOUS = int(Status.REPAIRED), int(Status.KEPT_PREVIOUS)
_NO_EFFECT, _NOT_REACHED = int(Status.NO_EFFECT), int(Status.NOT_REACHED)
_NONE, _ABOUT_CENTRE, _OUTPUTS_REPAIRED = 0, 1, 2


@program
def draw(state: Array, preview: Array, law: Law, out: Array) -> None:
    """Sigma points (2m+1, m) of eq:sigp inside the bounds (eq:minmax_utc), and the reference of the horizon.

    A coordinate of the control that lies on its bound would leave points on one side identical: eq:movep mirrors
    them to the inner side, at half the distance.
    """
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
            if law.singly[0] and a != b:
                law.repaired_Pu[a, b] = law.Qu[a, b] = 0.0
    root = law.root
    out[2 * law.tracked + m] = symmetric_root(law.repaired_Pu, law.floor, root, law.vectors)
    for a in range(m):
        for b in range(m):
            root[a, b] *= law.spread[0]
    spread(control, root, law.weights[0], points)
    for i in range(points.shape[0]):
        for c in range(m):
            value, low, high = points[i, c], limits[0, c], limits[1, c]
            if (control[c] == low and value < low) or (control[c] == high and value > high):
                value = 1.5 * control[c] - 0.5 * value
            points[i, c] = min(max(value, low), high)


@program
def update(state: Array, preview: Array, law: Law, out: Array) -> None:
    """eq:xpred to eq:utc_controller and the bounds; where no update is possible the control stays.

    out: predicted and innovation (l,) each, standard deviation of the controls (m,), what was added to eigenvalues of
    Pu, recovery, how many points diverged, status
    """
    outputs, saved, nominal, limits = law.outputs, law.saved, law.nominal, law.limits
    weights, control, reference = law.weights, law.control, law.reference
    m, L, of_roll_out = saved.shape[1], outputs.shape[1], law.of_roll_out.shape[1]
    repaired = out[2 * law.tracked + m]
    for i in range(outputs.shape[0]):
        for k in range(of_roll_out):
            outputs[i, k] = law.of_roll_out[i, k]
        for k in range(nominal.shape[0]):
            outputs[i, L - nominal.shape[0] + k] = saved[i, nominal[k]]
    left, alive = law.left, law.alive
    lost = weights_left(weights, outputs, saved, left, alive)
    out[2 * law.tracked + m + 2], out[2 * law.tracked + m + 3] = lost, _KEPT_PREVIOUS
    narrow = law.spread[0] < 1.0
    law.spread[0] = next_spread(law.spread[0], alive, lost)
    if lost == outputs.shape[0]:
        return
    for t in range(law.angles.shape[0]):
        unwrap(outputs, alive, law.angles[t])
    U, Y = law.U, law.Y
    weighted_mean(saved, left, U)
    weighted_mean(outputs, left, Y)
    following, C_y, K = law.following, law.C_y, law.gain
    e, at = law.innovation, law.at
    found = False
    for attempt in (_NONE, _ABOUT_CENTRE, _OUTPUTS_REPAIRED):
        if found or (attempt == _ABOUT_CENTRE and not left[0] < 0.0):
            continue
        recovery = attempt
        _covariances(law, attempt == _ABOUT_CENTRE)
        if attempt == _OUTPUTS_REPAIRED:
            raise_diagonal(C_y, _LEAST_OUTPUT_SHARE)
        unmoved = without_effect(following, K, law.P_err, limits, of_roll_out, law.unmoved)
        found = gain(C_y, K, following)
    if not found:
        return
    for k in range(L):
        at[k] = Y[k]
    # Beside a lost point the mean would move away from it, step by step.
    if narrow and alive[0] > 0.0:
        for a in range(m):
            U[a] = saved[0, a]
        for k in range(L):
            at[k] = outputs[0, k]
    elif law.of_control and alive[0] > 0.0:
        _answer_of_mean(law)
        for k in range(L):
            at[k] += outputs[0, k]
    for k in range(L):
        at[k] += law.offset[k]
        e[k] = reference[k] - at[k]
    for t in range(law.angles.shape[0]):
        k = law.angles[t]
        e[k] -= TURN * np.rint(e[k] / TURN)
    finite = True
    for a in range(m):
        for k in range(L):
            U[a] += K[a, k] * e[k]
        finite &= np.isfinite(U[a])
        for b in range(m):
            finite &= np.isfinite(following[a, b])
    if not finite:
        return
    saturated = False
    for a in range(m):
        low, high = limits[0, a], limits[1, a]
        if narrow:
            low, high = survived_range(saved, alive, a, low, high)
        value, before = min(max(U[a], low), high), control[a]
        value = min(max(value, before - limits[2, a]), before + limits[2, a])
        saturated = saturated or value != U[a]
        control[a] = value
    for a in range(m):
        for b in range(m):
            law.Pu[a, b] = law.kept_share * following[a, b]
    for k in range(L):
        law.predicted[k] = at[k]
    status = _SATURATED if saturated else _SOLVED
    if repaired > ROUNDING * trace(law.repaired_Pu) or lost > 0 or recovery != _NONE:
        status = _REPAIRED
    if not_reached(
        e, reference, law.P_err, of_roll_out, law.patience, law.watch, law.singly
    ):  # fmt: skip
        status = _NOT_REACHED
    if unmoved and lost == 0 and not narrow:
        status = _NO_EFFECT
    for k in range(law.tracked):
        out[k], out[law.tracked + k] = at[k], e[k]
    for a in range(m):
        out[2 * law.tracked + a] = np.sqrt(max(law.Pu[a, a], 0.0))
    out[2 * law.tracked + m + 1], out[2 * law.tracked + m + 3] = recovery, status


@kernel
def _answer_of_mean(law: Law) -> None:
    """Write `at` (L,), the innovation that the gain would turn into the distance of the mean from the control.

    The mean of points at bounds lies beside the control. Without this the update would follow it there, away from the
    reference; with it, it does so only where no output sees it. C_y is overwritten.
    """
    K, P_err, Pu, U, control = law.gain, law.P_err, law.repaired_Pu, law.U, law.saved[0]
    squares, found, answer = law.C_y, law.found, law.at
    size = found.shape[1]
    for i in range(size):
        found[0, i] = 0.0
    for i in range(len(squares)):
        for k in range(len(squares)):
            squares[i, k] = 0.0
    for i in range(size):
        unit = np.sqrt(P_err[i, i])
        for a in range(K.shape[0]):
            share = K[a, i] * unit / Pu[a, a]
            found[0, i] += share * (U[a] - control[a])
            for k in range(size):
                squares[i, k] += share * K[a, k] * np.sqrt(P_err[k, k])
    raise_diagonal(squares, _LEAST_OUTPUT_SHARE)
    solved = gain(squares, found, law.rest)
    for k in range(answer.shape[0]):
        answer[k] = found[0, k] * np.sqrt(P_err[k, k]) if solved and k < size else 0.0


@kernel
def _covariances(law: Law, about_centre: bool) -> None:
    """Pu of eq:pu_pred, C_y and C_uy of eq:zpred, of deviations from the means or from the central point."""
    saved, outputs, left, Qu, P_err = law.saved, law.outputs, law.left, law.Qu, law.P_err
    Pu, C_y, C_uy, U, Y = law.following, law.C_y, law.gain, law.U, law.Y
    if about_centre:
        U, Y = saved[0], outputs[0]
    for a in range(len(Pu)):
        for b in range(len(Pu)):
            Pu[a, b] = Qu[a, b]
        for k in range(len(C_y)):
            C_uy[a, k] = 0.0
    for i in range(len(C_y)):
        for k in range(len(C_y)):
            C_y[i, k] = P_err[i, k]
    add_cross_covariance(saved, U, saved, U, left, Pu)
    add_cross_covariance(outputs, Y, outputs, Y, left, C_y)
    add_cross_covariance(saved, U, outputs, Y, left, C_uy)

# SPDX-License-Identifier: Apache-2.0
"""The Unscented Transform Controller, written out from the paper alone, as an oracle for tests.

Paper: A. Clarke, P.-O. Gutman, "The Unscented Transform Controller: a new model predictive control
law for highly nonlinear systems". Every function restates the equation that it transcribes, under
the LaTeX label of the paper. Plain NumPy and SciPy, one sigma point at a time, no thought for speed.

This module must never import the code under test.

Notation: U = [Cm_damp_yaw, k_right, k_left, alpha], m = 4 controls; alpha is always the last element.
Y are the l outputs at the horizon, r = yr_ref on the grid of steps, N = t_pred / dt prediction steps.
U_k/k is the control that acts up to step k; the step computes U_k+1/k+1, which acts on [t_k, t_k+1).
Where the paper can be read in more than one way, this is the reading that the package flies; the others are in
studies/paper_variants.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import sqrtm

Array = NDArray[np.float64]
Plant = Callable[[Array, Array, float], Array]  # (x, u, dt) -> x one step later

ALPHA = -1  # alpha is the last control
U_INITIAL = (0.5, 0.0, 0.0, 0.0)  # U_k/k at k = 0
U_MIN = (0.01, 0.0, 0.0, -1.5)  # eq:minmax_utc
U_MAX = (6.0, 5.0, 5.0, 1.5)  # eq:minmax_utc
SLEW = 3.5  # rad/s, eq:lim
VARIANCES = (6.25, 0.01, 0.01, 0.01)  # diagonal of Pu at k = 0
Q12, Q13, Q14 = 0.74, 0.74, 0.56  # first row of Pu at k = 0, without the signs


# --------------------------------------------------------------------------- posture controller


def slew(command: float, previous: float, rate: float, dt: float) -> float:
    """eq:lim, |du/dt| <= rate: the command moves at most rate * dt away from the previous value."""
    return float(np.clip(command, previous - rate * dt, previous + rate * dt))


def pose_controller(
    yr_ref: float,
    yr_real: float,
    u_previous: float,
    dt: float,
    Kp: float = 1.5,
    KFF: float = 0.1,
    u_max: float = 1.5,
    rate: float = SLEW,
) -> float:
    """eq:lim: u = 1.5 (yr_ref - yr_real) + 0.1 yr_ref, -1.5 <= u <= 1.5 rad, -3.5 <= du/dt <= 3.5 rad/s.

    Magnitude first, then slew rate. As long as u_previous keeps the magnitude limit both orders
    give the same u, since the two intervals then overlap.
    """
    u = Kp * (yr_ref - yr_real) + KFF * yr_ref
    return slew(float(np.clip(u, -u_max, u_max)), u_previous, rate, dt)


# --------------------------------------------------------------------------- covariances and their signs


def initial_covariance(s12: float, s13: float, s14: float) -> Array:
    """Pu_k/k at k = 0, as printed (indefinite for every choice of signs; not repaired here).

    [ 6.25      s12 .74   s13 .74   s14 .56 ]
    [ s12 .74   .01       0         0       ]
    [ s13 .74   0         .01       0       ]
    [ s14 .56   0         0         .01     ]
    """
    P = np.diag(VARIANCES)
    P[0, 1:] = P[1:, 0] = [s12 * Q12, s13 * Q13, s14 * Q14]
    return P


def process_noise(s12: float, s13: float, s14: float, scale: float = 0.1) -> Array:
    """Qu = Pu_k=0 * 0.1, with the signs of the step k at which it is added.

    So q_1,2 and q_1,3 of eq_q1 and eq_q3 are .074. Not repaired: it is added as printed.
    """
    return scale * initial_covariance(s12, s13, s14)


def sign_or_keep(value: float, kept: float) -> float:
    """sign(value), where sign(0) keeps the value given."""
    return kept if value == 0.0 else float(np.sign(value))


def coupling_signs(
    kind: str, yr_ref_k: float, yr_ref_k1: float, sign_of_zero: float = 0.0
) -> tuple[float, float]:
    """(s12, s13): the signs of the covariance elements 1,2 (k_right) and 1,3 (k_left), counted from 1.

    'eq_q1':  Qu_12 = +q_12 sign(yr_ref),        Qu_13 = -q_13 sign(yr_ref)
    'eq_q3':  Qu_12 = +q_12 sign(d/dt yr_ref),   Qu_13 = +q_13 sign(d/dt yr_ref)
    'none':   Qu_12 = Qu_13 = 0

    yr_ref is taken at step k, d/dt yr_ref as the forward difference from k to k + 1 (as Delta(k) in
    eq:s14). The paper is silent on sign(0): pass the last non-zero sign as `sign_of_zero` to keep it.
    """
    if kind == "none":
        return 0.0, 0.0
    if kind == "eq_q1":
        s = sign_or_keep(yr_ref_k, sign_of_zero)
        return s, -s
    if kind == "eq_q3":
        s = sign_or_keep(yr_ref_k1 - yr_ref_k, sign_of_zero)
        return s, s
    raise ValueError(f"unknown coupling {kind!r}")


def s14_sequence(
    reference: ArrayLike, k_hyst: int, steps: int, times_reference_sign: bool = False, initial: float = -1.0
) -> Array:
    """s14(k) for k = 0 .. steps-1; the reference (signed, or its magnitude) starts at step 0.

    eq:s14:
        Delta(k)      = |yr_ref(k+1)| - |yr_ref(k)|
        Delta_hyst(k) = |yr_ref(k+k_hyst+1)| - |yr_ref(k+k_hyst)|
        s14(k)        = -sign(Delta(k))        if s14(k-1) > 0
                        -sign(Delta_hyst(k))   if s14(k-1) <= 0

    times_reference_sign: the result is s14(k) sign(yr_ref(k)); the recursion runs on the raw s14.

    sign(0) keeps the previous value: s14(k) = s14(k-1) if the difference in use is zero (so it is the
    previous s14 that is kept, not the previous sign of that difference); the sign of yr_ref keeps its
    own previous value, and is 1 until yr_ref first differs from zero.
    "The initial s14 = -1" is read as s14(-1) = -1, with the rule already in force at k = 0.
    """
    r = np.asarray(reference, dtype=float)
    raw, reference_sign, result = initial, 1.0, []
    for k in range(steps):
        ahead = k_hyst if raw <= 0.0 else 0
        raw = sign_or_keep(abs(r[k + ahead]) - abs(r[k + ahead + 1]), raw)
        reference_sign = sign_or_keep(r[k], reference_sign)
        result.append(raw * reference_sign if times_reference_sign else raw)
    return np.array(result)


def repair(P: ArrayLike, floor: float) -> Array:
    """The nearest usable covariance: symmetrise, then raise every eigenvalue below the floor to the floor.

    Not in the paper, whose Pu at k = 0 has the eigenvalue -.208 and hence no real square root.
    """
    P = np.asarray(P, dtype=float)
    values, vectors = np.linalg.eigh((P + P.T) / 2.0)
    repaired: Array = (vectors * np.maximum(values, floor)) @ vectors.T
    return repaired


def matrix_square_root(P: ArrayLike) -> Array:
    """The symmetric S with S S = P, for a P that is already repaired (eq:sigp: S . S = Pu_k/k).

    By SciPy's Schur method, on purpose not by the eigenvectors that `repair` uses.
    """
    S: Array = np.real(np.asarray(sqrtm(np.asarray(P, dtype=float))))
    symmetric: Array = 0.5 * (S + S.T)
    return symmetric


# --------------------------------------------------------------------------- sigma points


def sigma_points(U: ArrayLike, P: ArrayLike, W0: float) -> Array:
    """eq:sigp, shape (2m+1, m), one point per row; P is already repaired.

    U^0 = U_k/k,   U^i = U_k/k +- sqrt(n / (1 - W0)) S_j,   i = 1 .. 2m, j = 1 .. m, S S = Pu_k/k.

    n is not defined in the paper: n = m, with which the points reproduce P.
    Order: U^j = U + ... S_j for j = 1 .. m, then U^(m+j) = U - ... S_j for j = 1 .. m.
    """
    U = np.asarray(U, dtype=float)
    m = U.size
    offsets = np.sqrt(m / (1.0 - W0)) * matrix_square_root(P).T  # row j is column j of S
    return np.vstack([U[None, :], U + offsets, U - offsets])


def weights(m: int, W0: float) -> Array:
    """eq:sigp, W^0 .. W^2m: W^0 = W0, W^i = (1 - W0) / (2m) for i = 1 .. 2m; they sum to 1."""
    return np.array([W0] + [(1.0 - W0) / (2.0 * m)] * (2 * m))


def bound(points: ArrayLike, U: ArrayLike, umin: ArrayLike, umax: ArrayLike) -> Array:
    """eq:minmax_utc with eq:movep, for all points (rows) and elements j.

    eq:movep: if U_k/k(j) is at its min (max) and U^i(j) < min(j) (> max(j)), then
              U^i(j) = 1.5 U_k/k(j) - 0.5 U^i(j).

    The rule sees the point as drawn, then the point is bounded.
    "Equals" is exact equality; U_k/k is itself a bounded value.
    """
    drawn, mean = np.asarray(points, dtype=float), np.asarray(U, dtype=float)
    low, high = np.asarray(umin, dtype=float), np.asarray(umax, dtype=float)
    beyond = ((mean == low) & (drawn < low)) | ((mean == high) & (drawn > high))
    return np.clip(np.where(beyond, 1.5 * mean - 0.5 * drawn, drawn), low, high)


# --------------------------------------------------------------------------- dynamics of alpha


def alpha_increment(
    r: float,
    r_before: float,
    y: float,
    y_before: float,
    r_ahead: float,
    r_ahead_before: float,
    Kp: float,
    KFF: float,
) -> float:
    """eq:m1utc, alpha(t) - alpha(t-dt):

    + K_p (yr_ref(t) - yr_ref(t-dt)) - K_p (yr_real(t) - yr_real(t-dt))
    + K_FF (yr_ref(t+tau) - yr_ref(t+tau-dt))
    """
    return Kp * (r - r_before) - Kp * (y - y_before) + KFF * (r_ahead - r_ahead_before)


# --------------------------------------------------------------------------- settings


@dataclass(frozen=True)
class Settings:
    """Numbers of the paper, with unknown dynamics of alpha and 20 steps."""

    dt: float = 0.0042
    N: int = 20
    W0: float = 0.25
    P_err: float | Array = 0.01**2  # scalar for l = 1, otherwise (l, l)
    umin: Array = field(default_factory=lambda: np.array(U_MIN))
    umax: Array = field(default_factory=lambda: np.array(U_MAX))
    rate: float = SLEW
    Kp: float = 1.5
    KFF: float = 0.1
    tau: int = 0  # in steps
    floor: float = 1e-9  # of the eigenvalues of Pu when the sigma points are drawn
    known_dynamics: bool = False  # of alpha; see `propagate`


class Propagated(NamedTuple):
    Y: Array  # (l,) output at the horizon
    U: Array  # (m,) the control to be saved
    applied: Array  # (N, m) the controls that drove the plant, j = 1 .. N
    commanded_alpha: Array  # (N,) alpha before bounds and slew rate, j = 1 .. N


def propagate(
    point: Array,
    alpha_before: float,
    x: Array,
    reference: Array,
    plant: Plant,
    g: Callable[[Array], ArrayLike],
    yaw_rate: Callable[[Array], float],
    s: Settings,
) -> Propagated:
    """One bounded sigma point drives the plant from X_k to the horizon: X_k, U^i_k+j -> X^i_k+j, j = 1 .. N.

    reference[i] = yr_ref(k + i), i = 0 .. N + tau at least. alpha_before is the alpha of U_k/k, the one
    applied up to t_k. The control U^i_k+j acts on [t_k+j-1, t_k+j): Cm_damp, k_right and k_left are
    constant, alpha_j is commanded by the dynamics below, then bounded, then slew-rate limited against
    the alpha applied one step before (for j = 1: alpha_before).

    Where the dynamics of alpha are not known, alpha_j = the sigma point's own alpha, and U^i is the point itself.
    Where they are known, by eq:m1utc, with y_j = yr_real predicted at k + j, known up to y_j-1 when alpha_j is set:
        alpha_j = alpha_j-1 + Kp (r[k+j] - r[k+j-1]) - Kp (y_j-1 - y_j-2) + KFF (r[k+j+tau] - r[k+j+tau-1])
    alpha_0 is the sigma point's own alpha, alpha_j-1 the one left by bounds and slew rate, and y_-1 := y_0 since only
    X_k is given. U^i (eq:xpred) is then the control of the first prediction step, which is the next to act.
    """
    umin, umax = float(s.umin[ALPHA]), float(s.umax[ALPHA])
    y = yaw_rate(x)
    y_last = y
    own = base = float(point[ALPHA])
    applied_alpha, applied, commanded = alpha_before, [], []
    for j in range(1, s.N + 1):
        command = own
        if s.known_dynamics:
            ahead, ahead_last = reference[j + s.tau], reference[j + s.tau - 1]
            command = base + alpha_increment(
                reference[j], reference[j - 1], y, y_last, ahead, ahead_last, s.Kp, s.KFF
            )
        base = applied_alpha = slew(float(np.clip(command, umin, umax)), applied_alpha, s.rate, s.dt)
        u = np.append(point[:ALPHA], applied_alpha)
        x = plant(x, u, s.dt)
        y_last, y = y, yaw_rate(x)
        applied.append(u)
        commanded.append(command)
    saved = applied[0] if s.known_dynamics else np.array(point, dtype=float)
    Y = np.atleast_1d(np.asarray(g(x), dtype=float))
    return Propagated(Y, saved, np.array(applied), np.array(commanded))


# --------------------------------------------------------------------------- prediction and update


def predict(points: Array, W: Array, Qu: Array) -> tuple[Array, Array]:
    """eq:xpred   U_k+1/k  = sum W^i U^i
    eq:pu_pred    Pu_k+1/k = Qu + sum W^i (U^i - U_k+1/k)(U^i - U_k+1/k)^T

    The points are the saved ones. The mean is taken over the points after bounds and eq:movep.
    """
    U = W @ points
    D = points - U
    return U, Qu + (W[:, None] * D).T @ D


class Updated(NamedTuple):
    U: Array  # U_k+1/k+1, before bounds and slew rate
    Pu: Array  # Pu_k+1/k+1
    K: Array  # (m, l)
    C_y: Array  # (l, l)
    C_uy: Array  # (m, l)
    Ypred: Array  # (l,)


def update(
    U_pred: Array,
    Pu_pred: Array,
    points: Array,
    Y: Array,
    W: Array,
    y_ref: ArrayLike,
    P_err: float | Array,
) -> Updated:
    """eq:zpred and eq:utc_controller, for any number l of outputs (Y has shape (2m+1, l)).

    Ypred_k = sum W^i Y^i
    C_y     = P_err + sum W^i (Y^i - Ypred_k)(Y^i - Ypred_k)^T
    C_uy    = sum W^i (U^i - U_k+1/k)(Y^i - Ypred_k)^T
    K       = C_uy C_y^-1
    U_k+1/k+1  = U_k+1/k + K (Y_ref(k dt + t_pred) - Ypred_k)
    Pu_k+1/k+1 = Pu_k+1/k - K C_y K^T
    """
    Ypred = W @ Y
    dY, dU = Y - Ypred, points - U_pred
    l_outputs = Ypred.size
    C_y = np.reshape(np.asarray(P_err, dtype=float), (l_outputs, l_outputs)) + (W[:, None] * dY).T @ dY
    C_uy = (W[:, None] * dU).T @ dY
    K = np.linalg.solve(C_y.T, C_uy.T).T
    U = U_pred + K @ (np.atleast_1d(np.asarray(y_ref, dtype=float)) - Ypred)
    return Updated(U, Pu_pred - K @ C_y @ K.T, K, C_y, C_uy, Ypred)


class Step(NamedTuple):
    U: Array  # U_k+1/k+1, bounded and slew-rate limited: acts on [t_k, t_k+1)
    Pu: Array  # Pu_k+1/k+1, neither repaired nor symmetrised
    drawn: Array  # (2m+1, m) sigma points before bounds
    points: Array  # (2m+1, m) sigma points bounded
    saved: Array  # (2m+1, m) controls saved for the sums
    Y: Array  # (2m+1, l)
    U_pred: Array
    Pu_pred: Array
    updated: Updated


def constrain(U: Array, U_previous: Array, s: Settings) -> Array:
    """The updated controller is bounded according to eq:minmax_utc, and the slew rate constraint eq:lim."""
    U = np.clip(U, s.umin, s.umax)
    U[ALPHA] = slew(float(U[ALPHA]), float(U_previous[ALPHA]), s.rate, s.dt)
    return U


def utc_step(
    U: Array,
    Pu: Array,
    x: Array,
    reference: Array,
    Qu: Array,
    plant: Plant,
    g: Callable[[Array], ArrayLike],
    yaw_rate: Callable[[Array], float],
    s: Settings,
    y_ref: ArrayLike | None = None,
) -> Step:
    """U_k/k, Pu_k/k, X_k -> U_k+1/k+1, Pu_k+1/k+1.

    Sigma points, bounds, propagation, prediction, update, limits. reference[i] = yr_ref(k + i).
    y_ref is Y_ref(k dt + t_pred), by default yr_ref(k + N) (eq:meas_utc, l = 1).
    Pu_k/k is repaired for drawing the sigma points, and nowhere else. Qu is that of step k.
    """
    U, reference = np.asarray(U, dtype=float), np.asarray(reference, dtype=float)
    drawn = sigma_points(U, repair(Pu, s.floor), s.W0)
    points = bound(drawn, U, s.umin, s.umax)
    runs = [propagate(p, float(U[ALPHA]), x, reference, plant, g, yaw_rate, s) for p in points]
    saved, Y = np.array([run.U for run in runs]), np.array([run.Y for run in runs])
    W = weights(U.size, s.W0)
    U_pred, Pu_pred = predict(saved, W, Qu)
    up = update(U_pred, Pu_pred, saved, Y, W, reference[s.N] if y_ref is None else y_ref, s.P_err)
    return Step(constrain(up.U, U, s), up.Pu, drawn, points, saved, Y, U_pred, Pu_pred, up)


# --------------------------------------------------------------------------- independent closed forms


def linear_oracle(u0: ArrayLike, Pu: ArrayLike, B: ArrayLike, R: ArrayLike, r: ArrayLike) -> Array:
    """The update for y = B u with no bound active: u0 + K (r - B u0), K = Pu B' (B Pu B' + R)^-1.

    Pu is the covariance that the sigma points are drawn from; Qu is added later and is not in the gain.
    """
    u0, Pu, B, R, r = (np.asarray(a, dtype=float) for a in (u0, Pu, B, R, r))
    u: Array = u0 + Pu @ B.T @ np.linalg.solve(B @ Pu @ B.T + R, r - B @ u0)
    return u


# The paper's axes x, y, z as rows in body axes FLU (x to the head, y to the left, z dorsal). It says z longitudinal, y
# sagittal, and no direction; both are right-handed with x to the left.
PAPER_AXES = {
    # y dorsal, z to the head: a positive yaw rate about y is a turn to the left, as in the paper's text.
    "ventral": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    # y ventral, z to the feet: a positive yaw rate about y is a turn to the right.
    "dorsal": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]]),
}


def hand_moment_and_force(
    k_right: float, k_left: float, K_N: float = 100.0, lx: float = 0.35, force: str = "ventral"
) -> tuple[Array, Array]:
    """eq_force2, as (moment, force) vectors in body axes FLU; `force` is the direction that the axes give it.

    Printed:  Mz_hands = K_N lx_hand (k_right - k_left),   Fy_hands = -K_N (k_right + k_left)
    """
    axes = PAPER_AXES[force]
    moment, push = (
        np.array([0.0, 0.0, K_N * lx * (k_right - k_left)]),
        np.array([0.0, -K_N * (k_right + k_left), 0.0]),
    )
    return axes.T @ moment, axes.T @ push

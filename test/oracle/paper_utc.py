# SPDX-License-Identifier: Apache-2.0
"""The Unscented Transform Controller, written out from the paper alone, as an oracle for tests.

Paper: A. Clarke, P.-O. Gutman, "The Unscented Transform Controller: a new model predictive control
law for highly nonlinear systems". Every function restates the equation that it transcribes, under
the LaTeX label of the paper. Plain NumPy, one sigma point at a time, no thought for speed.

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

import numpy as np
from numpy.typing import ArrayLike, NDArray
from plain_utc import Problem, Updated, predict, sigma_points, step, update, weights  # noqa: F401

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


def pose_controller(yr_ref: float, yr_real: float, u_previous: float, dt: float) -> float:
    """eq:lim: u = 1.5 (yr_ref - yr_real) + 0.1 yr_ref, -1.5 <= u <= 1.5 rad, -3.5 <= du/dt <= 3.5 rad/s.

    Magnitude first, then slew rate. As long as u_previous keeps the magnitude limit both orders
    give the same u, since the two intervals then overlap.
    """
    u = np.clip(1.5 * (yr_ref - yr_real) + 0.1 * yr_ref, -1.5, 1.5)
    return float(np.clip(u, u_previous - SLEW * dt, u_previous + SLEW * dt))


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
    known_dynamics: bool = False  # of alpha; see `alpha_by_the_pose`


# --------------------------------------------------------------------------- dynamics of alpha


def alpha_by_the_pose(
    reference: Array, yaw_rate: Callable[[Array], float], s: Settings
) -> Callable[..., Array]:
    """eq:m1utc as `plain_utc` takes it: the control U^i_k+j commanded at step j - 1 of the horizon.

    alpha_j = alpha_j-1 + Kp (r[k+j] - r[k+j-1]) - Kp (y_j-1 - y_j-2) + KFF (r[k+j+tau] - r[k+j+tau-1])

    y_j = yr_real predicted at k + j, known up to y_j-1 when alpha_j is set; y_-1 := y_0 since only X_k is given.
    alpha_0 is the sigma point's own alpha, alpha_j-1 the one left by bounds and slew rate. The control that is
    saved for eq:xpred is that of the first prediction step, which is the next to act.
    """
    r, y_before = reference, 0.0

    def control(point: Array, before: Array, x: Array, _preview: object, j: int) -> Array:
        nonlocal y_before
        y = yaw_rate(x)
        base, y_before = (point[ALPHA], y) if j == 0 else (before[ALPHA], y_before)
        ahead = j + s.tau
        change = s.Kp * (r[j + 1] - r[j] - y + y_before) + s.KFF * (r[ahead + 1] - r[ahead])
        y_before = y
        return np.append(point[:ALPHA], base + change)

    return control


def utc_step(
    U: ArrayLike,
    Pu: Array,
    x: Array,
    reference: ArrayLike,
    Qu: Array,
    plant: Plant,
    g: Callable[[Array], ArrayLike],
    yaw_rate: Callable[[Array], float],
    s: Settings,
    y_ref: ArrayLike | None = None,
) -> Updated:
    """U_k/k, Pu_k/k, X_k -> U_k+1/k+1, Pu_k+1/k+1, by `plain_utc` under the paper's settings.

    reference[i] = yr_ref(k + i), i = 0 .. N + tau at least.
    y_ref is Y_ref(k dt + t_pred), by default yr_ref(k + N) (eq:meas_utc, l = 1).
    Where the dynamics of alpha are not known, alpha is the sigma point's own, and the point itself is saved.
    """
    U, r = np.asarray(U, dtype=float), np.asarray(reference, dtype=float)
    change = np.full(U.size, np.inf)
    change[ALPHA] = s.rate * s.dt
    problem = Problem(
        plant, g, s.dt, (s.N,), s.umin, s.umax, change, np.asarray(s.P_err), s.W0, s.floor,
        alpha_by_the_pose(r, yaw_rate, s) if s.known_dynamics else None,
    )  # fmt: skip
    wanted = {s.N: np.atleast_1d(r[s.N] if y_ref is None else y_ref)}
    return step(U, Pu, x, wanted, Qu, problem)


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

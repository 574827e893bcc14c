# SPDX-License-Identifier: Apache-2.0
"""The skydiver's equations of motion for one posture, written out in plain NumPy, as an oracle for tests.

This module must never import the code under test.

World ENU, body FLU (x to the head, y to the left, z dorsal), origin at the centre of mass. SI, radians.
State x, shape (13,): position in world (3), quaternion x y z w body -> world (4), velocity of the centre
of mass in body (3), body rates in body (3). Control u, shape (4,): Cm_damp_yaw, k_right, k_left, alpha.
The posture belongs to u[3]; it is handed in, already worked out. `state_derivative` neglects the velocity of the
segments relative to the body while the posture changes (quasi-static posture), `moving_step` does not. The air is
still.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from paper_utc import hand_moment_and_force

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Posture:
    r: Array  # (16, 3) m, where each segment's drag acts, from the centre of mass, body axes
    R: Array  # (16, 3, 3) segment axes -> body axes
    CdA: Array  # (16, 3) m^2, drag areas along the three segment axes
    m: float  # kg
    inertia: Array  # (3, 3) kg m^2, about the centre of mass, body axes


@dataclass(frozen=True)
class Constants:
    rho: float = 1.225  # kg/m^3
    S: float = 1.25  # m^2, reference area of the damping moments
    L: float = 1.78  # m, reference length of the damping moments
    Cm_roll: float = 8.0
    Cm_pitch: float = 8.0
    K_N: float = 100.0  # N, eq_force2
    lx: float = 0.35  # m, eq_force2
    force: str = "ventral"  # where the hands pull: a key of paper_utc.PAPER_AXES
    g: float = 9.80665  # m/s^2


def rotation_matrix(q: ArrayLike, normalise: bool = True) -> Array:
    """Body -> world for the quaternion (x, y, z, w); columns are the body axes in world coordinates.

    v_world = v + 2 w (e x v) + 2 e x (e x v), e = (x, y, z): a rotation if |q| = 1. With normalise the
    quaternion is divided by its length first, otherwise the formula is used as it stands.
    """
    q = np.asarray(q, dtype=float)
    q = q / np.linalg.norm(q) if normalise else q
    x, y, z, w = q
    E = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    A: Array = np.eye(3) + 2.0 * w * E + 2.0 * E @ E
    return A


def quaternion_derivative(q: ArrayLike, omega: ArrayLike) -> Array:
    """q' = 1/2 q (x) (omega, 0), omega in body axes; Hamilton product, order x y z w.

    e' = 1/2 (w omega + e x omega),   w' = -1/2 e . omega
    """
    q, omega = np.asarray(q, dtype=float), np.asarray(omega, dtype=float)
    e, w = q[:3], q[3]
    return 0.5 * np.append(w * omega + np.cross(e, omega), -e @ omega)


def segment_forces(V: ArrayLike, omega: ArrayLike, p: Posture, rho: float, drift: ArrayLike = 0.0) -> Array:
    """(16, 3) N in body axes: F_i = -1/2 rho |v_i| R_i diag(CdA_i) R_i^T v_i, v_i = V + omega x r_i + r_i'.

    drift r_i': (16, 3) m/s, velocities of the segments in body axes while the limbs move
    """
    v = np.asarray(V, dtype=float) + np.cross(np.asarray(omega, dtype=float), p.r) + np.asarray(drift)
    in_segment = (np.swapaxes(p.R, 1, 2) @ v[:, :, None])[:, :, 0]
    along = (p.R @ (p.CdA * in_segment)[:, :, None])[:, :, 0]
    F: Array = -0.5 * rho * np.linalg.norm(v, axis=1, keepdims=True) * along
    return F


def damping_moment(V: ArrayLike, omega: ArrayLike, Cm: ArrayLike, c: Constants) -> Array:
    """M = -Cm 1/2 rho |V| S L^2 / 2 omega, component by component; Cm = (roll, pitch, yaw)."""
    scale = 0.5 * c.rho * float(np.linalg.norm(V)) * c.S * c.L**2 / 2.0
    M: Array = -np.asarray(Cm, dtype=float) * scale * np.asarray(omega, dtype=float)
    return M


def force_and_moment(
    V: ArrayLike, omega: ArrayLike, u: ArrayLike, p: Posture, c: Constants, drift: ArrayLike = 0.0
) -> tuple[Array, Array]:
    """All but gravity, in body axes, moment about the centre of mass: segments, damping, hands.

    The hands' force is applied at the centre of mass; their moment is the printed one.
    """
    u = np.asarray(u, dtype=float)
    F = segment_forces(V, omega, p, c.rho, drift)
    hand_moment, hand_force = hand_moment_and_force(u[1], u[2], c.K_N, c.lx, c.force)
    damping = damping_moment(V, omega, (c.Cm_roll, c.Cm_pitch, u[0]), c)
    M = np.cross(p.r, F).sum(axis=0) + damping + hand_moment
    return F.sum(axis=0) + hand_force, M


def state_derivative(x: ArrayLike, u: ArrayLike, p: Posture, c: Constants, normalise: bool = True) -> Array:
    """Rigid body in body axes, A = body -> world:

    position' = A V,   q' = 1/2 q (x) (omega, 0)
    m (V' + omega x V) = F + m A^T (0, 0, -g)
    I omega' + omega x (I omega) = M
    """
    x = np.asarray(x, dtype=float)
    q, V, omega = x[3:7], x[7:10], x[10:13]
    A = rotation_matrix(q, normalise)
    F, M = force_and_moment(V, omega, u, p, c)
    V_dot = F / p.m + A.T @ np.array([0.0, 0.0, -c.g]) - np.cross(omega, V)
    omega_dot = np.linalg.solve(p.inertia, M - np.cross(omega, p.inertia @ omega))
    return np.concatenate([A @ V, quaternion_derivative(q, omega), V_dot, omega_dot])


def unit_quaternion(x: Array) -> Array:
    """The state with its quaternion divided by its length."""
    x = x.copy()
    x[3:7] /= np.linalg.norm(x[3:7])
    return x


def rk4(f: Callable[[Array], Array], x: ArrayLike, dt: float) -> Array:
    """x + dt/6 (k1 + 2 k2 + 2 k3 + k4), control and posture held over dt.

    The quaternion is normalised at the end, not between the stages. Whether state_derivative normalises it
    for the rotation changes one step by a few dt^5 (1e-9 m/s for dt = .0042 s at 7 rad/s).
    """
    x = np.asarray(x, dtype=float)
    k1 = f(x)
    k2 = f(x + dt / 2.0 * k1)
    k3 = f(x + dt / 2.0 * k2)
    k4 = f(x + dt * k3)
    return unit_quaternion(x + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4))


@dataclass(frozen=True)
class Motion:
    """Moving limbs at one time."""

    p: Posture
    drift: Array  # (16, 3) m/s, velocities of the segments in body axes
    h: Array  # (3,) kg m^2/s, angular momentum of the limbs about the centre of mass, body axes


def moving_step(
    x: ArrayLike, u: ArrayLike, motion: Callable[[float], Motion], c: Constants, dt: float
) -> Array:
    """One Runge-Kutta step while the limbs move as `motion` of the time since its start.

    Integrated with the total angular momentum H = I omega + h in the place of omega: H' + omega x H = M.
    """
    x = np.asarray(x, dtype=float)
    first, last = motion(0.0), motion(dt)

    def derivative(y: Array) -> Array:
        now = motion(y[13])
        q, V, H = y[3:7], y[7:10], y[10:13]
        A = rotation_matrix(q, normalise=False)
        omega = np.linalg.solve(now.p.inertia, H - now.h)
        F, M = force_and_moment(V, omega, u, now.p, c, now.drift)
        V_dot = F / now.p.m + A.T @ np.array([0.0, 0.0, -c.g]) - np.cross(omega, V)
        return np.concatenate([A @ V, quaternion_derivative(q, omega), V_dot, M - np.cross(omega, H), [1.0]])

    y = rk4(derivative, [*x[:10], *(first.p.inertia @ x[10:13] + first.h), 0.0], dt)
    return np.concatenate([y[:10], np.linalg.solve(last.p.inertia, y[10:13] - last.h)])

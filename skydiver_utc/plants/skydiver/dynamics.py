# SPDX-License-Identifier: Apache-2.0
"""Aerodynamics, equations of motion and their integration, as kernels.

State (13,): position in world, quaternion x y z w body to world, velocity in body, body rates.
Control (4,): Cm_damp_yaw, k_right, k_left, alpha.

Each segment feels -1/2 rho |v_i| A_i v_i at its own velocity v_i = V + omega x r_i + r_i' alpha', where A_i is
the segment's drag-area matrix in the body frame; damping moments and the hands' force and moment (eq_force2) act
on the whole body. With the total angular momentum H = I omega + h alpha' about the centre of mass, h the limbs'
angular momentum for a unit rate of alpha:

    m (V' + omega x V) = F + m g,    H' + omega x H = M,    omega = I^-1 (H - h alpha')

A step integrates H, so limbs that move turn the body without any rate that jumps or is lost. For a held posture
alpha' is zero and this is the rigid body.
"""

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.jit import inlined, kernel
from skydiver_utc.plants.skydiver.model import (
    GEOMETRY_SIZE,
    INERTIA_AT,
    SEGMENT_COUNT,
    SWING_AT,
    PlantModel,
)

STATE_SIZE = 13
_DRIFT_SIZE = 3 * SEGMENT_COUNT
# A factor, not a division: reassociation would pull the division into the loops over the table.
_SIXTH = 1.0 / 6.0


@inlined
def posture_geometry(model: PlantModel, alpha: float, out: Array) -> None:
    """Geometry (153,) at a pattern angle: cubic through the four nearest nodes of the table."""
    nodes = model.geometry.shape[0]
    position = (alpha - model.alpha_first) * model.nodes_per_rad
    left = min(max(int(np.floor(position)) - 1, 0), nodes - 4)
    s = position - left
    w0 = -_SIXTH * (s - 1.0) * (s - 2.0) * (s - 3.0)
    w1 = 0.5 * s * (s - 2.0) * (s - 3.0)
    w2 = -0.5 * s * (s - 1.0) * (s - 3.0)
    w3 = _SIXTH * s * (s - 1.0) * (s - 2.0)
    table = model.geometry
    for i in range(GEOMETRY_SIZE):
        out[i] = (
            w0 * table[left, i] + w1 * table[left + 1, i] + w2 * table[left + 2, i] + w3 * table[left + 3, i]
        )


@inlined
def segment_drift(model: PlantModel, alpha: float, rate: float, out: Array) -> None:
    """Velocities (48,), x then y then z, of the segments in the body frame when alpha moves at `rate` [rad/s]."""
    nodes = model.geometry.shape[0]
    position = (alpha - model.alpha_first) * model.nodes_per_rad
    left = min(max(int(np.floor(position)) - 1, 0), nodes - 4)
    s = position - left
    scale = rate * model.nodes_per_rad
    w0 = -_SIXTH * scale * ((s - 2.0) * (s - 3.0) + (s - 1.0) * (s - 3.0) + (s - 1.0) * (s - 2.0))
    w1 = 0.5 * scale * ((s - 2.0) * (s - 3.0) + s * (s - 3.0) + s * (s - 2.0))
    w2 = -0.5 * scale * ((s - 1.0) * (s - 3.0) + s * (s - 3.0) + s * (s - 1.0))
    w3 = _SIXTH * scale * ((s - 1.0) * (s - 2.0) + s * (s - 2.0) + s * (s - 1.0))
    table = model.geometry
    for i in range(_DRIFT_SIZE):
        out[i] = (
            w0 * table[left, i] + w1 * table[left + 1, i] + w2 * table[left + 2, i] + w3 * table[left + 3, i]
        )


@inlined
def invert_inertia(geometry: Array, out: Array) -> None:
    """Inverse (xx, yy, zz, xy, xz, yz) of the symmetric inertia in a geometry row."""
    a, b, c = geometry[INERTIA_AT], geometry[INERTIA_AT + 1], geometry[INERTIA_AT + 2]
    d, e, f = geometry[INERTIA_AT + 3], geometry[INERTIA_AT + 4], geometry[INERTIA_AT + 5]
    xx, xy, xz = b * c - f * f, e * f - d * c, d * f - b * e
    scale = 1.0 / (a * xx + d * xy + e * xz)
    out[0], out[1], out[2] = scale * xx, scale * (a * c - e * e), scale * (a * b - d * d)
    out[3], out[4], out[5] = scale * xy, scale * xz, scale * (d * e - a * f)


@inlined
def body_load(
    model: PlantModel, geometry: Array, drift: Array, control: Array, state: Array, out: Array
) -> None:
    """Force and moment (6,) of air and hands about the centre of mass, in the body frame; drift as above."""
    vx, vy, vz = state[7], state[8], state[9]
    wx, wy, wz = state[10], state[11], state[12]
    fx, fy, fz, mx, my, mz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    n = SEGMENT_COUNT
    for i in range(n):
        rx, ry, rz = geometry[i], geometry[n + i], geometry[2 * n + i]
        ux = vx + wy * rz - wz * ry + drift[i]
        uy = vy + wz * rx - wx * rz + drift[n + i]
        uz = vz + wx * ry - wy * rx + drift[2 * n + i]
        pressure = -model.half_density * np.sqrt(ux * ux + uy * uy + uz * uz)
        axy, axz, ayz = geometry[6 * n + i], geometry[7 * n + i], geometry[8 * n + i]
        sx = pressure * (geometry[3 * n + i] * ux + axy * uy + axz * uz)
        sy = pressure * (axy * ux + geometry[4 * n + i] * uy + ayz * uz)
        sz = pressure * (axz * ux + ayz * uy + geometry[5 * n + i] * uz)
        fx += sx
        fy += sy
        fz += sz
        mx += ry * sz - rz * sy
        my += rz * sx - rx * sz
        mz += rx * sy - ry * sx
    damping = model.half_density * np.sqrt(vx * vx + vy * vy + vz * vz) * model.damping_volume
    out[0], out[1], out[2] = fx, fy, fz + model.hand_force * (control[1] + control[2])
    hands = model.hand_force * model.hand_arm * (control[2] - control[1])
    out[3] = mx - model.damping_roll * damping * wx + hands
    out[4] = my - model.damping_pitch * damping * wy
    out[5] = mz - control[0] * damping * wz


@inlined
def kinematics(model: PlantModel, load: Array, state: Array, out: Array) -> None:
    """Derivatives (10,) of position, quaternion and velocity under a load (6,)."""
    qx, qy, qz, qw = state[3], state[4], state[5], state[6]
    vx, vy, vz = state[7], state[8], state[9]
    wx, wy, wz = state[10], state[11], state[12]
    # Rows of the rotation body to world.
    r00, r01, r02 = 1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy - qz * qw), 2 * (qx * qz + qy * qw)
    r10, r11, r12 = 2 * (qx * qy + qz * qw), 1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz - qx * qw)
    r20, r21, r22 = 2 * (qx * qz - qy * qw), 2 * (qy * qz + qx * qw), 1 - 2 * (qx * qx + qy * qy)
    out[0] = r00 * vx + r01 * vy + r02 * vz
    out[1] = r10 * vx + r11 * vy + r12 * vz
    out[2] = r20 * vx + r21 * vy + r22 * vz
    out[3] = 0.5 * (qw * wx + qy * wz - qz * wy)
    out[4] = 0.5 * (qw * wy + qz * wx - qx * wz)
    out[5] = 0.5 * (qw * wz + qx * wy - qy * wx)
    out[6] = -0.5 * (qx * wx + qy * wy + qz * wz)
    out[7] = load[0] / model.mass - model.gravity * r20 - (wy * vz - wz * vy)
    out[8] = load[1] / model.mass - model.gravity * r21 - (wz * vx - wx * vz)
    out[9] = load[2] / model.mass - model.gravity * r22 - (wx * vy - wy * vx)


@inlined
def angular_momentum(geometry: Array, rate: float, state: Array, out: Array) -> None:
    """H = I omega + h alpha' (3,) about the centre of mass, in the body frame."""
    j = INERTIA_AT
    wx, wy, wz = state[10], state[11], state[12]
    out[0] = geometry[j] * wx + geometry[j + 3] * wy + geometry[j + 4] * wz + rate * geometry[SWING_AT]
    out[1] = (
        geometry[j + 3] * wx + geometry[j + 1] * wy + geometry[j + 5] * wz + rate * geometry[SWING_AT + 1]
    )
    out[2] = (
        geometry[j + 4] * wx + geometry[j + 5] * wy + geometry[j + 2] * wz + rate * geometry[SWING_AT + 2]
    )


@inlined
def body_rates(geometry: Array, inverse: Array, rate: float, momentum: Array, out: Array) -> None:
    """omega = I^-1 (H - h alpha') into out[10:13], H (3,)."""
    x = momentum[0] - rate * geometry[SWING_AT]
    y = momentum[1] - rate * geometry[SWING_AT + 1]
    z = momentum[2] - rate * geometry[SWING_AT + 2]
    out[10] = inverse[0] * x + inverse[3] * y + inverse[4] * z
    out[11] = inverse[3] * x + inverse[1] * y + inverse[5] * z
    out[12] = inverse[4] * x + inverse[5] * y + inverse[2] * z


@kernel
def state_derivative(
    model: PlantModel, geometry: Array, inverse: Array, control: Array, state: Array, out: Array
) -> None:
    """Time derivative (13,) of the state in a held posture, from its geometry and inverse inertia."""
    drift, load, momentum = model.work[2], model.work[3], model.work[4]
    for i in range(_DRIFT_SIZE):
        drift[i] = 0.0
    body_load(model, geometry, drift, control, state, load)
    kinematics(model, load, state, out)
    angular_momentum(geometry, 0.0, state, momentum)
    _momentum_derivative(load, momentum, state, momentum)
    body_rates(geometry, inverse, 0.0, momentum, out)


@inlined
def _momentum_derivative(load: Array, momentum: Array, state: Array, out: Array) -> None:
    """H' = M - omega x H (3,), in the body frame; out may be the momentum."""
    wx, wy, wz = state[10], state[11], state[12]
    hx, hy, hz = momentum[0], momentum[1], momentum[2]
    out[0] = load[3] - (wy * hz - wz * hy)
    out[1] = load[4] - (wz * hx - wx * hz)
    out[2] = load[5] - (wx * hy - wy * hx)


@kernel
def advance(
    model: PlantModel,
    state: Array,
    control: Array,
    alpha: float,
    rate: float,
    rate_after: float,
    moving: bool,
    out: Array,
    work: Array,
) -> None:
    """Classical Runge-Kutta over dt; alpha moves from `alpha` with a rate that changes evenly to `rate_after`.

    The integrated vector is the state with H in the place of the body rates; the quaternion is normalised last.
    """
    n, dt = STATE_SIZE, model.dt
    geometry, inverse, drift, load = work[0], work[1], work[2], work[3]
    slope, probe, following, kept = work[4], work[5], work[6], work[7]
    for i in range(n):
        probe[i] = state[i]
        following[i] = state[i]
    for i in range(_DRIFT_SIZE):
        drift[i] = 0.0
    # Along a roll-out the posture often stays: what is kept of the step before is used again.
    if kept[0] != alpha:
        posture_geometry(model, alpha, geometry)
        invert_inertia(geometry, inverse)
    kept[0] = np.nan if moving else alpha
    angular_momentum(geometry, rate, state, following[10:])
    start_x, start_y, start_z = following[10], following[11], following[12]
    momentum_x, momentum_y, momentum_z = start_x, start_y, start_z
    acceleration = (rate_after - rate) / dt
    rate_now = rate
    # One body for the four stages: each part of it is compiled once.
    for stage in range(4):
        if moving:
            t = 0.0 if stage == 0 else (dt if stage == 3 else 0.5 * dt)
            rate_now = rate + acceleration * t
            alpha_now = alpha + rate * t + 0.5 * acceleration * t * t
            if stage == 1 or stage == 3:
                posture_geometry(model, alpha_now, geometry)
                invert_inertia(geometry, inverse)
            segment_drift(model, alpha_now, rate_now, drift)
        slope[10], slope[11], slope[12] = momentum_x, momentum_y, momentum_z
        body_rates(geometry, inverse, rate_now, slope[10:], probe)
        body_load(model, geometry, drift, control, probe, load)
        kinematics(model, load, probe, slope)
        _momentum_derivative(load, slope[10:], probe, slope[10:])
        share = dt / 6.0 if stage == 0 or stage == 3 else dt / 3.0
        reach = dt if stage == 2 else 0.5 * dt
        for i in range(n):
            following[i] += share * slope[i]
            probe[i] = state[i] + reach * slope[i]
        momentum_x = start_x + reach * slope[10]
        momentum_y = start_y + reach * slope[11]
        momentum_z = start_z + reach * slope[12]
    body_rates(geometry, inverse, rate_after, following[10:], out)
    for i in range(10):
        out[i] = following[i]
    scale = 1.0 / np.sqrt(out[3] * out[3] + out[4] * out[4] + out[5] * out[5] + out[6] * out[6])
    for i in range(3, 7):
        out[i] *= scale

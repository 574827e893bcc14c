"""Aerodynamics, equations of motion and their integration, as kernels.

State (13,): position in world, quaternion x y z w body to world, velocity in body, body rates.
Control (4,): Cm_damp_yaw, k_right, k_left, alpha.

Each segment feels -1/2 rho |v_i| A_i v_i at its own velocity v_i = V + omega x r_i, where A_i is the
segment's drag-area matrix in the body frame; damping moments and the hands' force and moment (eq_force2) act
on the whole body:  m (V' + omega x V) = F + m g,  I omega' + omega x I omega = M.
The posture is held over a step; the reaction of the moving limbs on the body is not in this model yet, its place
is the moment below.
"""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.jit import kernel
from skydiver_utc.plant.model import GEOMETRY_SIZE, INERTIA_AT, SEGMENT_COUNT, PlantModel

Array = NDArray[np.float64]

STATE_SIZE = 13
# Work space of `rk4_step`: geometry, inverse inertia, three states.
WORK_SIZE = GEOMETRY_SIZE + 6 + 3 * STATE_SIZE


@kernel
def posture_geometry(model: PlantModel, alpha: float, out: Array) -> None:
    """Geometry (150,) at a pattern angle: cubic through the four nearest nodes of the table."""
    nodes = model.geometry.shape[0]
    position = (alpha - model.alpha_first) * model.nodes_per_rad
    left = min(max(int(np.floor(position)) - 1, 0), nodes - 4)
    s = position - left
    w0 = -(s - 1.0) * (s - 2.0) * (s - 3.0) / 6.0
    w1 = s * (s - 2.0) * (s - 3.0) / 2.0
    w2 = -s * (s - 1.0) * (s - 3.0) / 2.0
    w3 = s * (s - 1.0) * (s - 2.0) / 6.0
    table = model.geometry
    for i in range(GEOMETRY_SIZE):
        out[i] = (
            w0 * table[left, i] + w1 * table[left + 1, i] + w2 * table[left + 2, i] + w3 * table[left + 3, i]
        )


@kernel
def invert_inertia(geometry: Array, out: Array) -> None:
    """Inverse (xx, yy, zz, xy, xz, yz) of the symmetric inertia in a geometry row."""
    a, b, c = geometry[INERTIA_AT], geometry[INERTIA_AT + 1], geometry[INERTIA_AT + 2]
    d, e, f = geometry[INERTIA_AT + 3], geometry[INERTIA_AT + 4], geometry[INERTIA_AT + 5]
    xx, xy, xz = b * c - f * f, e * f - d * c, d * f - b * e
    scale = 1.0 / (a * xx + d * xy + e * xz)
    out[0], out[1], out[2] = scale * xx, scale * (a * c - e * e), scale * (a * b - d * d)
    out[3], out[4], out[5] = scale * xy, scale * xz, scale * (d * e - a * f)


@kernel
def state_derivative(
    model: PlantModel, geometry: Array, inverse: Array, control: Array, state: Array, out: Array
) -> None:
    """Time derivative (13,) of the state for a posture's geometry and inverse inertia."""
    qx, qy, qz, qw = state[3], state[4], state[5], state[6]
    vx, vy, vz = state[7], state[8], state[9]
    wx, wy, wz = state[10], state[11], state[12]

    fx, fy, fz, mx, my, mz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    n = SEGMENT_COUNT
    for i in range(n):
        rx, ry, rz = geometry[i], geometry[n + i], geometry[2 * n + i]
        ux = vx + wy * rz - wz * ry
        uy = vy + wz * rx - wx * rz
        uz = vz + wx * ry - wy * rx
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
    mx -= model.damping_roll * damping * wx
    my -= model.damping_pitch * damping * wy
    mz -= control[0] * damping * wz
    mx += model.hand_force * model.hand_arm * (control[2] - control[1])
    fz += model.hand_force * (control[1] + control[2])

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
    out[7] = fx / model.mass - model.gravity * r20 - (wy * vz - wz * vy)
    out[8] = fy / model.mass - model.gravity * r21 - (wz * vx - wx * vz)
    out[9] = fz / model.mass - model.gravity * r22 - (wx * vy - wy * vx)

    j = INERTIA_AT
    hx = geometry[j] * wx + geometry[j + 3] * wy + geometry[j + 4] * wz
    hy = geometry[j + 3] * wx + geometry[j + 1] * wy + geometry[j + 5] * wz
    hz = geometry[j + 4] * wx + geometry[j + 5] * wy + geometry[j + 2] * wz
    mx -= wy * hz - wz * hy
    my -= wz * hx - wx * hz
    mz -= wx * hy - wy * hx
    out[10] = inverse[0] * mx + inverse[3] * my + inverse[4] * mz
    out[11] = inverse[3] * mx + inverse[1] * my + inverse[5] * mz
    out[12] = inverse[4] * mx + inverse[5] * my + inverse[2] * mz


@kernel
def rk4_step(model: PlantModel, state: Array, control: Array, out: Array, work: Array) -> None:
    """One step of dt with the control and its posture held (classical Runge-Kutta, quaternion normalised).

    out (13,) may be the state itself; work is scratch of `WORK_SIZE` numbers.
    """
    g, n, dt = GEOMETRY_SIZE, STATE_SIZE, model.dt
    geometry, inverse, slope = work[:g], work[g : g + 6], work[g + 6 : g + 6 + n]
    probe, following = work[g + 6 + n : g + 6 + 2 * n], work[g + 6 + 2 * n : g + 6 + 3 * n]
    posture_geometry(model, control[3], geometry)
    invert_inertia(geometry, inverse)
    for i in range(n):
        probe[i] = state[i]
        following[i] = state[i]
    # One body for the four stages: unrolled, it would be inlined four times over and compile as long.
    for stage in range(4):
        state_derivative(model, geometry, inverse, control, probe, slope)
        share = dt / 6.0 if stage == 0 or stage == 3 else dt / 3.0
        reach = dt if stage == 2 else 0.5 * dt
        for i in range(n):
            following[i] += share * slope[i]
            probe[i] = state[i] + reach * slope[i]
    for i in range(n):
        out[i] = following[i]
    scale = 1.0 / np.sqrt(out[3] * out[3] + out[4] * out[4] + out[5] * out[5] + out[6] * out[6])
    for i in range(3, 7):
        out[i] *= scale


@kernel
def limit_control(model: PlantModel, command: Array, previous: Array, out: Array) -> None:
    """Actuator bounds (eq:minmax_utc), then the slew rate of alpha (eq:lim) from the previous control.

    out (4,) may be either of the two.
    """
    alpha = previous[3]
    for j in range(4):
        out[j] = min(max(command[j], model.control_min[j]), model.control_max[j])
    out[3] = min(max(out[3], alpha - model.alpha_slew), alpha + model.alpha_slew)

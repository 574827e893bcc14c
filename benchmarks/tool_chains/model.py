# SPDX-License-Identifier: Apache-2.0
"""The skydiver with a held posture as a smooth CasADi model.

State (10,): quaternion x y z w, velocity and body rates in body axes; the package's without the position, on which
nothing depends. The posture's geometry is a polynomial in alpha through the package's table and equals that of
the body's own joints at every alpha; so the dynamics are the package's to 1e-9 with the posture itself in place of
its table, whose cubics are off by up to 5e-7 between the nodes (`test_casadi_model.py`).
"""

import casadi as ca
import numpy as np
from numpy.polynomial import chebyshev

from skydiver_utc.arrays import Array
from skydiver_utc.plants.skydiver.model import GEOMETRY_SIZE, INERTIA_AT, SEGMENT_COUNT, PlantModel
from skydiver_utc.rotations import up_components

STATES = 10
_DEGREE = 16


def reduced(state: Array) -> Array:
    """The package's state (13,) without the position."""
    return state[3:]


def geometry(model: PlantModel) -> ca.Function:
    """alpha [rad] -> geometry (153,), a Chebyshev series over the range of alpha."""
    nodes = len(model.geometry)
    coefficients = chebyshev.chebfit(np.linspace(-1.0, 1.0, nodes), model.geometry, _DEGREE)
    alpha = ca.SX.sym("alpha")
    half_range = 0.5 * (nodes - 1) / model.nodes_per_rad
    x = (alpha - model.alpha_first) / half_range - 1.0
    basis = [ca.SX(1.0), x]
    for _ in range(2, _DEGREE + 1):
        basis.append(2.0 * x * basis[-1] - basis[-2])
    return ca.Function("geometry", [alpha], [ca.mtimes(ca.DM(coefficients.T), ca.vertcat(*basis))])


def derivative(model: PlantModel) -> ca.Function:
    """(state (10,), control (4,), geometry (153,)) -> state' (10,)."""
    x, u, g = ca.SX.sym("x", STATES), ca.SX.sym("u", 4), ca.SX.sym("g", GEOMETRY_SIZE)
    q, velocity, rates = x[:4], x[4:7], x[7:]
    force, moment = _air(model, g, velocity, rates)
    damping = model.half_density * ca.norm_2(velocity) * model.damping_volume
    force[2] += model.hand_force * (u[1] + u[2])
    moment[0] += model.hand_force * model.hand_arm * (u[2] - u[1])
    moment -= damping * ca.vertcat(model.damping_roll, model.damping_pitch, u[0]) * rates
    i = INERTIA_AT
    inertia = ca.vertcat(
        ca.horzcat(g[i], g[i + 3], g[i + 4]),
        ca.horzcat(g[i + 3], g[i + 1], g[i + 5]),
        ca.horzcat(g[i + 4], g[i + 5], g[i + 2]),
    )
    up = ca.vertcat(*up_components(q[0], q[1], q[2], q[3]))
    turning = 0.5 * ca.vertcat(q[3] * rates + ca.cross(q[:3], rates), -ca.dot(q[:3], rates))
    acceleration = force / model.mass - model.gravity * up - ca.cross(rates, velocity)
    spin = ca.mtimes(ca.inv(inertia), moment - ca.cross(rates, ca.mtimes(inertia, rates)))
    return ca.Function("derivative", [x, u, g], [ca.vertcat(turning, acceleration, spin)])


def _air(model: PlantModel, g: ca.SX, velocity: ca.SX, rates: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Force and moment of the air on the segments."""
    n = SEGMENT_COUNT
    force, moment = ca.SX.zeros(3), ca.SX.zeros(3)
    for i in range(n):
        r = ca.vertcat(g[i], g[n + i], g[2 * n + i])
        xx, yy, zz, xy, xz, yz = (g[(3 + j) * n + i] for j in range(6))
        area = ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))
        wind = velocity + ca.cross(rates, r)
        push = -model.half_density * ca.norm_2(wind) * ca.mtimes(area, wind)
        force += push
        moment += ca.cross(r, push)
    return force, moment


def step(model: PlantModel) -> ca.Function:
    """(state (10,), control (4,), dt) -> state (10,) one dt later: Runge-Kutta, quaternion normalised last."""
    x, u, dt = ca.SX.sym("x", STATES), ca.SX.sym("u", 4), ca.SX.sym("dt")
    posture, slope = geometry(model)(u[3]), derivative(model)
    k1 = slope(x, u, posture)
    k2 = slope(x + 0.5 * dt * k1, u, posture)
    k3 = slope(x + 0.5 * dt * k2, u, posture)
    k4 = slope(x + dt * k3, u, posture)
    after = x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    after[:4] /= ca.norm_2(after[:4])
    return ca.Function("step", [x, u, dt], [after])

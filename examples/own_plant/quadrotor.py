# SPDX-License-Identifier: Apache-2.0
"""A quadrotor as a plant of one's own: `skydiver-utc simulate quadrotor.yaml`.

A torque moves the place only through four integrations. The outputs that end in `_aim` are therefore the place, or
the heading, with derivatives added as in (d/dt / RATE + 1)^3 or (d/dt / RATE + 1): once these meet a constant
reference, the quadrotor comes to rest there at that rate.
"""

from typing import Annotated, NamedTuple

import numpy as np

from skydiver_utc import Model, Plant, Shape, SlotSettings, kernel, quantity, runge_kutta

GRAVITY, RATE = 9.81, 3.0
# For displays: half axes and centre [m].
PARTS = (
    ("hull", (0.12, 0.08, 0.04), (0.0, 0.0, 0.0)),
    ("front_rotor", (0.09, 0.09, 0.01), (0.2, 0.0, 0.04)),
    ("back_rotor", (0.09, 0.09, 0.01), (-0.2, 0.0, 0.04)),
    ("left_rotor", (0.09, 0.09, 0.01), (0.0, 0.2, 0.04)),
    ("right_rotor", (0.09, 0.09, 0.01), (0.0, -0.2, 0.04)),
)


class Numbers(NamedTuple):
    """What the kernels take."""

    mass: float  # [kg]
    inertia: np.ndarray  # (3,) [kg m2]
    dt_s: float


@kernel
def turned(state, x, y, z):
    """A vector of body axes in the world; the attitude is the quaternion x y z w in state[3:7]."""
    a, b, c, w = state[3], state[4], state[5], state[6]
    tx, ty, tz = 2.0 * (b * z - c * y), 2.0 * (c * x - a * z), 2.0 * (a * y - b * x)
    return x + w * tx + b * tz - c * ty, y + w * ty + c * tx - a * tz, z + w * tz + a * ty - b * tx


@kernel
def derivative(state, control, parameters, out):
    """State as in nav_msgs/Odometry: place, quaternion, velocity and rates in body. Controls: thrust, torques."""
    a, b, c, w = state[3], state[4], state[5], state[6]
    u, v, s, p, q, r = state[7], state[8], state[9], state[10], state[11], state[12]
    out[0], out[1], out[2] = turned(state, u, v, s)
    out[3], out[4] = 0.5 * (w * p + b * r - c * q), 0.5 * (w * q + c * p - a * r)
    out[5], out[6] = 0.5 * (w * r + a * q - b * p), -0.5 * (a * p + b * q + c * r)
    out[7] = -GRAVITY * 2.0 * (a * c - b * w) - (q * s - r * v)
    out[8] = -GRAVITY * 2.0 * (b * c + a * w) - (r * u - p * s)
    out[9] = control[0] / parameters.mass - GRAVITY * (1.0 - 2.0 * (a * a + b * b)) - (p * v - q * u)
    x, y, z = parameters.inertia
    out[10] = (control[1] + (y - z) * q * r) / x
    out[11] = (control[2] + (z - x) * p * r) / y
    out[12] = (control[3] + (x - y) * p * q) / z


@kernel
def step(state, control, parameters, out):
    """The state (13,) one dt later with thrust and torques held."""
    runge_kutta(derivative, state, control, parameters, parameters.dt_s, out)
    out[3:7] /= np.sqrt(out[3] ** 2 + out[4] ** 2 + out[5] ** 2 + out[6] ** 2)


@kernel
def outputs(state, parameters, out):
    """Place, then place and heading with their derivatives; thrust is taken for the weight."""
    vx, vy, vz = turned(state, state[7], state[8], state[9])
    ax, ay, _ = turned(state, 0.0, 0.0, GRAVITY)
    jx, jy, _ = turned(state, GRAVITY * state[11], -GRAVITY * state[10], 0.0)
    out[:3] = state[:3]
    out[3] = state[0] + 3.0 * vx / RATE + 3.0 * ax / RATE**2 + jx / RATE**3
    out[4] = state[1] + 3.0 * vy / RATE + 3.0 * ay / RATE**2 + jy / RATE**3
    out[5] = state[2] + vz / RATE
    hx, hy, _ = turned(state, 1.0, 0.0, 0.0)
    out[6] = np.arctan2(hy, hx) + state[12] / RATE


class Quadrotor(Plant):
    """A rigid body with a thrust along its z axis and three torques."""

    class Settings(SlotSettings):
        """Mass and size."""

        mass_kg: Annotated[float, quantity("kg", "mass", gt=0)] = 1.0
        inertia_kg_m2: Annotated[tuple[float, float, float], quantity("kg m2", "about body x, y and z")]
        thrust_N: Annotated[float, quantity("N", "largest thrust", gt=0)] = 20.0
        torque_Nm: Annotated[float, quantity("Nm", "largest torque about each axis", gt=0)] = 1.0

    state_names = ("x", "y", "z", "qx", "qy", "qz", "qw", "vx", "vy", "vz", "wx", "wy", "wz")
    state_message = "odometry"
    control_names = ("thrust", "roll_torque", "pitch_torque", "yaw_torque")
    output_names = ("x", "y", "z", "x_aim", "y_aim", "z_aim", "heading_aim")
    units = dict.fromkeys(output_names[:6], "m") | {"heading_aim": "rad", "thrust": "N"}

    def __init__(self, settings: Settings, dt_s: float) -> None:
        self.dt_s = dt_s
        self.maximum = np.array([settings.thrust_N, *(3 * [settings.torque_Nm])])
        self.minimum, self.rate = np.append(0.0, -self.maximum[1:]), np.full(4, np.inf)
        numbers = Numbers(settings.mass_kg, np.array(settings.inertia_kg_m2), dt_s)
        self.model = Model(step, outputs, numbers, state_size=13)
        self.shapes = tuple(Shape(name, np.array(size)) for name, size, _ in PARTS)

    def initial_state(self) -> np.ndarray:
        """Level and at rest at the origin."""
        return np.append(np.zeros(6), [1.0, *np.zeros(6)])

    def initial_control(self) -> np.ndarray:
        """The thrust of hovering."""
        return np.array([GRAVITY * self.model.parameters.mass, 0.0, 0.0, 0.0])

    def shape_poses(self, state, applied):
        """Each part moves with the body."""
        places = [np.array(turned(state, *place)) for *_, place in PARTS]
        return np.array([[*(state[:3] + place), *state[3:7]] for place in places])

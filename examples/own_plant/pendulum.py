# SPDX-License-Identifier: Apache-2.0
"""A pendulum as a plant of one's own: `skydiver-utc simulate pendulum.yaml`."""

from typing import Annotated, NamedTuple

import numpy as np

from skydiver_utc import Model, Plant, Shape, SlotSettings, kernel, quantity, runge_kutta


class Numbers(NamedTuple):
    """What the kernels take."""

    stiffness: float  # g / length [1/s2]
    damping: float  # [1/s]
    inertia: float  # [kg m2]
    dt_s: float


@kernel
def derivative(state, control, parameters, out):
    """angle'' = -g / length sin(angle) - damping angle' + torque / inertia; the angle is 0 hanging down."""
    out[0] = state[1]
    out[1] = (
        -parameters.stiffness * np.sin(state[0])
        - parameters.damping * state[1]
        + control[0] / parameters.inertia
    )


@kernel
def step(state, control, parameters, out):
    """The state (2,) one dt later with the torque held."""
    runge_kutta(derivative, state, control, parameters, parameters.dt_s, out)


@kernel
def outputs(state, parameters, out):
    """Angle [rad] and rate [rad/s]."""
    out[:] = state


class Pendulum(Plant):
    """A point mass on a rod with a motor at its pivot."""

    class Settings(SlotSettings):
        """Mass, size and motor."""

        mass_kg: Annotated[float, quantity("kg", "mass at the end of the rod", gt=0)] = 0.5
        length_m: Annotated[float, quantity("m", "length of the rod", gt=0)] = 0.4
        damping: Annotated[float, quantity("1/s", "damping of the pivot", ge=0)] = 0.1
        torque_Nm: Annotated[float, quantity("Nm", "largest torque of the motor", gt=0)] = 3.0
        angle_deg: Annotated[float, quantity("deg", "angle at step 0", ge=-180, le=180)] = 0.0

    state_names = output_names = ("angle", "rate")
    control_names = ("torque",)
    units = {"angle": "rad", "rate": "rad/s", "torque": "Nm"}

    def __init__(self, settings: Settings, dt_s: float) -> None:
        self.dt_s = dt_s
        self.maximum = np.array([settings.torque_Nm])
        self.minimum, self.rate = -self.maximum, np.array([np.inf])
        inertia = settings.mass_kg * settings.length_m**2
        numbers = Numbers(9.81 / settings.length_m, settings.damping, inertia, dt_s)
        self.model = Model(step, outputs, numbers, state_size=2)
        self._start = np.deg2rad(settings.angle_deg)
        self._length = settings.length_m
        rod = np.array([0.02, 0.02, 0.5 * settings.length_m])
        self.shapes = (Shape("rod", rod), Shape("mass", np.full(3, 0.06)))

    def initial_state(self) -> np.ndarray:
        """At rest."""
        return np.array([self._start, 0.0])

    def shape_poses(self, state, applied):
        """The rod's middle and its end; the pendulum swings in the plane of x and z."""
        down = self._length * np.array([np.sin(state[0]), 0.0, -np.cos(state[0])])
        attitude = [0.0, -np.sin(0.5 * state[0]), 0.0, np.cos(0.5 * state[0])]
        return np.array([[*(0.5 * down), *attitude], [*down, *attitude]])

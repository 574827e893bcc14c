# SPDX-License-Identifier: Apache-2.0
"""Steady falls of a body that holds one posture: straight, and turning about the vertical.

Attitude is the world's up direction in body axes, a unit vector, so that no attitude is singular and heading, on
which nothing depends, does not appear. A body that does not turn feels forces and moments that depend on the
direction of its velocity alone, times its speed squared: a straight fall is a direction without moment, and its
speed and its up direction follow from weight = force.
"""

from dataclasses import dataclass, replace

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.parameters import ParameterError
from skydiver_utc.plants.skydiver.dynamics import (
    STATE_SIZE,
    invert_inertia,
    posture_geometry,
    state_derivative,
)
from skydiver_utc.plants.skydiver.model import GEOMETRY_SIZE, PlantModel
from skydiver_utc.rotations import attitude_with_up, world_up

# What may be left of linear [m/s2] and angular [rad/s2] acceleration.
LARGEST_RESIDUAL = 1e-6
_DIRECTIONS = 361
# A unit of the unknown velocity of a steady turn [m/s].
_SPEED = 50.0
# Steps in pattern angle in which a steady fall is followed from one reported angle to the next.
_STEPS = 6


class HeldBody:
    """A body that holds a posture under a constant control (4,): that of the pattern angle control[3], or any."""

    def __init__(self, model: PlantModel, control: Array, geometry: Array | None = None) -> None:
        """`geometry` (153,) is the row of another posture, as `held_row` makes it."""
        self.model, self.control = model, control
        self._geometry, self._inverse = np.empty(GEOMETRY_SIZE), np.empty(6)
        if geometry is None:
            posture_geometry(model, control[3], self._geometry)
        else:
            self._geometry[:] = geometry
        invert_inertia(self._geometry, self._inverse)

    def accelerations(self, up: Array, velocity: Array, rates: Array) -> Array:
        """Linear [m/s2] and angular [rad/s2] acceleration (6,) in body axes, by the equations of a run.

        up (3,) the world's up direction, velocity (3,) [m/s] and rates (3,) [rad/s], all in body axes
        """
        return self.accelerations_in(_state(up, velocity, rates))

    def straight_down(self, speed: float, pitch: float) -> Array:
        """Accelerations (6,) while falling straight down [m/s] with the head low by a pitch [rad]."""
        return self.accelerations_in(straight_down(speed, pitch))

    def accelerations_in(self, state: Array) -> Array:
        """Accelerations (6,) in a state (13,)."""
        derivative = np.empty(STATE_SIZE)
        state_derivative(self.model, self._geometry, self._inverse, self.control, state, derivative)
        return derivative[7:]


def straight_down(speed: float, pitch: float) -> Array:
    """State (13,) of a fall straight down [m/s] with the head low by a pitch [rad]."""
    up = np.array([-np.sin(pitch), 0.0, np.cos(pitch)])
    return _state(up, -speed * up, np.zeros(3))


def _state(up: Array, velocity: Array, rates: Array) -> Array:
    state = np.zeros(STATE_SIZE)
    state[3:7] = attitude_with_up(up)
    state[7:10], state[10:13] = velocity, rates
    return state


@dataclass(frozen=True, eq=False)
class SteadyFall:
    """A fall without acceleration in body axes.

    up (3,) the world's up direction, velocity (3,) [m/s], rates (3,) [rad/s], residual (6,) [m/s2, rad/s2], all in
    body axes; pitch_stiffness [rad/s2 per rad] is positive where a turn about y out of the wind is answered by
    one back.
    """

    up: Array
    velocity: Array
    rates: Array
    residual: Array
    pitch_stiffness: float = 0.0

    @property
    def speed(self) -> float:
        """Speed through the air [m/s]."""
        return float(np.linalg.norm(self.velocity))

    @property
    def fall_rate(self) -> float:
        """Downward speed [m/s]."""
        return float(-self.velocity @ self.up)

    @property
    def glide_angle(self) -> float:
        """Angle between the path and straight down [rad], never negative."""
        return float(np.arctan2(np.linalg.norm(self._sideways()), self.fall_rate))

    @property
    def glide_direction(self) -> str:
        """The body axis along which the horizontal velocity mostly points."""
        return _axis(self._sideways(), ("headwards", "left", "dorsal"), ("feetwards", "right", "ventral"))

    @property
    def facing(self) -> str:
        """Which side of the body faces the earth."""
        return _axis(
            -self.up,
            ("head down", "left side down", "back to earth"),
            ("feet down", "right side down", "belly to earth"),
        )

    @property
    def pitch(self) -> float:
        """Angle of the long axis below the horizon [rad]: positive with the head low."""
        return float(np.arcsin(np.clip(-self.up[0], -1.0, 1.0)))

    @property
    def bank(self) -> float:
        """Angle of the body's left side above the horizon [rad]."""
        return float(np.arcsin(np.clip(self.up[1], -1.0, 1.0)))

    @property
    def yaw_rate(self) -> float:
        """Body rate about the dorsal axis [rad/s]."""
        return float(self.rates[2])

    def _sideways(self) -> Array:
        sideways: Array = self.velocity + self.fall_rate * self.up
        return sideways


def falling_straight(speed: float, pitch: float) -> SteadyFall:
    """The fall straight down [m/s] with the head low by a pitch [rad] of a body that is trimmed to it."""
    state = straight_down(speed, pitch)
    return SteadyFall(world_up(state), state[7:10], state[10:13], np.zeros(6))


def straight_falls(model: PlantModel) -> list[SteadyFall]:
    """All straight falls of the posture at pattern angle 0, controls at rest, the statically stable ones first.

    Drag is odd in the velocity, so each fall has its reverse, stable where the other is not. Raises
    `ParameterError` where there is none.
    """
    from scipy.optimize import brentq

    weightless, held = (HeldBody(model._replace(gravity=g), np.zeros(4)) for g in (0.0, model.gravity))
    still = np.zeros(3)

    def direction(angle: float) -> Array:
        """Of the velocity, in the symmetry plane: 0 ventral, positive to the head."""
        return np.array([np.sin(angle), 0.0, -np.cos(angle)])

    def in_wind(angle: float) -> Array:
        """Accelerations (6,) without gravity at a speed of 1 m/s."""
        return weightless.accelerations(np.array([0.0, 0.0, 1.0]), direction(angle), still)

    def pitch_acceleration(angle: float) -> float:
        return float(in_wind(angle)[4])

    angles = np.linspace(-np.pi, np.pi, _DIRECTIONS) + np.pi / _DIRECTIONS
    values = [pitch_acceleration(angle) for angle in angles]
    found = []
    for left, right, before, after in zip(angles, angles[1:], values, values[1:], strict=False):
        if before * after < 0.0:
            angle, step = brentq(pitch_acceleration, left, right, xtol=1e-15), 1e-6
            push = in_wind(angle)[:3]
            strength = float(np.linalg.norm(push))
            up, velocity = push / strength, np.sqrt(model.gravity / strength) * direction(angle)
            fall = SteadyFall(up, velocity, still, held.accelerations(up, velocity, still))
            slope = (pitch_acceleration(angle + step) - pitch_acceleration(angle - step)) / (2 * step)
            found.append(replace(fall, pitch_stiffness=-slope * fall.speed**2))
    if not found:
        raise ParameterError(
            "this posture turns about the mediolateral axis in any wind: there is no straight fall"
        )
    least = min(float(np.abs(fall.residual).max()) for fall in found)
    if least > LARGEST_RESIDUAL:
        raise ParameterError(
            f"this posture has no steady straight fall, at best {least:.2g} of acceleration is left: "
            "make its left and right sides alike"
        )
    steady = [fall for fall in found if np.abs(fall.residual).max() <= LARGEST_RESIDUAL]
    return sorted(steady, key=lambda fall: -fall.pitch_stiffness)


def steady_turn(body: HeldBody, near: SteadyFall) -> SteadyFall | None:
    """The steady turn about the vertical nearest to a fall; None where no solution is found from there."""
    from scipy.optimize import root

    def unpack(x: Array) -> tuple[Array, Array, Array]:
        up = x[3:6] / np.linalg.norm(x[3:6])
        return up, _SPEED * x[:3], x[6] * up

    def unbalanced(x: Array) -> Array:
        return np.append(body.accelerations(*unpack(x)), x[3:6] @ x[3:6] - 1.0)

    turning = float(near.rates @ near.up)
    found = root(unbalanced, np.concatenate([near.velocity / _SPEED, near.up, [turning]]), tol=1e-13)
    up, velocity, rates = unpack(found.x)
    residual = body.accelerations(up, velocity, rates)
    if np.abs(residual).max() > LARGEST_RESIDUAL:
        return None
    return SteadyFall(up, velocity, rates, residual)


def yaw_acceleration(model: PlantModel, fall: SteadyFall, alpha: float) -> float:
    """Body acceleration about the dorsal axis [rad/s2] in a straight fall with a pattern angle put in at once."""
    body = HeldBody(model, np.array([0.0, 0.0, 0.0, alpha]))
    return float(body.accelerations(fall.up, fall.velocity, fall.rates)[5])


def steady_turns(
    model: PlantModel, fall: SteadyFall, alphas: Array, damping: float
) -> list[SteadyFall | None]:
    """The steady fall at each of the pattern angles [rad], which run away from 0, hands at rest.

    It is followed from the straight fall on; None from where it is lost.
    """
    found: list[SteadyFall | None] = []
    near: SteadyFall | None = fall
    reached = 0.0
    for alpha in alphas:
        for step in np.linspace(reached, alpha, _STEPS + 1)[1:]:
            if near is not None:
                near = steady_turn(HeldBody(model, np.array([damping, 0.0, 0.0, step])), near)
        reached = float(alpha)
        found.append(near)
    return found


def _axis(vector: Array, positive: tuple[str, str, str], negative: tuple[str, str, str]) -> str:
    largest = int(np.argmax(np.abs(vector)))
    return positive[largest] if vector[largest] > 0.0 else negative[largest]

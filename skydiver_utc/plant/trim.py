"""Straight fall: the posture and speed at which a skydiver falls without accelerating or turning."""

from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from skydiver_utc.body.posture import configuration, joint_ranges, joint_rows, motion, posture_angles
from skydiver_utc.body.segments import JOINTS, Body, build_body
from skydiver_utc.parameters import ParameterError, Posture, Scenario
from skydiver_utc.plant.dynamics import invert_inertia, state_derivative
from skydiver_utc.plant.model import PlantModel, build_model, pack_geometry, swing

Array = NDArray[np.float64]

# The joint angles that a straight fall may change, both sides alike: joint and column.
FREE_ANGLES = (("hip", 0), ("knee", 0), ("shoulder", 0), ("shoulder", 1), ("shoulder", 2), ("elbow", 0))
# Acceleration that a straight fall may have left, in m/s2 and rad/s2.
_LARGEST_RESIDUAL = 1e-6


@dataclass(frozen=True, eq=False)
class Trim:
    """A straight fall: joint angles (15, 3) [rad], speed [m/s], pitch [rad], and what is left of acceleration."""

    angles: Array
    speed: float
    pitch: float
    residual: Array


class FallingBody:
    """Accelerations of a body in a posture, falling straight down at a pitch."""

    def __init__(self, body: Body, model: PlantModel, pitch: float) -> None:
        self._body, self._model, self._pitch = body, model, pitch

    def acceleration(self, angles: Array, speed: float) -> Array:
        """Linear [m/s2] and angular [rad/s2] acceleration, (6,), in the body frame, controls at rest."""
        placed = configuration(self._body, angles)
        geometry, inverse = pack_geometry(self._body, placed, np.zeros(3)), np.empty(6)
        invert_inertia(geometry, inverse)
        state, derivative = np.zeros(13), np.empty(13)
        state[4], state[6] = np.sin(self._pitch / 2), np.cos(self._pitch / 2)
        state[7], state[9] = speed * np.sin(self._pitch), -speed * np.cos(self._pitch)
        state_derivative(self._model, geometry, inverse, np.zeros(4), state, derivative)
        return derivative[7:13]

    def swing(self, angles: Array, direction: Array) -> Array:
        """Angular momentum (3,) [kg m2/s] of limbs that move along a direction (15, 3) at 1 rad/s."""
        placed = configuration(self._body, angles)
        return swing(self._body, placed, *motion(self._body, placed, angles, direction))


def straight_fall(scenario: Scenario, posture: Posture, pitch_deg: float) -> Trim:
    """The posture nearest to the given one, over `FREE_ANGLES`, that falls straight at a pitch.

    Least squares in the joint angles, within the joint limits, under three equations: no acceleration along
    x and z, none about y.
    """
    from scipy.optimize import NonlinearConstraint, minimize

    body, pitch = build_body(scenario.subject), float(np.deg2rad(pitch_deg))
    falling = FallingBody(body, build_model(scenario), pitch)
    typical = posture_angles(posture)
    free = [(JOINTS.index(f"left_{joint}"), column) for joint, column in FREE_ANGLES]
    start: Array = np.array([typical[place] for place in free])
    lower, upper = joint_ranges(scenario.subject.joint_limits)
    speed_unit = 50.0

    def placed(values: Array) -> Array:
        angles = typical.copy()
        for (row, column), value in zip(free, values, strict=True):
            angles[[row, row + 1], column] = value
        return angles

    def balance(x: Array) -> Array:
        return falling.acceleration(placed(x[:-1]), x[-1] * speed_unit)[[0, 2, 4]]

    def distance(x: Array) -> float:
        return float(((x[:-1] - start) ** 2).sum())

    first_guess: Array = np.concatenate([start, [1.1]])
    bounds = [(lower[place], upper[place]) for place in free]
    found = minimize(
        distance,
        first_guess,
        bounds=[*bounds, (0.2, 3.0)],
        constraints=NonlinearConstraint(balance, 0.0, 0.0),
        method="SLSQP",
        options={"maxiter": 500, "ftol": 1e-14},
    )
    angles, speed = placed(found.x[:-1]), float(found.x[-1] * speed_unit)
    residual = falling.acceleration(angles, speed)
    if not np.abs(residual).max() < _LARGEST_RESIDUAL:
        raise ParameterError(
            f"posture {posture.name} has no straight fall at a pitch of {pitch_deg} deg:"
            f" {np.abs(residual).max():.2g} of acceleration is left; choose another posture or pitch"
        )
    return Trim(angles, speed, pitch, residual)


def in_straight_fall(scenario: Scenario) -> Scenario:
    """The scenario with its posture moved, by as little as it takes, to fall straight down at its initial pitch.

    The initial speed becomes that of this fall.
    """
    found = straight_fall(scenario, scenario.posture, scenario.initial.pitch_deg)
    replace = msgspec.structs.replace
    return replace(
        scenario,
        posture=replace(scenario.posture, joint_angles_deg=joint_rows(np.rad2deg(found.angles))),
        initial=replace(scenario.initial, fall_speed_m_s=found.speed),
    )

# SPDX-License-Identifier: Apache-2.0
"""The skydiver in free fall as a plant."""

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.body.movement import check_movement, movement
from skydiver_utc.body.posture import configuration, joint_angle_names
from skydiver_utc.body.segments import SEGMENTS, build_body, ellipsoids
from skydiver_utc.body.urdf import urdf
from skydiver_utc.jit import InMemory, address, by_address, in_memory, unfused
from skydiver_utc.parameters import SkydiverSettings
from skydiver_utc.parameters.skydiver import CONTROLS
from skydiver_utc.plants.protocol import Model, Plant, Reduced, Shape
from skydiver_utc.plants.skydiver.actuators import Advance, actuated, advanced
from skydiver_utc.plants.skydiver.dynamics import STATE_SIZE
from skydiver_utc.plants.skydiver.longest_step import fastest_damping
from skydiver_utc.plants.skydiver.model import PlantModel, build_model
from skydiver_utc.plants.skydiver.prediction import named_outputs, skydiver_step
from skydiver_utc.plants.skydiver.reduced import belly_to_earth, expanded, reduced
from skydiver_utc.plants.skydiver.segment_forces import segment_forces
from skydiver_utc.plants.skydiver.sensors import sensors
from skydiver_utc.plants.skydiver.table_error import refuse_coarse_table
from skydiver_utc.rotations import up_of_quaternion, world_up

# A body faster than this has left the model, whatever its numbers say.
LARGEST_SPEED_M_S = 500.0
LARGEST_RATE_RAD_S = 200.0
_BEYOND, _ROLLED_OVER = 1, 2


class SkydiverPlant(Plant):
    """Steps a state (13,) under a control (4,).

    State: position in world, quaternion x y z w body to world, velocity and rates in body. What the actuators hold
    (5,): the control, and the rate of alpha [rad/s]. Outputs (4,): yaw, pitch and roll rate, fall rate.
    """

    state_names = ("x", "y", "z", "qx", "qy", "qz", "qw", "vx", "vy", "vz", "wx", "wy", "wz")
    control_names = CONTROLS
    output_names = ("yaw_rate", "pitch_rate", "roll_rate", "fall_rate")
    units: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(("x", "y", "z"), "m"),
        **dict.fromkeys(("vx", "vy", "vz", "fall_rate"), "m/s"),
        **dict.fromkeys(("wx", "wy", "wz", "yaw_rate", "pitch_rate", "roll_rate"), "rad/s"),
        "alpha": "rad",
    }
    state_message = "odometry"

    def __init__(self, settings: SkydiverSettings, dt_s: float) -> None:
        self.dt_s, self._settings = dt_s, settings
        self._movement = movement(settings.posture, settings.pattern, settings.ratios.pattern)
        check_movement(settings, self._movement)
        self.constants: PlantModel = build_model(settings, dt_s, self._movement)
        refuse_coarse_table(settings, self.constants, self._movement)
        self.model = Model(skydiver_step, named_outputs, self.constants, STATE_SIZE)
        self.sensors = sensors(self.constants)
        self.minimum, self.maximum = self.constants.control_min, self.constants.control_max
        self.rate = np.array([np.inf, np.inf, np.inf, settings.limits.alpha_rate])
        limbs = np.array([dt_s, self.constants.alpha_slew, settings.limbs.alpha_acceleration])
        self._actuators = np.array([self.minimum, self.maximum]), limbs, settings.limbs.reaction
        self.joint_names = joint_angle_names()
        self._body = build_body(settings.subject)
        sizes = ellipsoids(self._body)
        self.shapes = tuple(Shape(segment.name, size) for segment, size in zip(SEGMENTS, sizes, strict=True))
        fastest_damping(self.model, self.initial_state(), settings.initial.alpha).refuse_longer(dt_s)

    def initial_state(self) -> Array:
        """State (13,) at step 0: heading, then pitch, then bank turned; falling straight down in the world."""
        initial = self._settings.initial
        state = np.zeros(STATE_SIZE)
        state[2] = initial.altitude_m
        state[3:7] = _quaternion(initial.heading_deg, initial.pitch_deg, initial.bank_deg)
        state[7:10] = -initial.fall_speed_m_s * world_up(state)
        state[10:13] = np.deg2rad([initial.roll_rate_deg_s, initial.pitch_rate_deg_s, initial.yaw_rate_deg_s])
        return state

    def initial_control(self) -> Array:
        initial = self._settings.initial
        return np.array([initial.Cm_damp_yaw, initial.k_right, initial.k_left, initial.alpha])

    def model_of_step(self, dt_s: float) -> Model:
        constants = self.constants._replace(dt=dt_s, work=np.full_like(self.constants.work, np.nan))
        return self.model._replace(parameters=constants)

    def reduced(self, control: Array) -> Reduced:
        """The straight fall belly to earth in its eight states."""
        return Reduced(belly_to_earth(self.constants), reduced, expanded)

    def initial_applied(self) -> Array:
        return np.append(self.initial_control(), 0.0)

    def actuate(self, command: Array, before: Array) -> Array:
        after = np.empty(5)
        actuated(command, before, *self._actuators, after)
        return after

    def advance(self, state: Array, before: Array, command: Array) -> tuple[Array, Array]:
        if type(self) is not SkydiverPlant:  # it may have a step of its own
            return super().advance(state, before, command)
        out = np.empty(STATE_SIZE + 5)
        self._advanced(state, before, np.ascontiguousarray(command, dtype=float), out)
        return out[:STATE_SIZE], out[STATE_SIZE:]

    @cached_property
    def _advanced(self) -> Any:
        model, scratch = InMemory(self.constants), np.empty(10)
        step = address(in_memory(skydiver_step), self.initial_state(), scratch, model, self.initial_state())
        numbers = Advance(*self._actuators, step, model.address, scratch)
        example = self.initial_state(), scratch, scratch, scratch
        run: Any = by_address([(advanced, numbers)], *example)
        run.kept = run.kept, model
        return run

    def step_control(self, before: Array, applied: Array) -> Array:
        """The state of the actuators after and before a step (10,), or the control (4,) where limbs do not react."""
        return np.concatenate((applied, before)) if self._settings.limbs.reaction else applied[:4]

    def joint_angles(self, applied: Array) -> Array:
        return self._movement.angles(float(applied[3])).ravel()

    def shape_poses(self, state: Array, applied: Array) -> Array:
        from scipy.spatial.transform import Rotation

        placed = configuration(self._body, self._movement.angles(float(applied[3])))
        attitude = Rotation.from_quat(state[3:7])
        turned = attitude * Rotation.from_matrix(placed.rotation)
        return np.hstack([state[:3] + attitude.apply(placed.centre), turned.as_quat()])

    def shape_forces(self, state: Array, applied: Array) -> Array:
        from scipy.spatial.transform import Rotation

        return np.asarray(
            Rotation.from_quat(state[3:7]).apply(segment_forces(self.constants, state, applied))
        )

    def robot_description(self) -> str:
        return urdf(self._settings.subject)

    def robot_pose(self, state: Array, applied: Array) -> Array:
        from scipy.spatial.transform import Rotation

        placed = configuration(self._body, self._movement.angles(float(applied[3])))
        mid_hip = state[:3] - Rotation.from_quat(state[3:7]).apply(placed.centre_of_mass)
        return np.concatenate([mid_hip, state[3:7]])

    def fault(self, state: Array) -> str:
        if not _condition(state) & _BEYOND:
            return ""
        speed, rate = math.hypot(*state[7:10]), math.hypot(*state[10:])
        return f"the state left the model (speed {speed:.3g} m/s, body rate {rate:.3g} rad/s)"

    def mishap(self, state: Array) -> str:
        rolled = self._settings.belly_to_earth and _condition(state) & _ROLLED_OVER
        return "the dorsal axis went below the horizon" if rolled else ""


@unfused
def _condition(state: Array) -> int:
    """0 of a sound state (13,); _BEYOND the speed and rate of a falling body, _ROLLED_OVER, or both."""
    finite = True
    for i in range(state.shape[0]):
        finite &= abs(state[i]) < np.inf
    vx, vy, vz, wx, wy, wz = state[7], state[8], state[9], state[10], state[11], state[12]
    slow = vx * vx + vy * vy + vz * vz < LARGEST_SPEED_M_S * LARGEST_SPEED_M_S
    falls = finite and slow and wx * wx + wy * wy + wz * wz < LARGEST_RATE_RAD_S * LARGEST_RATE_RAD_S
    above = up_of_quaternion(state[3], state[4], state[5], state[6])[2] >= 0.0
    return (0 if falls else _BEYOND) | (0 if above else _ROLLED_OVER)


def _quaternion(heading_deg: float, pitch_deg: float, bank_deg: float) -> Array:
    """Quaternion x y z w of the intrinsic rotations z, y, x."""
    (cz, cy, cx), (sz, sy, sx) = (
        f(np.deg2rad(np.array([heading_deg, pitch_deg, bank_deg])) / 2) for f in (np.cos, np.sin)
    )
    return np.array(
        [
            sx * cy * cz - cx * sy * sz,
            cx * sy * cz + sx * cy * sz,
            cx * cy * sz - sx * sy * cz,
            cx * cy * cz + sx * sy * sz,
        ]
    )

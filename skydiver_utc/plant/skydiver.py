"""The skydiver in free fall, for the simulator and for the nodes."""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.body.movement import check_movement, movement
from skydiver_utc.body.posture import joint_angle_names
from skydiver_utc.parameters import Scenario
from skydiver_utc.plant.dynamics import (
    STATE_SIZE,
    WORK_SIZE,
    drive_limbs,
    limit_control,
    moving_step,
    rk4_step,
)
from skydiver_utc.plant.model import PlantModel, build_model
from skydiver_utc.plant.table_error import refuse_coarse_table

Array = NDArray[np.float64]

CONTROL_NAMES = ("Cm_damp_yaw", "k_right", "k_left", "alpha")
# Where in the state the body rates are that a reference may be for.
RATE_AT = {"pitch_rate": 11, "yaw_rate": 12}


class SkydiverPlant:
    """Steps a state (13,) under a control (4,); keeps no state of its own."""

    def __init__(self, scenario: Scenario, model: PlantModel | None = None) -> None:
        check_movement(
            scenario.subject.joint_limits,
            scenario.posture,
            scenario.pattern,
            scenario.plant.limits.alpha,
            scenario.initial.alpha,
        )
        self.model = build_model(scenario) if model is None else model
        refuse_coarse_table(scenario, self.model)
        self.joint_names = joint_angle_names()
        self._initial = scenario.initial
        self._movement = movement(scenario.posture, scenario.pattern)
        self._work = np.empty(WORK_SIZE)

    def initial_state(self) -> Array:
        """State (13,) at step 0: heading, then pitch, then bank turned; falling straight down in the world."""
        initial = self._initial
        quaternion = _quaternion(initial.heading_deg, initial.pitch_deg, initial.bank_deg)
        state = np.zeros(STATE_SIZE)
        state[2] = initial.altitude_m
        state[3:7] = quaternion
        state[7:10] = -initial.fall_speed_m_s * _world_up_in_body(quaternion)
        state[12] = np.deg2rad(initial.yaw_rate_deg_s)
        return state

    def initial_control(self) -> Array:
        """Control (4,) asked for before step 0."""
        initial = self._initial
        return np.array([initial.Cm_damp_yaw, initial.k_right, initial.k_left, initial.alpha])

    def initial_applied(self) -> Array:
        """What the actuators hold before step 0 (5,): the control, and the rate of alpha [rad/s]."""
        return np.append(self.initial_control(), 0.0)

    def actuate(self, command: Array, before: Array) -> Array:
        """What the actuators make of a command (4,) from where they were (5,): bounds, then rates."""
        applied = np.zeros(5)
        if self.model.limb_reaction:
            limit_control(self.model, command, command, applied)
            drive_limbs(self.model, applied[3], before, applied)
        else:
            limit_control(self.model, command, before, applied)
        return applied

    def step(self, state: Array, before: Array, applied: Array) -> Array:
        """State (13,) one dt later while the actuators go from before (5,) to applied (5,)."""
        following = np.empty(STATE_SIZE)
        if self.model.limb_reaction:
            moving_step(self.model, state, before, applied, following, self._work)
        else:
            rk4_step(self.model, state, applied, following, self._work)
        return following

    def joint_angles(self, alpha: float) -> Array:
        """Joint angles (45,) in rad at a pattern angle, in the order of `joint_names`."""
        return self._movement.angles(alpha).ravel()


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


def _world_up_in_body(quaternion: Array) -> Array:
    x, y, z, w = quaternion
    return np.array([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)])

# SPDX-License-Identifier: Apache-2.0
"""One step of the skydiver and its outputs, as programs: the plant and the controllers' model run the same ones."""

from skydiver_utc.arrays import Array
from skydiver_utc.jit import inlined
from skydiver_utc.plants.skydiver.dynamics import advance
from skydiver_utc.plants.skydiver.model import PlantModel
from skydiver_utc.rotations import up_of_quaternion


@inlined
def skydiver_step(state: Array, control: Array, parameters: PlantModel, out: Array) -> None:
    """State (13,) one dt later, out may be the state itself.

    control: (4,), held with its posture over the step, as controllers predict; or (10,), what the actuators hold after
    and before the step: alpha and its rate [rad/s] then move from those before to those after
    """
    held = control.shape[0] == 4
    alpha = control[3] if held else control[8]
    rate = 0.0 if held else control[9]
    rate_after = 0.0 if held else control[4]
    advance(parameters, state, control, alpha, rate, rate_after, not held, out, parameters.work)


@inlined
def named_outputs(state: Array, parameters: PlantModel, out: Array) -> None:
    """Yaw, pitch and roll rate [rad/s], fall rate [m/s] (4,)."""
    up_x, up_y, up_z = up_of_quaternion(state[3], state[4], state[5], state[6])
    out[0], out[1], out[2] = state[12], state[11], state[10]
    out[3] = -(up_x * state[7] + up_y * state[8] + up_z * state[9])

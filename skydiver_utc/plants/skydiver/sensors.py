# SPDX-License-Identifier: Apache-2.0
"""Sensors at the skydiver's centre of mass, with axes along the body's.

Control (c,) of a measurement: what the actuators hold, as `skydiver_step` takes it.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.jit import inlined
from skydiver_utc.plants.protocol import SensorModel
from skydiver_utc.plants.skydiver.dynamics import body_load, posture_geometry, segment_drift
from skydiver_utc.plants.skydiver.model import PlantModel
from skydiver_utc.rotations import turn_into_body, turn_into_world

_AXES = ("x", "y", "z")
# International Standard Atmosphere: pressure at sea level [Pa], lapse rate over temperature there [1/m], g M / (R L).
_ATMOSPHERE = np.array([101325.0, 0.0065 / 288.15, 5.25588])
# The earth's field in the world [T]: 50 uT north and down by an inclination of 60 deg (central Europe 48 to 50 uT and
# 60 to 67 deg, World Magnetic Model 2025).
_FIELD = 5e-5 * np.array([0.0, 0.5, -np.sqrt(0.75)])


@inlined
def gyroscope(state: Array, control: Array, numbers: Any, out: Array) -> None:
    """Body rates (3,) [rad/s]."""
    for i in range(3):
        out[i] = state[10 + i]


@inlined
def accelerometer(state: Array, control: Array, numbers: PlantModel, out: Array) -> None:
    """Specific force (3,) in the body frame [m/s2]: force of air and hands over mass, without gravity."""
    geometry, drift, load, kept = numbers.work[0], numbers.work[2], numbers.work[3], numbers.work[7]
    posture_geometry(numbers, control[3], geometry)
    segment_drift(numbers, control[3], 0.0 if control.shape[0] == 4 else control[4], drift)
    body_load(numbers, geometry, drift, control, state, load)
    kept[0] = np.nan  # The next step cannot use this geometry again.
    for i in range(3):
        out[i] = load[i] / numbers.mass


@inlined
def magnetometer(state: Array, control: Array, numbers: Array, out: Array) -> None:
    """The earth's field (3,) in the body frame [T], from that in the world."""
    turn_into_body(state[3:], numbers, out)


@inlined
def barometer(state: Array, control: Array, numbers: Array, out: Array) -> None:
    """Static pressure (1,) at the altitude [Pa]: p0 (1 - L h / T0)^(g M / R L)."""
    out[0] = numbers[0] * (1.0 - numbers[1] * state[2]) ** numbers[2]


@inlined
def gnss_velocity(state: Array, control: Array, numbers: Any, out: Array) -> None:
    """Velocity (3,) over ground in the world [m/s]."""
    turn_into_world(state[3:], state[7:], out)


def sensors(model: PlantModel) -> Mapping[str, SensorModel]:
    """The sensors of a skydiver, by name."""
    nothing, pressure = np.empty(0), ("pressure",)
    force = _vector(accelerometer, model, "m/s2", "Imu", "linear_acceleration")
    return {
        "gyroscope": _vector(gyroscope, nothing, "rad/s", "Imu", "angular_velocity"),
        "accelerometer": force._replace(in_air=True),
        "magnetometer": _vector(magnetometer, _FIELD, "T", "MagneticField", "magnetic_field"),
        "barometer": SensorModel(
            barometer, _ATMOSPHERE, pressure, "Pa", "FluidPressure", ("fluid_pressure",)
        ),
        "gnss_velocity": _vector(gnss_velocity, nothing, "m/s", "TwistStamped", "twist.linear"),
    }


def _vector(function: Any, numbers: Any, unit: str, message: str, field: str) -> SensorModel:
    fields = tuple(f"{field}.{axis}" for axis in _AXES)
    return SensorModel(function, numbers, _AXES, unit, message, fields)

# SPDX-License-Identifier: Apache-2.0
"""What a turn asks of the body, without any controller: its acceleration as a share of the largest there is.

The largest is over all held postures and controls within their bounds. The acceleration is linear in damping and
hands, so that their bounds are enough; over alpha it is a grid. Where a share passes 1, no controller follows. Only
speeding up is looked at: slowing down is easier, the damping helps.
"""

from itertools import product

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.parameters import Scenario
from skydiver_utc.plants.skydiver.model import build_model
from skydiver_utc.plants.skydiver.steady import HeldBody, straight_falls

_YAW = 2  # of the body rates (3,)
_UP = np.array([0.0, 0.0, 1.0])  # any: no moment depends on it
_ALPHAS, _RATES, _PHASES = 31, 46, 181


def bodies_at_the_bounds(scenario: Scenario) -> list[HeldBody]:
    """Those among which each largest yaw acceleration is."""
    model, limits = build_model(scenario.plant, scenario.dt_s), scenario.plant.limits
    controls = product(limits.Cm_damp_yaw, limits.k_right, limits.k_left, np.linspace(*limits.alpha, _ALPHAS))
    return [HeldBody(model, np.array(control)) for control in controls]


def yaw_accelerations(bodies: list[HeldBody], velocity: Array, rates: Array) -> Array:
    """Of each body [rad/s2], at this velocity (3,) [m/s] and these rates (3,) [rad/s] in body axes."""
    return np.array([body.accelerations(_UP, velocity, rates)[3 + _YAW] for body in bodies])


def of_sines(scenario: Scenario, amplitudes: tuple[float, ...], frequencies: tuple[float, ...]) -> Array:
    """The largest share each sine asks for in the attitude of the straight fall, turning about the vertical.

    One row per amplitude [deg/s], one column per frequency [Hz].
    """
    bodies, fall = (
        bodies_at_the_bounds(scenario),
        straight_falls(build_model(scenario.plant, scenario.dt_s))[0],
    )
    rates = np.linspace(0.0, np.deg2rad(max(amplitudes)), _RATES)
    turns = (fall.up * (rate / fall.up[_YAW]) for rate in rates)
    largest = np.array([yaw_accelerations(bodies, fall.velocity, turn).max() for turn in turns])
    phases = np.linspace(0.0, np.pi / 2, _PHASES)

    def share(amplitude: float, frequency: float) -> float:
        asked = amplitude * 2 * np.pi * frequency * np.cos(phases)
        return float((asked / np.interp(amplitude * np.sin(phases), rates, largest)).max())

    return np.array([[share(np.deg2rad(a), f) for f in frequencies] for a in amplitudes])

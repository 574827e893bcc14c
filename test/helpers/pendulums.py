# SPDX-License-Identifier: Apache-2.0
"""A pendulum under a torque, jitted and plain, and an unscented Kalman filter of it."""

import nees
import numpy as np

from skydiver_utc.estimators.protocol import Reading
from skydiver_utc.estimators.unscented_kalman_filter import UnscentedKalmanFilter
from skydiver_utc.plants.function import FunctionPlant

DT_S, JITTED = nees.DT_S, nees.swing
swing = JITTED.py_func


def pendulum(function=JITTED, state=(0.5, 0.0)):
    names = {
        "state_names": ("angle", "rate"),
        "control_names": ("torque",),
        "output_names": ("angle", "rate"),
    }
    return FunctionPlant(function, state=state, control=0.0, dt=DT_S, **names)


def filter_of(plant, dt_s=DT_S, **settings):
    """The filter with an encoder in each step, unless the settings say otherwise."""
    given = {
        "sensors": {"encoder": {"of": ("angle",), "rate_Hz": 1.0 / dt_s, "noise": 0.05}},
        "initial_deviation": {"angle": 0.2, "rate": 0.4},
        "process_noise": {"rate": 0.3},
        "angles": ("angle",),
    } | settings
    return UnscentedKalmanFilter(UnscentedKalmanFilter.Settings.model_validate(given), plant, dt_s)


def reading(step, *values, sensor=0):
    return Reading(sensor, step, np.array(values))


def telemetry(of_filter, prefix):
    """The newest numbers whose names begin so."""
    names = of_filter.telemetry_names
    return np.array([v for n, v in zip(names, of_filter.telemetry, strict=True) if n.startswith(prefix)])

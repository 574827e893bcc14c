# SPDX-License-Identifier: Apache-2.0
"""A cart under a force, and a controller of it as a user would make one."""

import numpy as np

from skydiver_utc import UnscentedTransformController


def cart(x, u, dt):
    """Position and speed under a force."""
    return np.array([x[0] + dt * x[1], x[1] + dt * u[0]])


def position(x):
    return x[0]


def straight(x, u, dt):
    """Without inertia, one state for each control."""
    return x + dt * u


def controller(plant=cart, output=position, **changes):
    """UTC of the cart, or of another plant, with other arguments."""
    given = {"state": [0.0, 0.0], "control": 0.0, "dt": 0.1, "horizon": 8, "minimum": -1, "maximum": 1}
    return UnscentedTransformController.of(plant, output, **(given | changes))


def assert_usable(result, low=-1.0, high=1.0):
    """Finite and inside the bounds, whatever happened, and put in one sentence."""
    for array in (result.control, result.predicted, result.innovation, result.covariance, result.deviations):
        assert np.isfinite(array).all(), result
    assert np.isfinite(result.repaired)
    assert (low <= result.control).all()
    assert (result.control <= high).all()
    assert result.sentence.endswith(".")
    assert "\n" not in result.sentence

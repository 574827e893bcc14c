# SPDX-License-Identifier: Apache-2.0
"""Path-integral control on a linear-quadratic toy: the mean of its samples is known in closed form."""

import numba
import numpy as np
import pytest

from skydiver_utc import FunctionPlant
from skydiver_utc.controllers.path_integral import PathIntegralController
from skydiver_utc.controllers.protocol import Status
from skydiver_utc.controllers.settings import MppiSettings

GAIN = np.array([1.0, -0.5])
COST, REST = np.array([0.3, 0.2]), np.array([0.1, -0.2])
REFERENCE = 1.2
DEVIATION = np.array([0.4, 0.3])
TEMPERATURE = 0.15
START = np.array([0.3, -0.2])

# J(u) = (GAIN u - r)^2 + sum w (u - rest)^2 = (u - u*)' CURVATURE (u - u*) + const.
CURVATURE = np.outer(GAIN, GAIN) + np.diag(COST)
MINIMISER = np.linalg.solve(CURVATURE, REFERENCE * GAIN + COST * REST)
# exp(-J / lambda) times the samples' density is a normal density of this precision.
PRECISION = np.diag(DEVIATION**-2.0) + 2.0 * CURVATURE / TEMPERATURE


@numba.njit
def gain(x, u, dt):
    return np.array([u[0] * GAIN[0] + u[1] * GAIN[1]])


def controller_of(samples, seed, plant=gain, deviation=DEVIATION):
    own = FunctionPlant(plant, state=[0.0], control=START, dt=1.0, minimum=-100.0, maximum=100.0)
    span = np.full(2, 200.0)
    tables = {
        "nominal": REST, "cost": COST * span**2, "change_cost": np.full(2, 1e-12), "deviation": deviation / span
    }  # fmt: skip
    named = {name: dict(zip(("u0", "u1"), values.tolist(), strict=True)) for name, values in tables.items()}
    law = MppiSettings(horizon_steps=1, blocks=1, samples=samples, temperature=TEMPERATURE, **named)
    return PathIntegralController(law, own, ("y0",), 1.0, seed)


def decided(controller):
    return controller.decide(np.zeros(1), np.full((2, 1), REFERENCE))


def one_step_from(control):
    """Mean of the weighted samples drawn around a control, without sampling error."""
    return np.linalg.solve(PRECISION, DEVIATION**-2.0 * control + 2.0 * CURVATURE @ MINIMISER / TEMPERATURE)


def sampling_covariance(centre, samples):
    """Covariance of the weighted mean of samples drawn around a control: E_q[(p/q)^2 (u - mean) (u - mean)'] / S.

    p is the weighted density and q that of the samples, both normal, so that p^2 / q is a multiple of a normal one.
    """
    drawn = np.diag(DEVIATION**-2.0)
    mean, precision = one_step_from(centre), 2.0 * PRECISION - drawn
    middle = np.linalg.solve(precision, 2.0 * PRECISION @ mean - drawn @ centre)
    exponent = middle @ precision @ middle - 2.0 * mean @ PRECISION @ mean + centre @ drawn @ centre
    determinants = np.linalg.det(PRECISION) ** 2 / (np.linalg.det(drawn) * np.linalg.det(precision))
    away = middle - mean
    return (
        np.sqrt(determinants)
        * np.exp(0.5 * exponent)
        * (np.linalg.inv(precision) + np.outer(away, away))
        / samples
    )


@pytest.mark.parametrize("seed", range(3))
def test_one_step_is_the_mean_of_the_weighted_density(seed):
    decision = decided(controller_of(20000, seed))
    error = np.abs(decision.control - one_step_from(START))
    bound = 5.0 * np.sqrt(np.diag(sampling_covariance(START, 20000)))
    assert (error < bound).all()
    assert (bound < 0.3 * np.abs(START - one_step_from(START))).all()


def test_the_first_sample_is_the_sequence_at_hand():
    np.testing.assert_allclose(decided(controller_of(3, 0, deviation=np.zeros(2))).control, START, rtol=1e-15)


def test_samples_that_diverge_count_nothing():
    """Half of the samples have no finite output; the mean is that over the other half plane."""
    decision = decided(
        controller_of(2000, 1, plant=lambda x, u, dt: gain(x, u, dt) if u[0] <= START[0] else np.full(1, np.nan))
    )  # fmt: skip
    assert decision.status is not Status.KEPT_PREVIOUS
    assert np.isfinite(decision.control).all()
    assert np.isfinite(decision.telemetry).all()
    assert decision.control[0] < START[0]

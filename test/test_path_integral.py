"""Path-integral control on a linear-quadratic toy: what it converges to is known in closed form."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_lyapunov

from skydiver_utc.control.horizon import Horizon, HorizonCost
from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.control.path_integral import PathIntegralController, Sampling
from skydiver_utc.control.protocol import Status

GAIN = np.array([1.0, -0.5])
COST = HorizonCost(np.array([0.3, 0.2]), np.zeros(2), np.array([0.1, -0.2]))
REFERENCE = 1.2
DEVIATION = np.array([0.4, 0.3])
TEMPERATURE = 0.15
START = np.array([0.3, -0.2])
FREE = ControlLimits(np.full(2, -100.0), np.full(2, 100.0), np.full(2, np.inf))

# J(u) = (GAIN u - r)^2 + sum w (u - rest)^2 = (u - u*)' CURVATURE (u - u*) + const.
CURVATURE = np.outer(GAIN, GAIN) + np.diag(COST.control)
MINIMISER = np.linalg.solve(CURVATURE, REFERENCE * GAIN + COST.control * COST.rest)
# exp(-J / lambda) times the samples' density is a normal density of this precision.
PRECISION = np.diag(DEVIATION**-2.0) + 2.0 * CURVATURE / TEMPERATURE


def roll_out(state, applied, sequences, outputs):
    outputs[:, 0] = sequences[:, 0, :] @ GAIN


def controller_of(samples, seed, limits=FREE, plant=roll_out):
    sampling = Sampling(samples, DEVIATION, TEMPERATURE, seed)
    return PathIntegralController(plant, limits, Horizon(1, 1, 1), COST, sampling, START)


def decided(controller):
    return controller.decide(np.zeros(1), np.full(2, REFERENCE))


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


@pytest.mark.parametrize("seed", range(5))
def test_one_step_is_the_mean_of_the_weighted_density(seed):
    decision = decided(controller_of(20000, seed))
    error = np.abs(decision.control - one_step_from(START))
    bound = 5.0 * np.sqrt(np.diag(sampling_covariance(START, 20000)))
    assert (error < bound).all()
    assert (bound < 0.3 * np.abs(START - one_step_from(START))).all()


@pytest.mark.parametrize("seed", range(5))
def test_it_converges_to_the_minimiser_within_the_sampling_error(seed):
    """Each step shrinks the distance by PRECISION^-1 DEVIATION^-2 and adds a sampling error."""
    shrink = np.linalg.solve(PRECISION, np.diag(DEVIATION**-2.0))
    stationary = solve_discrete_lyapunov(shrink, sampling_covariance(MINIMISER, 4000))
    controller = controller_of(4000, seed)
    for _ in range(60):
        decision = decided(controller)
    bound = 5.0 * np.sqrt(np.diag(stationary))
    assert (np.abs(decision.control - MINIMISER) < bound).all()
    assert (bound < 0.1).all()


def test_one_seed_gives_the_same_bits_and_another_does_not():
    first, second, other = (controller_of(100, seed) for seed in (7, 7, 8))
    flown = [[decided(c).control.tobytes() for _ in range(5)] for c in (first, second, other)]
    assert flown[0] == flown[1]
    assert flown[0] != flown[2]
    first.reset()
    assert [decided(first).control.tobytes() for _ in range(5)] == flown[0]


def test_the_first_sample_is_the_sequence_at_hand():
    sampling = Sampling(3, np.zeros(2), TEMPERATURE, 0)
    controller = PathIntegralController(roll_out, FREE, Horizon(1, 1, 1), COST, sampling, START)
    np.testing.assert_allclose(decided(controller).control, START, rtol=1e-15)


def test_limits_hold():
    limits = ControlLimits(np.array([-1.0, -1.0]), np.array([0.3, 1.0]), np.array([np.inf, 0.05]))
    controller = controller_of(200, 0, limits)
    before = START
    for _ in range(40):
        decision = decided(controller)
        assert (decision.control >= limits.minimum).all()
        assert (decision.control <= limits.maximum).all()
        assert abs(decision.control[1] - before[1]) <= 0.05 + 1e-15
        before = decision.control
    assert decision.control[0] > 0.2


def test_samples_that_diverge_count_nothing():
    """Half of the samples have no finite output; the mean is that over the other half plane."""

    def half_broken(state, applied, sequences, outputs):
        roll_out(state, applied, sequences, outputs)
        outputs[sequences[:, 0, 0] > START[0], 0] = np.nan

    decision = decided(controller_of(2000, 1, plant=half_broken))
    assert decision.status is not Status.KEPT_PREVIOUS
    assert np.isfinite(decision.control).all()
    assert np.isfinite(decision.telemetry).all()
    assert decision.control[0] < START[0]


def test_without_any_finite_sample_the_control_is_kept():
    def broken(state, applied, sequences, outputs):
        outputs[:] = np.inf

    decision = decided(controller_of(10, 1, plant=broken))
    assert decision.status is Status.KEPT_PREVIOUS
    np.testing.assert_array_equal(decision.control, START)

"""The linear-quadratic gains against batch least squares over a long horizon, and the skydiver's linear model."""

import numpy as np
import pytest
from scipy.linalg import logm
from scipy.spatial.transform import Rotation

from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.control.linear_quadratic import Equilibrium, LinearQuadraticController, design
from skydiver_utc.control.protocol import Status
from skydiver_utc.parameters import load_scenario
from skydiver_utc.plant.linearise import linearise
from skydiver_utc.plant.model import build_model
from skydiver_utc.plant.reduced import belly_to_earth, expanded, linearised_step, reduced
from skydiver_utc.plant.steady import HeldBody, straight_falls

A = np.array([[0.9, 0.2, 0.0], [-0.1, 0.85, 0.1], [0.0, 0.05, 0.7]])
B = np.array([[0.1, 0.0], [0.0, 0.4], [0.3, 0.1]])
C = np.array([1.0, 0.5, -0.2])
W, S = np.array([0.1, 0.3]), np.array([0.5, 0.2])
PLANT = Equilibrium(np.array([0.4, -0.1, 0.2]), np.array([0.3, -0.6]), A, B, C)


def best_first_control(z, u_before, reference, steps=300):
    """The first control of the least-squares solution over many steps, the reference constant after its end."""
    n = 2 * steps
    response, state_of = np.zeros((steps, n)), np.zeros((3, n))
    free, x = np.zeros(steps), z
    for k in range(steps):
        state_of = A @ state_of
        state_of[:, 2 * k : 2 * k + 2] += B
        x = A @ x
        response[k], free[k] = C @ state_of, C @ x
    r = np.append(reference, np.full(steps - len(reference), reference[-1]))
    change = np.eye(n) - np.eye(n, k=-2)
    w, s = np.sqrt(np.tile(W, steps)), np.sqrt(np.tile(S, steps))
    M = np.vstack([response, np.diag(w), s[:, None] * change])
    t = np.concatenate([r - free, np.zeros(n), s * np.append(u_before, np.zeros(n - 2))])
    return np.linalg.lstsq(M, t, rcond=None)[0][:2]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("preview_steps", [1, 2, 25])
def test_the_first_control_is_that_of_the_long_least_squares_problem(seed, preview_steps):
    """Feedback, preview and the constant tail at once."""
    generator = np.random.default_rng(seed)
    z, u, preview = (
        generator.normal(size=3),
        generator.normal(size=2),
        generator.normal(size=preview_steps + 1),
    )
    free = ControlLimits(np.full(2, -1e3), np.full(2, 1e3), np.full(2, np.inf))
    gains = design(PLANT, W, S, preview_steps)
    controller = LinearQuadraticController(lambda x: x, PLANT, gains, free, PLANT.control + u)
    decision = controller.decide(PLANT.state + z, C @ PLANT.state + preview)
    expected = PLANT.control + best_first_control(z, u, preview[1:])
    np.testing.assert_allclose(decision.control, expected, atol=1e-9)
    assert decision.status is Status.SOLVED


def test_it_does_not_wind_up_at_a_limit():
    """After a long time at the limit the control leaves it as soon as one that had not been there would."""
    limits = ControlLimits(np.full(2, -0.65), np.full(2, 0.35), np.full(2, np.inf))
    gains = design(PLANT, W, S, 5)
    at_limit = np.array([0.35, 0.35])
    waited = LinearQuadraticController(lambda x: x, PLANT, gains, limits, at_limit)
    fresh = LinearQuadraticController(lambda x: x, PLANT, gains, limits, at_limit)
    for _ in range(200):
        decision = waited.decide(PLANT.state, np.full(6, 1e3))
    np.testing.assert_array_equal(decision.control, at_limit)
    assert decision.status is Status.SATURATED
    back = np.full(6, -50.0)
    np.testing.assert_array_equal(
        waited.decide(PLANT.state, back).control, fresh.decide(PLANT.state, back).control
    )


@pytest.fixture(scope="module")
def model():
    return build_model(load_scenario("fast_turn_pose_only"))


def test_reduced_states_forget_position_and_heading_only():
    generator = np.random.default_rng(0)
    attitude = Rotation.from_euler("xyz", [0.3, -0.4, 0.0])
    turned = Rotation.from_euler("z", 1.1) * attitude
    rest = generator.normal(size=6)
    states = [np.concatenate([np.full(3, p), q.as_quat(), rest]) for p, q in ((0.0, attitude), (5.0, turned))]
    np.testing.assert_allclose(reduced(states[0]), reduced(states[1]), atol=1e-15)
    up = attitude.inv().apply([0.0, 0.0, 1.0])
    np.testing.assert_allclose(reduced(states[0])[:2], up[:2], atol=1e-15)
    np.testing.assert_allclose(reduced(expanded(reduced(states[0]))), reduced(states[0]), atol=1e-15)


def test_the_linearised_step_has_the_eigenvalues_of_the_linearised_fall(model):
    """Those of `plant/linearise.py`, in other coordinates, put through the Runge-Kutta method's polynomial."""
    control = np.array([0.2, 0.0, 0.0, 0.0])
    A, _ = linearised_step(model, belly_to_earth(model), control)
    rates = np.linalg.eigvals(linearise(HeldBody(model, control), straight_falls(model)[0]))
    z = rates * model.dt
    expected = 1.0 + z + z**2 / 2.0 + z**3 / 6.0 + z**4 / 24.0
    for value in np.linalg.eigvals(A):
        assert np.abs(expected - value).min() < 1e-8


def test_the_control_matrix_is_that_of_the_accelerations_integrated(model):
    """B = (A - 1) log(A)^-1 dt b, b the accelerations by each control, but for the Runge-Kutta method's error."""
    trim, rest = belly_to_earth(model), np.array([0.2, 0.0, 0.0, 0.0])
    A, B = linearised_step(model, trim, rest)
    integral = (A - np.eye(8)) @ np.linalg.inv(logm(A).real)
    up = np.append(trim[:2], np.sqrt(1.0 - trim[0] ** 2 - trim[1] ** 2))
    for column, step in ((1, 1e-4), (2, 1e-4), (3, 1e-4)):
        plus, minus = (
            HeldBody(model, rest + sign * step * np.eye(4)[column]).accelerations(up, trim[5:], trim[2:5])
            for sign in (1, -1)
        )
        slope = (plus - minus) / (2 * step)
        expected = integral @ np.concatenate([np.zeros(2), slope[3:], slope[:3]]) * model.dt
        np.testing.assert_allclose(B[:, column], expected, atol=1e-3 * np.abs(expected).max())
    assert B[4, 3] > 0.0
    np.testing.assert_allclose(B[:, 0], 0.0, atol=1e-12)

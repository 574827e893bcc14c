"""Steps that have no answer as the paper's equations stand, and how the law comes out of them."""

import numpy as np
import pytest

from skydiver_utc import Status, UnscentedTransformController
from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.control.utc import UtcLaw
from skydiver_utc.control.utc_step import Recovery
from skydiver_utc.parameters import load_scenario
from skydiver_utc.simulation.build import build_controller, build_plant
from skydiver_utc.simulation.closed_loop import simulate

FREE = ControlLimits(np.array([-np.inf]), np.array([np.inf]), np.array([np.inf]))


def bent(state, applied, points, preview, outputs, saved):
    """y = u + u^2."""
    outputs[:] = points + points**2
    saved[:] = points


@pytest.mark.parametrize("square_root", [False, True])
def test_a_negative_central_weight_that_makes_C_y_indefinite(square_root):
    """W0 = -3, Pu = 4: points 0, 1, -1 with outputs 0, 2, 0. About the mean C_y < 0; about the centre it is not.

    Mean 4, C_y = P_err - 3 (0 - 4)^2 + 2 ((2 - 4)^2 + (0 - 4)^2) = P_err - 8. About the centre
    C_y = P_err + 2 x 2^2 = 8.5, C_uy = 2 x 1 x 2 = 4, and Pu = Qu + 2 (1 + 1) - 4^2 / 8.5.
    """
    law = UtcLaw(bent, FREE, np.array([[0.5]]), -3.0, square_root=square_root)
    law.reset(np.zeros(1), np.array([[4.0]]))
    step = law.step(np.zeros(1), np.zeros(1), np.array([5.0]), np.array([[0.1]]))
    assert (step.status, step.recovery) == (Status.REPAIRED, Recovery.ABOUT_CENTRE)
    np.testing.assert_allclose(step.predicted, [4.0], rtol=1e-12)
    np.testing.assert_allclose(step.control, [4.0 / 8.5 * (5.0 - 4.0)], rtol=1e-12)
    np.testing.assert_allclose(law.covariance, [[0.1 + 4.0 - 16.0 / 8.5]], rtol=1e-12)


@pytest.mark.parametrize("square_root", [False, True])
def test_a_small_spread_needs_no_recovery(square_root):
    law = UtcLaw(bent, FREE, np.array([[0.5]]), -3.0, square_root=square_root)
    law.reset(np.zeros(1), np.array([[0.04]]))
    step = law.step(np.zeros(1), np.zeros(1), np.array([0.1]), np.array([[0.0]]))
    assert (step.status, step.recovery) == (Status.SOLVED, Recovery.NONE)


def test_the_sentence_names_the_recovery():
    controller = UnscentedTransformController(
        lambda x, u, dt: u + u**2, state=[0.0], control=0.0, dt=1.0, horizon=1, Pu=4.0, P_err=0.5, W0=-3.0
    )
    result = controller.step([0.0], 5.0)
    assert result.recovery is Recovery.ABOUT_CENTRE
    assert "about the central point" in result.sentence


def test_outputs_whose_covariance_rounding_makes_indefinite():
    """y = 1e8 (1, 2, 3) u with P_err = 1e-4: C_y has eigenvalues of about 1e16 and 1e-4, 20 digits apart.

    u moves to the reference within P_err, and Pu becomes P_err / (1e16 x 14) and Qu. A step in which the rounding
    leaves C_y definite by chance needs nothing.
    """
    slopes = 1e8 * np.array([1.0, 2.0, 3.0])
    controller = UnscentedTransformController(
        lambda x, u, dt: slopes * u, state=np.zeros(3), control=0.0, dt=1.0, horizon=1, Pu=0.04, Qu=0.004
    )
    found = []
    for wanted in (0.1, -0.2, 0.3, 0.35, -0.4):
        result = controller.step(np.zeros(3), slopes * wanted)
        found.append(result.recovery)
        if result.recovery is Recovery.FACTORED:
            assert result.status is Status.REPAIRED
            assert "rounding made the output's covariance indefinite" in result.sentence
        assert "W0" not in result.sentence
        np.testing.assert_allclose(result.control, [wanted], rtol=1e-9)
        np.testing.assert_allclose(result.covariance, [[0.004 + 1e-4 / (14 * 1e16)]], rtol=1e-9)
    assert Recovery.FACTORED in found
    assert set(found) <= {Recovery.NONE, Recovery.FACTORED}


def test_an_unstable_pole_whose_growth_exceeds_the_digits_of_a_covariance():
    """x'' = 36 x + u over 3 s: position and speed grow e^18-fold, as one; every step has an answer, without W0."""

    def plant(x, u, dt):
        return np.array([x[0] + dt * x[1], x[1] + dt * (36.0 * x[0] + u[0])])

    controller = UnscentedTransformController(
        plant, state=[0.1, 0.0], control=0.0, dt=0.02, horizon=150, minimum=-50, maximum=50
    )
    state, found = np.array([0.1, 0.0]), []
    for _ in range(100):
        result = controller.step(state, [0.0, 0.0])
        assert result.status is not Status.KEPT_PREVIOUS
        found.append(result.recovery)
        state = plant(state, result.control, 0.02)
    assert Recovery.FACTORED in found
    assert set(found) <= {Recovery.NONE, Recovery.FACTORED}


@pytest.mark.parametrize("square_root", [False, True])
@pytest.mark.parametrize("lost", [(1,), (0,), (1, 4), (1, 2, 3, 4)])
@pytest.mark.parametrize("W0", [-3.0, -2.9])
def test_what_is_left_beside_a_negative_central_weight_weighs_the_same(W0, lost, square_root):
    """Two controls, W0 = -3: each other point weighs 1, so that without one of them nothing would be left.

    y = 2 u0 - u1 of Pu = I; moments of the remaining points under equal weights, by NumPy.
    """
    slopes, P_err, Qu = np.array([[2.0, -1.0]]), np.array([[0.5]]), 0.1 * np.eye(2)

    def predict(state, applied, points, preview, outputs, saved):
        outputs[:] = points @ slopes.T
        outputs[list(lost)] = np.nan
        saved[:] = points

    limits = ControlLimits(*(np.repeat(limit, 2) for limit in FREE))
    law = UtcLaw(predict, limits, P_err, W0, square_root=square_root)
    law.reset(np.array([0.3, 0.2]), np.eye(2))
    step = law.step(np.zeros(1), np.zeros(1), np.array([1.0]), Qu)
    distance = np.sqrt(2.0 / (1.0 - W0))
    points = np.array([0.3, 0.2]) + distance * np.vstack([np.zeros(2), np.eye(2), -np.eye(2)])
    points = np.delete(points, lost, axis=0)
    mean, Pu = points.mean(axis=0), np.atleast_2d(np.cov(points.T, bias=True))
    gain = Pu @ slopes.T @ np.linalg.inv(slopes @ Pu @ slopes.T + P_err)
    np.testing.assert_allclose(step.control, mean + gain @ (1.0 - slopes @ mean), rtol=1e-12)
    np.testing.assert_allclose(law.covariance, Qu + Pu - gain @ slopes @ Pu, rtol=1e-11, atol=1e-14)
    assert (step.status, step.recovery, step.lost) == (Status.REPAIRED, Recovery.NONE, len(lost))


@pytest.mark.parametrize("square_root", [False, True])
def test_after_a_step_without_an_answer_the_next_begins_from_the_initial_covariance(square_root):
    """A covariance that grew, then a state from where everything diverges; NaN as a state changes nothing."""

    def plant(x, u, dt):
        return x + dt * (x**3 + 0.0 * u)

    controller = UnscentedTransformController(
        plant, state=[0.0], control=0.0, dt=0.1, horizon=10, Pu=2.0, Qu=3.0, square_root=square_root
    )
    controller.step([0.0], 0.0)
    np.testing.assert_allclose(controller.Pu, [[5.0]])
    assert controller.step([np.nan], 0.0).recovery is Recovery.NONE
    np.testing.assert_allclose(controller.Pu, [[5.0]])
    result = controller.step([1e3], 0.0)
    assert (result.status, result.recovery) == (Status.KEPT_PREVIOUS, Recovery.RESTARTED)
    np.testing.assert_allclose(controller.Pu, [[2.0]])
    np.testing.assert_allclose(result.covariance, [[2.0]])
    assert controller.step([0.0], 0.0).status is Status.SOLVED
    np.testing.assert_allclose(controller.Pu, [[5.0]])


class Keeping:
    """UTC of a scenario whose failed step keeps U and Pu, instead of taking covariances about the central point."""

    def __init__(self, scenario):
        self._rescued = build_controller(scenario)
        self.preview_steps = self._rescued.preview_steps
        self.telemetry_names = self._rescued.telemetry_names

    def reset(self):
        self._rescued.reset()

    def resume(self, control):
        self._rescued.resume(control)

    def decide(self, state, preview):
        law = self._rescued._utc
        control, Pu = law.control.copy(), law.covariance.copy()
        decision = self._rescued.decide(state, preview)
        if decision.telemetry[self.telemetry_names.index("recovery")] == Recovery.NONE:
            return decision
        law.hold(control)
        law.begin_from(Pu)
        return decision._replace(control=control, status=Status.KEPT_PREVIOUS)


def test_without_the_rescue_the_fast_turn_is_lost():
    """The same U and Pu fail again at every step to the end; docs/findings.md has the figure."""
    scenario = load_scenario("fast_turn_unknown_dynamics", {"controller.W0": -3.0})
    flight = simulate(scenario, build=Keeping)
    kept = np.flatnonzero(flight.status == Status.KEPT_PREVIOUS)
    np.testing.assert_array_equal(kept, np.arange(61, len(flight.status)))
    assert round(metrics(flight)["rmse_deg_s"]) == 281


def test_the_skydiver_answers_every_step_with_a_negative_central_weight():
    """From step 61 on with covariances about the central point, where there would be no answer without."""
    flight = simulate(load_scenario("fast_turn_unknown_dynamics", {"controller.W0": -3.0, "duration_s": 6.0}))
    recovery = flight.telemetry[:, flight.telemetry_names.index("recovery")]
    assert (recovery == Recovery.ABOUT_CENTRE).sum() > 0
    assert not (flight.status == Status.KEPT_PREVIOUS).any()
    assert metrics(flight)["rmse_deg_s"] < 20.0


def test_the_skydiver_begins_again_with_the_signs_of_the_present_turn():
    """A state that everything diverges from, in a right turn; the first decision was in a left one."""
    scenario = load_scenario("fast_turn_unknown_dynamics")
    controller, state = build_controller(scenario), build_plant(scenario).initial_state()
    left = np.linspace(1.0, 2.0, controller.preview_steps + 1)
    controller.decide(state, left)
    lost = state.copy()
    lost[10:] = 1e90
    decision = controller.decide(lost, -left)
    assert decision.status is Status.KEPT_PREVIOUS
    assert decision.telemetry[controller.telemetry_names.index("recovery")] == Recovery.RESTARTED
    fresh = build_controller(scenario)
    fresh.resume(decision.control)
    np.testing.assert_array_equal(controller.decide(state, -left).control, fresh.decide(state, -left).control)

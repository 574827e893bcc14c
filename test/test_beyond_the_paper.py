"""What the paper does not have: off by default, and what it does when it is on."""

import msgspec
import numpy as np
import paper_utc as paper
import plain_utc
import pytest

from skydiver_utc import UnscentedTransformController
from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.control.coupling import CouplingSchedule
from skydiver_utc.parameters import load_scenario
from skydiver_utc.plant.dynamics import WORK_SIZE, rk4_step
from skydiver_utc.simulation.build import build_controller, build_plant, build_reference
from skydiver_utc.simulation.closed_loop import simulate

DT = 0.0042
PAPER_UTC = load_scenario("fast_turn_unknown_dynamics").controller


def test_without_an_option_the_controller_is_the_papers():
    parameters = PAPER_UTC
    assert parameters.full_coupling_acceleration == 0.0
    assert parameters.aim == "end_point"
    assert parameters.covariance_leak == 0.0
    assert parameters.square_root is False
    assert not any(parameters.P_rest)


@pytest.mark.parametrize(("change", "share"), [(0.25, 0.25), (-0.5, 0.5), (3.0, 1.0), (0.0, 0.02)])
def test_the_row_of_the_damping_grows_with_the_acceleration_ahead(change, share):
    """Full at 6 rad/s2, the largest |change| in the preview counts, the other variances stay."""
    schedule = CouplingSchedule(
        msgspec.structs.replace(PAPER_UTC, full_coupling_acceleration=6.0), k_hyst=2, dt_s=DT
    )
    preview = 1.0 + np.array([0.0, 0.1, 1.1, 1.1]) * change * 6.0 * DT
    Qu = schedule.process_noise(preview)
    full = np.abs(paper.process_noise(1.0, 1.0, 1.0))
    expected = full.copy()
    expected[0, :] *= share
    expected[:, 0] = expected[0, :]
    np.testing.assert_allclose(np.abs(Qu), expected, rtol=1e-12)
    np.testing.assert_array_equal(np.abs(schedule.initial_covariance(preview)), 10.0 * full)


def test_a_direction_that_no_output_sees_settles_at_Qu_over_leak():
    """One output u0 + u1: the variance of u0 - u1 obeys v = (1 - leak) (v + q), so v = q (1 - leak) / leak."""
    leak, q = 0.2, 0.3
    controller = UnscentedTransformController(
        lambda x, u, dt: np.array([u[0] + u[1]]), state=[0.0], control=[0.0, 0.0], dt=1.0, horizon=1,
        Pu=1.0, Qu=q, leak=leak,
    )  # fmt: skip
    for _ in range(200):
        Pu = controller.step([0.0], 0.0).covariance
    unseen = np.array([1.0, -1.0]) / np.sqrt(2.0)
    assert unseen @ Pu @ unseen == pytest.approx(q * (1.0 - leak) / leak, rel=1e-6)


def test_a_control_that_no_output_sees_goes_to_its_rest():
    """y = u0 + u1 wanted at 1, u1 drawn to 0.2: u = (0.8, 0.2), which leaves no error at all."""
    controller = UnscentedTransformController(
        lambda x, u, dt: np.array([u[0] + u[1]]), state=[0.0], control=[0.0, 0.0], dt=1.0, horizon=1,
        P_err=1e-3, Pu=1.0, Qu=0.1, rest=[0.0, 0.2], P_rest=[np.inf, 0.5],
    )  # fmt: skip
    for _ in range(300):
        result = controller.step([0.0], 1.0)
    np.testing.assert_allclose(result.control, [0.8, 0.2], atol=1e-6)
    assert result.predicted.shape == result.innovation.shape == (1,)


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"rest": 0.0}, "rest is given without P_rest"),
        ({"P_rest": 0.0}, "P_rest must be above zero"),
        ({"P_rest": [1.0, 2.0, 3.0]}, "P_rest has shape"),
        ({"P_rest": np.nan}, "P_rest must be above zero"),
        ({"P_rest": 1.0, "rest": np.inf}, "rest holds a value that is not finite"),
    ],
)
def test_a_wrong_rest_is_named(given, named):
    with pytest.raises(ValueError, match=named):
        UnscentedTransformController(
            lambda x, u, dt: np.array([u[0] + u[1]]), state=[0.0], control=[0.0, 0.0], dt=1.0, horizon=1, Pu=1.0,
            **given,
        )  # fmt: skip


def test_the_skydivers_controls_at_rest_are_outputs_of_the_papers_form():
    """Twelve steps of the fast turn against the paper's text, its outputs the yaw rate and two of the controls."""
    scenario = load_scenario(
        "fast_turn_unknown_dynamics",
        {
            "controller.rest_Cm_damp_yaw": 0.3,
            "controller.P_rest_Cm_damp_yaw": 0.1,
            "controller.P_rest_alpha": 2.0,
        },
    )
    parameters = scenario.controller
    plant, controller = build_plant(scenario), build_controller(scenario)
    reference = build_reference(scenario).preview(0, 600)
    x, U = plant.initial_state(), plant.initial_control()
    Pu = None
    s14 = paper.s14_sequence(reference, round(1.0 / DT), 20, times_reference_sign=True)
    problem = plain_utc.Problem(
        lambda x, u, dt: model_step(plant, x, u), lambda x: x[12:13], DT, (parameters.horizon_steps,),
        np.array(paper.U_MIN), np.array(paper.U_MAX), np.array([np.inf, np.inf, np.inf, paper.SLEW * DT]),
        np.diag([parameters.P_err, 0.1, 2.0]), parameters.W0, parameters.covariance_floor, None, (0, 3), (0.3, 0.0),
    )  # fmt: skip
    for k in range(12):
        window = reference[k : k + controller.preview_steps + 1]
        decision = controller.decide(x, window)
        signs = paper.coupling_signs("eq_q1", reference[k], reference[k + 1])
        Pu = paper.initial_covariance(*signs, -1.0) if Pu is None else Pu
        Qu = paper.process_noise(*signs, s14[k])
        U, Pu, _ = plain_utc.step(U, Pu, x, window[:, None], Qu, problem)
        np.testing.assert_allclose(decision.control, U, rtol=1e-9, atol=1e-10)
        x = model_step(plant, x, U)


def model_step(plant, x, u):
    """The plant's own model with the posture held over the step, as every prediction takes it."""
    following = np.empty_like(x)
    rk4_step(plant.model, x, u, following, np.empty(WORK_SIZE))
    return following


BEYOND = {
    "controller.k_hyst_s": 0.7,
    "controller.full_coupling_acceleration": 6.1,
    "controller.aim": "tangent",
}


def test_one_setting_follows_a_slow_turn_that_the_papers_setting_loses():
    """300 deg/s at 0.1 Hz for 6 s: the swing down from the peak, where damping and pattern fight each other."""
    turn = {"reference.amplitude_deg_s": 300.0, "reference.frequency_hz": 0.1, "duration_s": 6.0}
    paper_setting = metrics(simulate(load_scenario("fast_turn_unknown_dynamics", turn)))
    beyond = metrics(simulate(load_scenario("fast_turn_unknown_dynamics", turn | BEYOND)))
    assert paper_setting["rmse_deg_s"] > 10.0
    assert beyond["rmse_deg_s"] < 1.0
    assert beyond["convergence_time_s"] < 1.0


def test_the_tangent_takes_away_the_lag_of_the_horizon():
    """A held control that meets the reference at T leaves T^2 / 2 of its second derivative.

    200 deg/s at 0.3 Hz, T = 84 ms: 2.5 deg/s at the peaks, 1.8 RMS; the rest of the error is the same.
    """
    turn = {"reference.amplitude_deg_s": 200.0, "reference.frequency_hz": 0.3, "duration_s": 8.0}
    end_point = BEYOND | turn | {"controller.aim": "end_point"}
    lagging = metrics(simulate(load_scenario("fast_turn_unknown_dynamics", end_point)))["rmse_deg_s"]
    tangent = metrics(simulate(load_scenario("fast_turn_unknown_dynamics", turn | BEYOND)))["rmse_deg_s"]
    assert lagging == pytest.approx(np.hypot(tangent, 1.8), abs=0.3)

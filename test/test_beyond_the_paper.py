"""What the paper does not have: off by default, and what it does when it is on."""

import msgspec
import numpy as np
import paper_utc as paper
import plain_utc
import pytest
from scipy.optimize import least_squares

from skydiver_utc import Status, UnscentedTransformController
from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.control.coupling import CouplingSchedule
from skydiver_utc.parameters import ParameterError, load_scenario
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
    assert parameters.iterations == 1


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
        (
            {"P_rest": 1.0, "rest": 9.0},
            r"^rest of control 0 is 9, outside its bounds -1 \.\. 2: change one\.$",
        ),
        ({"P_rest": [np.inf, 1.0], "rest": -1.5}, r"^rest of control 1 is -1\.5, outside its bounds"),
    ],
)
def test_a_wrong_rest_is_named(given, named):
    with pytest.raises(ValueError, match=named):
        drawn_sum(**given)


@pytest.mark.parametrize(
    "given", [{"P_rest": 1.0, "rest": 2.0}, {"P_rest": [np.inf, 1.0], "rest": [9.0, -1.0]}]
)
def test_a_rest_on_a_bound_is_taken_and_that_of_a_free_control_is_not_asked(given):
    assert drawn_sum(**given).step([0.0], 0.5).status is Status.SOLVED


def drawn_sum(**given):
    return UnscentedTransformController(
        lambda x, u, dt: np.array([u[0] + u[1]]), state=[0.0], control=[0.0, 0.0], dt=1.0, horizon=1, Pu=1e-2,
        minimum=-1.0, maximum=2.0, **given,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"rest_Cm_damp_yaw": 9.0}, "rest_Cm_damp_yaw is 9 without P_rest_Cm_damp_yaw"),
        (
            {"rest_Cm_damp_yaw": 0.3, "P_rest_hands": 1.0},
            "rest_Cm_damp_yaw is 0.3 without P_rest_Cm_damp_yaw",
        ),
        (
            {"rest_Cm_damp_yaw": 9.0, "P_rest_Cm_damp_yaw": 0.05},
            "draws Cm_damp_yaw to rest at 9, outside plant.limits.Cm_damp_yaw [0.01, 6.0]",
        ),
        ({"P_rest_Cm_damp_yaw": 0.05}, "draws Cm_damp_yaw to rest at 0, outside plant.limits.Cm_damp_yaw"),
    ],
)
def test_a_wrong_rest_of_the_skydiver_is_named(given, told):
    with pytest.raises(ParameterError) as raised:
        load_scenario("fast_turn_unknown_dynamics", {f"controller.{name}": v for name, v in given.items()})
    assert told in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_control_whose_limits_leave_its_rest_out_is_named():
    """Hands are at rest at zero."""
    changes = {
        "controller.P_rest_hands": 1.0, "plant.limits.k_left": [0.5, 5.0], "initial.k_left": 1.0,
    }  # fmt: skip
    with pytest.raises(ParameterError, match=r"draws k_left to rest at 0, outside plant\.limits\.k_left"):
        load_scenario("fast_turn_unknown_dynamics", changes)
    assert load_scenario("fast_turn_unknown_dynamics", changes | {"controller.P_rest_hands": 0.0})


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


def static(output, **options):
    """A controller of a plant without memory: the output of one step is a function of the control."""
    return UnscentedTransformController(
        lambda x, u, dt: u + 0.0 * x, output, state=[0.0, 0.0], control=[0.1, -0.2], dt=1.0, horizon=1,
        Pu=1.0, Qu=0.0, **options,
    )  # fmt: skip


def test_iterations_change_nothing_where_outputs_are_linear():
    B = np.array([[1.0, -0.7], [0.3, 2.0], [0.4, 0.1]])
    once, often = (static(lambda u: B @ u, P_err=0.05, iterations=n) for n in (1, 4))
    for wanted in ([1.0, 0.5, -0.3], [0.2, -2.0, 0.4]):
        one, other = once.step([0.0, 0.0], wanted), often.step([0.0, 0.0], wanted)
        np.testing.assert_allclose(other.control, one.control, atol=1e-9)
        np.testing.assert_allclose(other.covariance, one.covariance, atol=1e-9)
        np.testing.assert_allclose(other.predicted, one.predicted, atol=1e-12)


@pytest.mark.parametrize("wanted", [0.2, 3.0, 8.0])
def test_iterations_find_the_most_probable_control_of_a_curved_output(wanted):
    """y = exp(u0 + u1 / 2): against SciPy's minimum of (y - r)^2 / P_err + (U - U_0)' Pu^-1 (U - U_0)."""

    def output(u):
        return np.exp(u[0] + 0.5 * u[1])

    P_err, start = 1e-4, np.array([0.1, -0.2])
    best = least_squares(
        lambda u: np.append(u - start, (output(u) - wanted) / np.sqrt(P_err)), start, xtol=1e-12
    )
    errors = []
    for iterations in (1, 8):
        controller = static(output, P_err=P_err, iterations=iterations)
        errors.append(np.abs(controller.step([0.0, 0.0], wanted).control - best.x).max())
    # What is left is the spread of the newest Pu across the direction that the output sees.
    assert errors[1] < 0.02
    assert errors[1] < 0.2 * errors[0]


def test_a_point_lost_in_a_later_iteration_leaves_the_pass_before():
    """The model ends at u0 = 1.5: the first pass stays inside, the second would not."""
    calls = []

    def output(u):
        calls.append(u[0])
        return np.nan if u[0] > 1.5 else u[0]

    once, often = (static(output, P_err=0.2, iterations=n, minimum=-1.0, maximum=3.0) for n in (1, 3))
    once.reset(Pu=0.2), often.reset(Pu=0.2)
    one = once.step([0.0, 0.0], 2.5)
    calls.clear()
    other = often.step([0.0, 0.0], 2.5)
    assert max(calls) > 1.5
    assert other.lost > 0
    assert other.status is Status.REPAIRED
    np.testing.assert_array_equal(other.control, one.control)


@pytest.mark.parametrize("iterations", [1, 2, 4])
def test_what_every_iteration_repairs_adds_up(iterations):
    """y = u: each pass leaves Pu P_err / (Pu + P_err) = 0.2 of Pu = 1, the next lifts that to the floor of 0.3."""
    controller = UnscentedTransformController(
        lambda x, u, dt: u + 0.0 * x, state=[0.0], control=0.1, dt=1.0, horizon=1, Pu=1.0, Qu=0.0, P_err=0.25,
        iterations=iterations, covariance_floor=0.3,
    )  # fmt: skip
    result = controller.step([0.0], 1.0)
    assert result.repaired == pytest.approx((iterations - 1) * (0.3 - 0.2), rel=1e-9)
    assert result.status is (Status.SOLVED if iterations == 1 else Status.REPAIRED)


@pytest.mark.parametrize("options", [{"W0": -0.1}, {"square_root": True}])
def test_iterations_refuse_what_they_cannot_do(options):
    with pytest.raises(ValueError, match="iterations is 2"):
        static(lambda u: u[0], iterations=2, **options)


def test_the_skydivers_iterations_refuse_what_they_cannot_do():
    scenario = load_scenario(
        "fast_turn_unknown_dynamics", {"controller.iterations": 2, "controller.square_root": True}
    )
    with pytest.raises(ParameterError, match=r"controller\.iterations is 2"):
        build_controller(scenario)


def test_the_skydiver_flies_with_iterations():
    """They gain nothing here (docs/beyond.md), and lose nothing in the first three seconds."""
    settings = {
        "controller.iterations": 2,
        "controller.rest_Cm_damp_yaw": 0.01,
        "controller.P_rest_Cm_damp_yaw": 0.1,
        "duration_s": 3.0,
    }
    flown = metrics(simulate(load_scenario("fast_turn_unknown_dynamics", settings)))
    assert flown["outcome"] == "completed"
    assert flown["rmse_deg_s"] < 20.0


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


@pytest.mark.parametrize(("amplitude", "frequency"), [(400.0, 0.15), (200.0, 0.3)])
def test_controls_drawn_to_rest_keep_turns_that_are_lost_without(amplitude, frequency):
    """The scenario's setting for all turns, first with nothing drawn to rest; one period after the first 2 s."""
    turn = {
        "reference.amplitude_deg_s": amplitude,
        "reference.frequency_hz": frequency,
        "duration_s": 2.0 + 1.0 / frequency,
    }
    drawn_names = ("rest_Cm_damp_yaw", "P_rest_Cm_damp_yaw", "P_rest_hands")
    free = {f"controller.{name}": 0.0 for name in drawn_names}
    drawn, lost = (
        metrics(simulate(load_scenario("fast_turn_beyond_the_paper", turn | more))) for more in ({}, free)
    )
    assert drawn["rmse_deg_s"] < 1.0
    assert drawn["convergence_time_s"] < 1.0
    assert lost["rmse_deg_s"] > 1.5 * drawn["rmse_deg_s"]


def test_the_tangent_takes_away_the_lag_of_the_horizon():
    """A held control that meets the reference at T leaves T^2 / 2 of its second derivative.

    200 deg/s at 0.3 Hz, T = 84 ms: 2.5 deg/s at the peaks, 1.8 RMS; the rest of the error is the same.
    """
    turn = {"reference.amplitude_deg_s": 200.0, "reference.frequency_hz": 0.3, "duration_s": 8.0}
    end_point = BEYOND | turn | {"controller.aim": "end_point"}
    lagging = metrics(simulate(load_scenario("fast_turn_unknown_dynamics", end_point)))["rmse_deg_s"]
    tangent = metrics(simulate(load_scenario("fast_turn_unknown_dynamics", turn | BEYOND)))["rmse_deg_s"]
    assert lagging == pytest.approx(np.hypot(tangent, 1.8), abs=0.3)

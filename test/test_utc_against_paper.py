"""UTC, its couplings and the pose controller against the paper's equations written out apart from the code."""

import msgspec
import numpy as np
import paper_utc as paper
import pytest
from scipy.linalg import sqrtm
from scipy.spatial.transform import Rotation

from skydiver_utc.control.coupling import CouplingSchedule
from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.control.pose import PoseController
from skydiver_utc.control.protocol import Status
from skydiver_utc.control.utc import UtcLaw
from skydiver_utc.control.utc_step import Recovery
from skydiver_utc.parameters import PoseControllerParameters, load_scenario
from skydiver_utc.plant.dynamics import WORK_SIZE, rk4_step
from skydiver_utc.simulation.build import build_controller, build_plant, build_reference
from skydiver_utc.unscented.covariance import symmetric_root
from skydiver_utc.unscented.sigma_points import weights

DT = 0.0042
PAPER_UTC = load_scenario("fast_turn_unknown_dynamics").controller
PAPER_LIMITS = ControlLimits(
    np.array(paper.U_MIN), np.array(paper.U_MAX), np.array([np.inf, np.inf, np.inf, paper.SLEW * DT])
)


def unlimited(m):
    return ControlLimits(np.full(m, -np.inf), np.full(m, np.inf), np.full(m, np.inf))


def dense_covariance(rng, m):
    factor = rng.normal(size=(m, m))
    return factor @ factor.T + 0.1 * np.eye(m)


@pytest.mark.parametrize(
    ("m", "outputs", "W0"), [(4, 1, 0.25), (4, 2, 0.25), (3, 3, 0.0), (6, 2, -0.5), (1, 1, 0.25)]
)
def test_linear_oracle(m, outputs, W0):
    """For y = B u without bounds the update is u0 + K (r - B u0), K = Pu B' (B Pu B' + R)^-1, to 1e-12."""
    rng = np.random.default_rng(m)
    B, Pu, u0 = rng.normal(size=(outputs, m)), dense_covariance(rng, m), rng.normal(size=m)
    R, r = dense_covariance(rng, outputs) * 1e-2, rng.normal(size=outputs)

    def predict(state, applied, points, preview, y, saved):
        y[:] = points @ B.T
        saved[:] = points

    controller = UtcLaw(predict, unlimited(m), R, W0)
    controller.reset(u0, Pu)
    Qu = dense_covariance(rng, m)
    step = controller.step(np.zeros(1), np.zeros(1), r, Qu)
    expected = paper.linear_oracle(u0, Pu, B, R, r)
    np.testing.assert_allclose(step.control, expected, rtol=1e-12, atol=1e-12)
    K = Pu @ B.T @ np.linalg.inv(B @ Pu @ B.T + R)
    np.testing.assert_allclose(controller.covariance, Pu + Qu - K @ B @ Pu, rtol=1e-11, atol=1e-11)
    assert step.status is Status.SOLVED


def test_weights_are_those_of_eq_sigp():
    np.testing.assert_array_equal(weights(4, 0.25), paper.weights(4, 0.25))
    assert weights(4, 0.25).sum() == pytest.approx(1.0, rel=1e-15)


@pytest.mark.parametrize("seed", range(10))
def test_symmetric_root_of_a_covariance(seed):
    """Against SciPy's matrix square root of the repaired matrix; the repair is what the clipped eigenvalues add."""
    rng = np.random.default_rng(seed)
    Pu = paper.initial_covariance(*rng.choice([-1.0, 1.0], 3)) + 1e-3 * dense_covariance(rng, 4) * (seed % 2)
    given, root = Pu.copy(), np.empty((4, 4))
    lifted = symmetric_root(given, 1e-9, False, root, np.empty(4), np.empty((4, 4)))
    repaired = paper.repair(Pu, 1e-9)
    np.testing.assert_allclose(given, repaired, atol=1e-12)
    np.testing.assert_allclose(root @ root, repaired, atol=1e-12)
    np.testing.assert_allclose(root, paper.matrix_square_root(repaired), atol=1e-6)
    values = np.linalg.eigvalsh(Pu)
    assert lifted == pytest.approx(np.maximum(1e-9 - values, 0.0).sum(), rel=1e-6, abs=1e-12)


def test_the_printed_covariance_keeps_only_the_real_part_of_its_root():
    """Against SciPy's complex root of the indefinite Pu, which itself is left as it is."""
    Pu = paper.initial_covariance(1.0, -1.0, -1.0)
    given, root = Pu.copy(), np.empty((4, 4))
    lifted = symmetric_root(given, 1e-9, True, root, np.empty(4), np.empty((4, 4)))
    np.testing.assert_allclose(root, sqrtm(Pu).real, atol=1e-7)
    np.testing.assert_array_equal(given, Pu)
    assert lifted == pytest.approx(0.208, abs=1e-3)


def nonlinear_plant(x, u, dt):
    """A toy with the skydiver's controls: yaw driven by alpha and the hands, damped by Cm."""
    rate = x[0] + dt * (9.0 * np.sin(u[3]) + 0.3 * (u[2] - u[1]) - 4.0 * u[0] * x[0] - 0.2 * x[0] * abs(x[0]))
    return np.array([rate])


def held_step(plant, x, u):
    """The controller's model: the posture held over the step."""
    following = np.empty(13)
    rk4_step(plant.model, x, u, following, np.empty(WORK_SIZE))
    return following


def toy_predict(steps):
    def predict(state, applied, points, preview, y, saved):
        for i, point in enumerate(points):
            x, alpha = state, applied[3]
            for _ in range(steps):
                alpha = np.clip(point[3], alpha - paper.SLEW * DT, alpha + paper.SLEW * DT)
                x = nonlinear_plant(x, np.array([*point[:3], alpha]), DT)
            y[i] = x
            saved[i] = point

    return predict


@pytest.mark.parametrize("move", ["unclipped", "printed"])
@pytest.mark.parametrize("seed", range(8))
def test_one_step_equals_the_paper(seed, move):
    """Random controls, some on their bounds, an indefinite Pu, a nonlinear plant: agreement to 1e-9."""
    rng = np.random.default_rng(seed)
    low, high = np.array(paper.U_MIN), np.array(paper.U_MAX)
    U = low + rng.random(4) * (high - low)
    on_bound = rng.random(4)
    U = np.where(on_bound < 0.3, low, np.where(on_bound > 0.7, high, U))
    signs = rng.choice([-1.0, 1.0], 3)
    Pu, Qu = paper.initial_covariance(*signs), paper.process_noise(*signs)
    x, r = rng.normal(0, 3, 1), rng.normal(0, 3, 21)
    controller = UtcLaw(
        toy_predict(20), PAPER_LIMITS, np.array([[1e-4]]), 0.25, move_unclipped=move == "unclipped"
    )
    controller.reset(U, Pu)
    step = controller.step(x, r, r[20:], Qu)
    order = "move_then_bound" if move == "unclipped" else "bound_then_move"
    settings = paper.Settings(dt=DT, order=order)
    expected = paper.utc_step(U, Pu, x, r, Qu, nonlinear_plant, lambda s: s, lambda s: float(s[0]), settings)
    np.testing.assert_allclose(step.control, expected.U, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(step.predicted, expected.updated.Ypred, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(controller.covariance, expected.Pu, rtol=1e-7, atol=1e-7)


READINGS = [
    {},
    {"horizon_steps": 5, "alpha_dynamics": "incremental", "saved_control_reading": "first_step"},
    {
        "horizon_steps": 5,
        "alpha_dynamics": "incremental",
        "saved_control_reading": "horizon",
        "tau_s": 0.0084,
    },
    {
        "alpha_dynamics": "incremental",
        "saved_control_reading": "first_step",
        "first_increment_reading": "measured",
    },
    {"horizon_steps": 5, "alpha_dynamics": "positional", "saved_control_reading": "first_step"},
    {"saved_control_reading": "first_step"},
    {"weights_reading": "printed"},
    {"move_reading": "printed"},
]
_DYNAMICS = {"unknown": "held", "incremental": "incremental", "positional": "positional"}
_SAVED = {"drawn": "drawn", "first_step": "after_first_step", "horizon": "at_horizon"}


@pytest.mark.parametrize("readings", READINGS, ids=lambda r: "-".join(map(str, r.values())) or "default")
def test_skydiver_utc_equals_the_paper(readings):
    """Twelve closed-loop steps of the skydiver's UTC against the paper's text driving the same plant."""
    scenario = load_scenario(
        "fast_turn_unknown_dynamics", {f"controller.{name}": value for name, value in readings.items()}
    )
    parameters = scenario.controller
    plant, controller = build_plant(scenario), build_controller(scenario)
    reference = build_reference(scenario).preview(0, 600)
    settings = paper.Settings(
        dt=scenario.dt_s,
        N=parameters.horizon_steps,
        tau=round(parameters.tau_s / scenario.dt_s),
        floor=parameters.covariance_floor,
        dynamics=_DYNAMICS[parameters.alpha_dynamics],
        saved=_SAVED[parameters.saved_control_reading],
        recursion="applied",
        order="bound_then_move" if parameters.move_reading == "printed" else "move_then_bound",
        weights="eq:zpred for Ypred" if parameters.weights_reading == "printed" else "eq:sigp",
    )
    k_hyst = round(1.0 / scenario.dt_s)
    s14 = paper.s14_sequence(reference, k_hyst, 20, times_reference_sign=True)
    x = plant.initial_state()
    U = plant.initial_control()
    measured = None
    for k in range(12):
        window = reference[k : k + controller.preview_steps + 1]
        decision = controller.decide(x, window)
        s12, s13 = paper.coupling_signs("eq_q1", reference[k], reference[k + 1])
        if k == 0:
            Pu = paper.initial_covariance(s12, s13, -1.0)
        Qu = paper.process_noise(s12, s13, s14[k])
        expected = paper.utc_step(
            U, Pu, x, window, Qu, lambda s, u, dt: held_step(plant, s, u),
            lambda s: s[12:13], lambda s: float(s[12]), settings, y_before=measured,
        )  # fmt: skip
        if parameters.first_increment_reading == "measured":
            measured = float(x[12])
        np.testing.assert_allclose(decision.control, expected.U, rtol=1e-7, atol=1e-8)
        assert decision.telemetry[0] == pytest.approx(float(expected.updated.Ypred[0]), rel=1e-8, abs=1e-10)
        U, Pu = expected.U, expected.Pu
        x = held_step(plant, x, U)


@pytest.mark.parametrize("sign", ["signed", "printed"])
@pytest.mark.parametrize("recursion", ["printed", "no_hysteresis", "look_ahead"])
def test_s14_over_the_whole_turn(recursion, sign):
    scenario = load_scenario("fast_turn_unknown_dynamics")
    reference = build_reference(scenario).preview(0, scenario.steps + 300)
    parameters = msgspec.structs.replace(
        scenario.controller, s14_recursion_reading=recursion, s14_sign_reading=sign
    )
    schedule = CouplingSchedule(parameters, k_hyst=238, dt_s=DT)
    expected = paper.s14_sequence(reference, 238, scenario.steps, recursion, sign == "signed")
    got = [np.sign(schedule.process_noise(reference[k : k + 238 + 2])[0, 3]) for k in range(scenario.steps)]
    np.testing.assert_array_equal(got, expected)


@pytest.mark.parametrize(
    ("coupling", "label"), [("yaw_rate", "eq_q1"), ("yaw_acceleration", "eq_q3"), ("none", "none")]
)
def test_process_noise_signs(coupling, label):
    rng = np.random.default_rng(1)
    schedule = CouplingSchedule(msgspec.structs.replace(PAPER_UTC, coupling=coupling), k_hyst=2, dt_s=DT)
    raw = -1.0
    for _ in range(50):
        r = rng.normal(size=4)
        s12, s13 = paper.coupling_signs(label, r[0], r[1])
        raw = paper.s14_sequence(r, 2, 1, initial=raw)[0]
        expected = paper.process_noise(s12, s13, raw * np.sign(r[0]))
        np.testing.assert_allclose(schedule.process_noise(r), expected, rtol=1e-15)


def test_initial_covariance_is_the_printed_one():
    schedule = CouplingSchedule(PAPER_UTC, k_hyst=2, dt_s=DT)
    np.testing.assert_array_equal(
        schedule.initial_covariance(np.array([1.0, 1.0, 1.0, 1.0])), paper.initial_covariance(1, -1, -1)
    )


def test_pose_controller_equals_eq_lim():
    rng = np.random.default_rng(0)
    controller = PoseController(PoseControllerParameters(), PAPER_LIMITS, np.array(paper.U_INITIAL), 12)
    previous = 0.0
    for _ in range(500):
        state = np.zeros(13)
        state[12] = rng.normal(0, 3)
        r = rng.normal(0, 3, 1)
        control = controller.decide(state, r).control
        previous = paper.pose_controller(float(r[0]), float(state[12]), previous, DT)
        np.testing.assert_allclose(control, [0.5, 0.0, 0.0, previous], rtol=1e-14)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_diverging_prediction_keeps_the_previous_control(bad):
    def predict(state, applied, points, preview, y, saved):
        y[:] = bad
        saved[:] = points

    controller = UtcLaw(predict, PAPER_LIMITS, np.array([[1e-4]]), 0.25)
    controller.reset(np.array(paper.U_INITIAL), paper.initial_covariance(1, -1, -1))
    covariance = controller.covariance.copy()
    step = controller.step(np.zeros(1), np.zeros(1), np.ones(1), paper.process_noise(1, -1, -1))
    assert step.status is Status.KEPT_PREVIOUS
    assert np.isfinite(step.predicted).all()
    assert np.isfinite(step.innovation).all()
    np.testing.assert_array_equal(step.control, paper.U_INITIAL)
    np.testing.assert_array_equal(controller.covariance, covariance)
    assert step.recovery is Recovery.RESTARTED


@pytest.mark.parametrize("lost", [[3], [0, 2], [1, 2, 3, 4]])
def test_a_point_that_diverges_counts_no_more(lost):
    """The update is eq:xpred to eq:utc_controller over the other points, their weights scaled to sum to one."""
    rng = np.random.default_rng(8)
    m, Pu, Qu, u0 = 3, dense_covariance(rng, 3), dense_covariance(rng, 3), rng.normal(size=3)
    B, R, r = rng.normal(size=(2, m)), np.diag([0.1, 0.2]), rng.normal(size=2)
    drawn = paper.sigma_points(u0, Pu, 0.25)

    def predict(state, applied, points, preview, y, saved):
        y[:] = points @ B.T
        y[lost] = np.nan
        saved[:] = points

    controller = UtcLaw(predict, unlimited(m), R, 0.25)
    controller.reset(u0, Pu)
    step = controller.step(np.zeros(1), np.zeros(1), r, Qu)
    left = np.delete(drawn, lost, axis=0)
    W = np.delete(paper.weights(m, 0.25), lost)
    W = W / W.sum()
    U_pred, Pu_pred = paper.predict(left, W, Qu)
    expected = paper.update(U_pred, Pu_pred, left, left @ B.T, W, r, R)
    np.testing.assert_allclose(step.control, expected.U, rtol=1e-10)
    np.testing.assert_allclose(controller.covariance, expected.Pu, rtol=1e-9, atol=1e-10)
    assert (step.status, step.lost) == (Status.REPAIRED, len(lost))


def test_further_outputs_equal_the_paper_with_three_outputs():
    """Yaw rate, roll rate and fall rate tracked together, twelve steps against the paper's text with l = 3."""
    scenario = load_scenario("fast_turn_paper_hands")
    parameters = scenario.controller
    plant, controller = build_plant(scenario), build_controller(scenario)
    reference = build_reference(scenario).preview(0, 600)
    settings = paper.Settings(
        dt=scenario.dt_s,
        N=parameters.horizon_steps,
        P_err=np.diag([parameters.P_err, parameters.P_err_roll_rate, parameters.P_err_fall_rate]),
        floor=parameters.covariance_floor,
        dynamics="incremental",
        saved="after_first_step",
        recursion="applied",
    )

    def outputs(x):
        downwards = -(Rotation.from_quat(x[3:7]).apply(x[7:10]))[2]
        return np.array([x[12], x[10], downwards])

    s14 = paper.s14_sequence(reference, round(1.0 / scenario.dt_s), 20, times_reference_sign=True)
    x, U, Pu = plant.initial_state(), plant.initial_control(), None
    for k in range(12):
        window = reference[k : k + controller.preview_steps + 1]
        decision = controller.decide(x, window)
        s12, s13 = paper.coupling_signs("eq_q1", reference[k], reference[k + 1])
        Pu = paper.initial_covariance(s12, s13, -1.0) if Pu is None else Pu
        wanted = np.array([window[settings.N], 0.0, scenario.initial.fall_speed_m_s])
        expected = paper.utc_step(
            U, Pu, x, window, paper.process_noise(s12, s13, s14[k]), lambda s, u, dt: held_step(plant, s, u),
            outputs, lambda s: float(s[12]), settings, y_ref=wanted,
        )  # fmt: skip
        np.testing.assert_allclose(decision.control, expected.U, rtol=1e-6, atol=1e-8)
        U, Pu = expected.U, expected.Pu
        x = held_step(plant, x, U)

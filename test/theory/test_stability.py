# SPDX-License-Identifier: Apache-2.0
"""`skydiver-utc stability`: what it predicts, against flights of the package's controller."""

import copy
import json

import numpy as np
import pytest
from command_line import invoke
from skydivers import step_of

import skydiver_utc.loop.linear_loop as linear_loop
from skydiver_utc.controllers.utc.settings import UtcSettings
from skydiver_utc.controllers.utc.unscented_transform_controller import UnscentedTransformController
from skydiver_utc.loop.build import build_plant
from skydiver_utc.parameters import ParameterError, load_scenario
from skydiver_utc.parameters.linear_plant import load_linear_plant
from skydiver_utc.plants.function import FunctionPlant
from skydiver_utc.plants.linear import LinearModel
from skydiver_utc.plants.skydiver.dynamics import STATE_SIZE
from skydiver_utc.plants.skydiver.linearise import velocity_axes
from skydiver_utc.plants.skydiver.model import build_model
from skydiver_utc.plants.skydiver.steady import HeldBody, steady_turn, straight_falls
from skydiver_utc.rotations import attitude_with_up
from skydiver_utc.studies.linear_theory import of_linear_plant, of_skydiver, report
from skydiver_utc.theory.linear_plant import with_outputs_of_controls
from skydiver_utc.theory.stability import analyse

SCENARIO = load_scenario("fast_turn_unknown_dynamics")
ALPHA = 0.3


def random_plant(seed, n=4, m=3, outputs=2):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n))
    A *= 0.95 / np.abs(np.linalg.eigvals(A)).max()
    return LinearModel(A, rng.normal(size=(n, m)), rng.normal(size=(outputs, n))), rng


@pytest.mark.parametrize("seed", range(4))
def test_eigenvalues_predict_a_flight_on_a_random_plant(seed):
    """The whole run of UTC against powers of Z, stable or not, and so the decay."""
    plant, rng = random_plant(seed)
    Qu, P_err = 0.1 * np.eye(3), 0.1 * np.eye(2)
    found = analyse(plant, 2, Qu, P_err, 0.0)
    start = rng.normal(size=7)
    run = linear_loop.fly_linear(plant, 2, Qu, P_err, found, start, 30)
    expected = np.array([np.linalg.matrix_power(found.Z, k) @ start for k in range(31)])
    np.testing.assert_allclose(run, expected, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize("steps", [1, 3])
def test_nominal_controls_fly_as_outputs_of_the_linear_plant(steps):
    """Z of the plant with further outputs, against the library's controller with nominal values."""
    plant, rng = random_plant(7)
    Qu, P_err, variances = 0.1 * np.eye(3), 0.1, {"u0": 0.3, "u2": 0.5}
    further = with_outputs_of_controls(plant, [0, 2])
    found = analyse(further, steps, Qu, np.diag([P_err, P_err, *variances.values()]), 0.0)
    x, u = rng.normal(size=4), np.zeros(3)
    settings = UtcSettings(
        horizon_steps=steps, P_err=P_err, Qu=Qu.tolist(), Pu=found.gain.covariance.tolist(), covariance_floor=0.0,
        nominal={name: {"value": 0.0, "variance": variance} for name, variance in variances.items()},
    )  # fmt: skip
    functions = FunctionPlant(
        lambda state, control, dt: plant.A @ state + plant.B @ control,
        lambda state: plant.C @ state,
        state=x, control=u, dt=1.0,
    )  # fmt: skip
    controller = UnscentedTransformController(settings, functions)
    z = np.concatenate([x, u[[0, 2]], u])
    for _ in range(20):
        u = controller.step(x, np.zeros(2)).control
        x, z = plant.A @ x + plant.B @ u, found.Z @ z
        np.testing.assert_allclose(np.concatenate([x, u[[0, 2]], u]), z, atol=1e-9)


@pytest.mark.long
def test_nothing_rests_elsewhere_and_no_covariance_grows_where_controls_are_drawn():
    free = report(of_skydiver(load_scenario("fast_turn_unknown_dynamics"), ALPHA))
    drawn = report(of_skydiver(load_scenario("fast_turn_beyond_the_paper"), 0.0))
    assert (free["states_of_rest"], drawn["states_of_rest"]) == (3, 0)
    assert free["Pu_growth_per_step"] > 1e-3 > 1e-9 > drawn["Pu_growth_per_step"]
    assert drawn["stable"]
    assert drawn["measured_decay"] == pytest.approx(drawn["decay"], rel=2e-3)


@pytest.mark.parametrize("steps", [1, 20])
def test_admire_decays_as_predicted_and_stays_in_its_ball(steps):
    """The push of the size f_bar always points outwards, the worst of its kind."""
    values = json.loads(invoke("stability", "--plant", "admire", "--steps", steps, "--json").stdout)
    assert values["stable"]
    assert values["states_of_rest"] == 1
    assert values["measured_decay"] == pytest.approx(values["decay"], rel=1e-4)
    ball = values["ball"]
    assert 0.0 < ball["measured"] <= ball["from_rest"] <= ball["radius"] <= ball["kept"]


def steady():
    model = build_model(SCENARIO.plant, SCENARIO.dt_s)
    fall, control = straight_falls(model)[0], np.array([SCENARIO.plant.initial.Cm_damp_yaw, 0.0, 0.0, 0.0])
    for control[3] in np.linspace(0.0, ALPHA, 13)[1:]:
        fall = steady_turn(HeldBody(model, control), fall)
    return model, fall, control


def state_of(fall):
    return np.concatenate([np.zeros(3), attitude_with_up(fall.up), fall.velocity, fall.rates])


def after_a_step(model, state, control):
    following = np.empty(STATE_SIZE)
    step_of(model)(state, control, following)
    return following


def test_effect_of_the_controls_against_the_flight():
    """B of one step against a step of the skydiver with each control moved."""
    # At the scenario's own step RK4 itself is off by 6e-4: a mode of roll is as short as 8 ms.
    model, fall, control = steady()
    model = model._replace(dt=2e-4)
    B = of_skydiver(load_scenario(SCENARIO.name, {"dt_s": model.dt}), ALPHA).plant.B
    axes = velocity_axes(fall)
    for j in range(4):
        ends = []
        for sign in (1.0, -1.0):
            moved = control.copy()
            moved[j] += sign * 1e-2
            end = after_a_step(model, state_of(fall), moved)
            ends.append(np.concatenate([end[10:], axes @ end[7:10]]))
        np.testing.assert_allclose((ends[0] - ends[1]) / 2e-2, B[2:, j], atol=1e-4 * np.abs(B[2:, j]).max())


def test_the_skydiver_near_a_steady_turn_follows_the_linear_loop():
    """The nonlinear skydiver under the package's UTC, without bounds, against powers of Z, over 60 steps.

    Qu and P_err are made smaller alike: the gain is the same, and the sigma points stay where the plant is linear.
    """
    tuned = of_skydiver(SCENARIO, ALPHA)
    found = analyse(tuned.plant, tuned.horizon_steps, tuned.Qu, tuned.P_err, 0.0)
    model, fall, control = steady()
    plant = copy.copy(build_plant(SCENARIO))
    plant.maximum = plant.rate = np.full(4, 1e6)
    plant.minimum = -plant.maximum
    Pu = 1e-8 * (found.gain.covariance + found.gain.growth)
    settings = UtcSettings(
        horizon_steps=tuned.horizon_steps, P_err=(1e-8 * tuned.P_err).tolist(), W0=0.25, covariance_floor=0.0,
        Qu=(1e-8 * tuned.Qu).tolist(), Pu=Pu.tolist(),
    )  # fmt: skip
    controller = UnscentedTransformController(settings, plant, ("yaw_rate",))
    controller.reset(control, Pu)
    z, deviation = np.zeros(12), 1e-4
    z[4] = deviation
    state = state_of(fall)
    state[12] += deviation
    for _ in range(60):
        u = controller.step(state, fall.yaw_rate).control
        state = after_a_step(model, state, u)
        z = found.Z @ z
        np.testing.assert_allclose(u - control, z[8:], atol=2e-3 * np.abs(z[8:]).max())
        np.testing.assert_allclose(state[10:] - fall.rates, z[2:5], atol=2e-3 * deviation)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["fast_turn_pose_only"], "take fast_turn_unknown_dynamics"),
        (["fast_turn_pi_dynamics"], "take fast_turn_unknown_dynamics"),
        (["--plant", "nothing"], "choose one of admire"),
        (["--plant", "admire", "--set", "controller.W0=0"], "neither --set nor --alpha"),
        (
            ["--plant", "OWN", "--steps", "500"],
            "grows past 1e+60 within 24 of 500 prediction steps: take fewer --steps",
        ),
        (["--alpha", "20"], "take a smaller --alpha"),
        (["--alpha", "0.2", "--set", "controller.nominal.alpha={value: 0, variance: 1}"], "nominal alpha"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_what_cannot_be_analysed_is_refused_in_one_sentence(tmp_path, arguments, words):
    own = own_plant(tmp_path, "A: [[400]]")
    found = invoke("stability", *(own if word == "OWN" else word for word in arguments))
    assert found.exit_code == 2
    assert words in found.stderr
    assert len(found.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("A: [[1, 0]]", "A must have 1 rows of 1 numbers"),
        ("A: [[1, 0], [0, 1]]", "B must have 2 rows of 1 numbers"),
        ("B: [[1, 2]]", "Qu must have one variance"),
        ("B: [[0]]", "B is zero"),
        ("P_err: [1, 1]", "P_err must have 1 numbers"),
        ("C: [[1, 2]]", "C must have 1 rows of 1 numbers"),
        ("time: weekly", "time"),
        ("Qu: [0]", "Qu is no covariance"),
        ("Qu: [-1]", "Qu is no covariance"),
        ("Qu: []", "Qu must have one variance"),
        ("Qu: [[1, 2]]", "Qu must have one variance"),
        ("Qu: [1, [1]]", "Qu"),
        ("B: [[1, 2]]; Qu: [[1, 2], [2, 1]]", "Qu is no covariance"),
        ("B: [[1, 2]]; Qu: [[2, 1], [0, 2]]", "Qu is no covariance"),
        ("dt_s: 0", "dt_s must be greater than 0"),
    ],
)
def test_a_plant_whose_matrices_do_not_fit_is_refused(tmp_path, line, words):
    with pytest.raises(ParameterError, match=words):
        load_linear_plant(own_plant(tmp_path, *line.split("; ")))


def test_a_whole_matrix_qu_couples_the_controls(tmp_path):
    """One output: the gain has the direction of Qu h (docs/theory.md); variances alone are the diagonal."""
    B, matrix = "B: [[1, 2]]", "[[1, 0.5], [0.5, 1]]"
    coupled = of_linear_plant(own_plant(tmp_path, B, f"Qu: {matrix}"))
    np.testing.assert_array_equal(coupled.Qu, [[1.0, 0.5], [0.5, 1.0]])
    K = np.array(report(coupled)["gain"])[:, 0]
    np.testing.assert_allclose(K / K[0], coupled.Qu @ [1.0, 2.0] / (coupled.Qu @ [1.0, 2.0])[0], rtol=1e-12)
    assert load_linear_plant(own_plant(tmp_path)).source == ""  # which one's own plant need not have
    alone = of_linear_plant(own_plant(tmp_path, B, "Qu: [1, 1]"))
    np.testing.assert_array_equal(alone.Qu, np.eye(2))
    assert np.array(report(alone)["gain"])[1, 0] == pytest.approx(2.0 * np.array(report(alone)["gain"])[0, 0])


def own_plant(folder, *lines):
    """Path of a plant file; `lines` replace its own."""
    fields = {
        "name": "own", "description": "d", "time": "discrete", "dt_s": 1,
        "A": "[[0.9]]", "B": "[[1]]", "Qu": "[1]", "P_err": "[1]",
    }  # fmt: skip
    changed = dict(line.split(": ", 1) for line in lines)
    text = "\n".join(f"{name}: {entry}" for name, entry in (fields | changed).items())
    (folder / "own.yaml").write_text(text)
    return str(folder / "own.yaml")

# SPDX-License-Identifier: Apache-2.0
"""The rivals on the skydiver: their prediction, and what they do when state or model has no finite answer."""

import numpy as np
import pytest
from skydivers import parts_of

from skydiver_utc.controllers.horizon import Horizon
from skydiver_utc.controllers.protocol import Status
from skydiver_utc.controllers.settings import HorizonSettings
from skydiver_utc.loop.build import build_plant
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import ParameterError, load_scenario

TASK = "fast_turn_pose_only"
RIVALS = {
    "pose": {"kind": "pose", "alpha_feed_forward_max": 1.0},
    "lqr": {"kind": "lqr"},
    "gauss_newton_held": {"kind": "gauss_newton", "blocks": 1},
    "gauss_newton": {"kind": "gauss_newton", "horizon_steps": 10, "blocks": 5},
    "mppi": {"kind": "mppi", "samples": 32},
}
ABSURD = {  # what is added to state and reference
    "nan": (np.nan, 0.0),
    "nan_rate": (np.where(np.arange(13) == 12, np.nan, 0.0), 0.0),
    "infinite_speed": (np.where(np.arange(13) == 9, -np.inf, 0.0), 0.0),
    "beyond_the_model": (np.where(np.arange(13) >= 7, 1e200, 0.0), 0.0),
    "nan_reference": (0.0, np.nan),
}


def scenario_of(controller, **overrides):
    return load_scenario(TASK, {"controller": controller} | overrides)


@pytest.fixture(params=RIVALS)
def rival(request):
    """A controller that has decided a few times, the state and the preview, and the plant."""
    plant, reference, controller = parts_of(scenario_of(RIVALS[request.param]))
    state, preview = plant.initial_state(), reference.preview(40, controller.preview_steps + 1)
    for _ in range(3):
        controller.decide(state, preview)
    return plant, controller, state, preview


def assert_sound(decision, plant):
    assert np.isfinite(decision.control).all()
    assert np.isfinite(decision.telemetry).all()
    assert (decision.control >= plant.minimum).all()
    assert (decision.control <= plant.maximum).all()


@pytest.mark.parametrize("absurd", ABSURD)
def test_an_absurd_state_or_reference_yields_a_finite_control_and_no_lasting_harm(rival, absurd):
    plant, controller, state, preview = rival
    before = controller.decide(state, preview)
    of_state, of_reference = ABSURD[absurd]
    decision = controller.decide(state + of_state, preview + of_reference)
    assert_sound(decision, plant)
    if absurd.startswith("nan"):
        assert decision.status is Status.KEPT_PREVIOUS
        np.testing.assert_array_equal(decision.control, before.control)
    for _ in range(3):
        decision = controller.decide(state, preview)
        assert_sound(decision, plant)
        assert decision.status is not Status.KEPT_PREVIOUS


def test_reset_repeats_the_same_bits(rival):
    _, controller, state, preview = rival
    flown = []
    for _ in range(2):
        controller.reset()
        flown.append([controller.decide(state, preview).control.tobytes() for _ in range(4)])
    assert flown[0] == flown[1]


def diverging(name, step_periods):
    """Model steps of ten periods are far beyond what Runge-Kutta bears with this roll damping; a bank excites it."""
    controller = RIVALS[name] | {"step_periods": step_periods}
    banked = {"plant.damping.Cm_damp_roll": 30.0, "plant.initial.bank_deg": 5.0}
    run = simulate(scenario_of(controller, duration_s=0.5, **banked))
    assert np.isfinite(run.commands).all()
    assert np.isfinite(run.telemetry).all()
    return run


@pytest.mark.parametrize("name", ["gauss_newton", "mppi"])
def test_where_the_model_diverges_the_control_is_kept(name):
    run = diverging(name, 1)
    assert not (run.status == Status.KEPT_PREVIOUS).any()
    assert (diverging(name, 10).status == Status.KEPT_PREVIOUS).all()
    if name == "mppi":  # several samples have a weight
        assert np.median(run.telemetry[:, run.telemetry_names.index("effective_samples")]) > 1.5


def test_the_scenarios_seed_seeds_the_samples():
    runs = [simulate(scenario_of(RIVALS["mppi"], duration_s=0.2, seed=s)).commands for s in (1, 1, 2)]
    np.testing.assert_array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])


@pytest.mark.parametrize("name", ["gauss_newton", "gauss_newton_held", "mppi", "lqr"])
def test_commands_keep_bounds_and_rates(name):
    run = simulate(scenario_of(RIVALS[name], duration_s=1.0))
    change = np.abs(np.diff(run.commands, axis=0, prepend=run.plant.initial_control()[None]))
    assert (change <= run.plant.rate * run.scenario.dt_s + 1e-15).all()
    assert (run.commands >= run.plant.minimum).all()
    assert (run.commands <= run.plant.maximum).all()


@pytest.fixture(scope="module")
def plant():
    return build_plant(load_scenario(TASK, {"plant.limbs.reaction": False}))


@pytest.fixture(scope="module")
def turning(plant):
    """A state in the turn, and the control applied last."""
    state, applied = plant.initial_state(), np.array([0.1, 0.4, 0.2, 0.5])
    held = np.append(applied, 0.0)
    for _ in range(200):
        state = plant.step(state, held, held)
    return state, applied


def rolled_out(plant, turning, drawn, **settings):
    """Yaw rates (S, N) of control sequences (S, B, m) over a horizon."""
    horizon = Horizon(HorizonSettings(kind="horizon", **settings), plant, ("yaw_rate",), len(drawn))
    horizon.sequences[:] = drawn
    return horizon.outputs(*turning, np.zeros((horizon.preview_steps + 1, 1)))


def sequences(generator, count, blocks):
    draws = generator.uniform(size=(count, blocks, 4))
    return draws * np.array([2.0, 1.0, 1.0, 0.1]) + np.array([0.01, 0.0, 0.0, 0.45])


def test_a_roll_out_is_the_plant_run_step_by_step(plant, turning):
    drawn = sequences(np.random.default_rng(0), 4, 3)
    outputs = rolled_out(plant, turning, drawn, horizon_steps=6, blocks=3)
    for sequence, rates in zip(drawn, outputs, strict=True):
        (x, applied), following = turning, np.empty(13)
        alpha = applied[3]
        for j in range(6):
            control = sequence[j // 2].copy()
            control[3] = alpha + (0.5 if j % 2 == 0 else 1.0) * (control[3] - alpha)
            plant.bound_model.step(x, control, following)
            x = following.copy()
            alpha = sequence[j // 2, 3] if j % 2 else alpha
            assert rates[j] == pytest.approx(x[12], abs=1e-12)


def test_what_a_sequence_has_in_common_with_the_first_need_not_be_computed_again(plant, turning):
    drawn = sequences(np.random.default_rng(0), 3, 3)
    drawn[1, :1], drawn[2, :2] = drawn[0, :1], drawn[0, :2]
    horizon = Horizon(HorizonSettings(kind="horizon", horizon_steps=6, blocks=3), plant, ("yaw_rate",), 3)
    horizon.begin[1:] = 2, 4
    horizon.sequences[:] = drawn
    found = horizon.outputs(*turning, np.zeros((7, 1)))
    np.testing.assert_array_equal(found, rolled_out(plant, turning, drawn, horizon_steps=6, blocks=3))


def test_a_long_model_step_stands_for_several_control_periods(plant, turning):
    drawn = sequences(np.random.default_rng(1), 3, 2)
    fine = rolled_out(plant, turning, drawn, horizon_steps=16, blocks=2)
    coarse = rolled_out(plant, turning, drawn, horizon_steps=4, blocks=2, step_periods=4)
    moved = np.abs(fine[:, -1] - turning[0][12]).min()
    np.testing.assert_allclose(coarse, fine[:, 3::4], atol=0.02 * moved)


@pytest.mark.parametrize("name", ["lqr", "gauss_newton", "mppi"])
def test_a_reference_of_the_pitch_rate_is_tracked_in_the_pitch_rate(name):
    """A pitch rate changes the control, a yaw rate hardly; the pattern that raises the pitch rate starts at 0."""
    plant, _, controller = parts_of(load_scenario("front_layout", {"controller": RIVALS[name]}))
    preview = np.zeros((controller.preview_steps + 1, 1))

    def decided(**rates):
        state = plant.initial_state()
        for rate, value in rates.items():
            state[plant.state_names.index(rate)] = value
        controller.reset()
        return controller.decide(state, preview).control

    pitch, yaw = plant.state_names[11], plant.state_names[12]
    still = decided()
    by_pitch, by_yaw = decided(**{pitch: -0.05}) - still, decided(**{yaw: -0.05}) - still
    assert np.abs(by_pitch).max() > 10 * np.abs(by_yaw).max()


def test_horizon_and_blocks_must_fit():
    with pytest.raises(ParameterError, match="must be a multiple of blocks"):
        scenario_of({"kind": "mppi", "horizon_steps": 20, "blocks": 3})


@pytest.mark.parametrize("table", ["nominal", "cost", "change_cost"])
def test_a_table_names_controls_of_the_plant_only(table):
    with pytest.raises(ValueError, match=rf"{table}\.elevator"):
        parts_of(scenario_of({"kind": "lqr", table: {"elevator": 1.0}}))

"""The rivals on the skydiver: their prediction, and what they do when state or model has no finite answer."""

import numpy as np
import pytest

from skydiver_utc.control.horizon import Horizon
from skydiver_utc.control.protocol import Status
from skydiver_utc.parameters import ParameterError, load_scenario
from skydiver_utc.plant.model import build_model
from skydiver_utc.plant.skydiver import RATE_AT, SkydiverPlant
from skydiver_utc.plant.steady import straight_falls
from skydiver_utc.plant.yaw import steady_yaw_rates
from skydiver_utc.simulation.build import build_controller, build_plant, build_reference
from skydiver_utc.simulation.closed_loop import simulate
from skydiver_utc.simulation.rollout import SkydiverRollOut

TASK = "fast_turn_pose_only"
RIVALS = {
    "pose": {"kind": "pose", "alpha_feed_forward_max": 1.0},
    "lqr": {"kind": "lqr"},
    "gauss_newton_held": {"kind": "gauss_newton", "blocks": 1},
    "gauss_newton": {"kind": "gauss_newton", "horizon_steps": 10, "blocks": 5},
    "mppi": {"kind": "mppi", "samples": 32},
}
ABSURD = {
    "nan": lambda x: x * np.nan,
    "nan_rate": lambda x: np.where(np.arange(13) == 12, np.nan, x),
    "infinite_speed": lambda x: np.where(np.arange(13) == 9, -np.inf, x),
    "beyond_the_model": lambda x: np.where(np.arange(13) >= 7, 1e200, x),
}


def scenario_of(controller, **overrides):
    return load_scenario(TASK, {"controller": controller} | overrides)


@pytest.fixture(params=RIVALS)
def rival(request):
    """A controller that has decided a few times, the state and the preview, and the scenario."""
    scenario = scenario_of(RIVALS[request.param])
    controller = build_controller(scenario)
    state = build_plant(scenario).initial_state()
    preview = build_reference(scenario).preview(40, controller.preview_steps + 1)
    for _ in range(3):
        controller.decide(state, preview)
    return scenario, controller, state, preview


def is_sound(decision, scenario):
    limits = scenario.plant.limits
    assert np.isfinite(decision.control).all()
    assert np.isfinite(decision.telemetry).all()
    assert (decision.control >= np.array(limits.minimum)).all()
    assert (decision.control <= np.array(limits.maximum)).all()


@pytest.mark.parametrize("absurd", ABSURD)
def test_an_absurd_state_yields_a_finite_control_and_no_lasting_harm(rival, absurd):
    scenario, controller, state, preview = rival
    before = controller.decide(state, preview)
    decision = controller.decide(ABSURD[absurd](state), preview)
    is_sound(decision, scenario)
    if absurd.startswith("nan"):
        assert decision.status is Status.KEPT_PREVIOUS
        np.testing.assert_array_equal(decision.control, before.control)
    for _ in range(3):
        decision = controller.decide(state, preview)
        is_sound(decision, scenario)
        assert decision.status is not Status.KEPT_PREVIOUS


def test_an_absurd_reference_keeps_the_control(rival):
    scenario, controller, state, preview = rival
    before = controller.decide(state, preview)
    decision = controller.decide(state, np.full_like(preview, np.nan))
    assert decision.status is Status.KEPT_PREVIOUS
    np.testing.assert_array_equal(decision.control, before.control)
    is_sound(decision, scenario)


def diverging(name, step_periods):
    """Model steps of ten periods are far beyond what Runge-Kutta bears with this roll damping."""
    controller = RIVALS[name] | {"step_periods": step_periods}
    flight = simulate(scenario_of(controller, duration_s=0.5, **{"plant.damping.Cm_damp_roll": 30.0}))
    assert np.isfinite(flight.commands).all()
    assert np.isfinite(flight.telemetry).all()
    return flight


def test_where_the_model_diverges_gauss_newton_keeps_its_control():
    assert not (diverging("gauss_newton", 1).status == Status.KEPT_PREVIOUS).any()
    assert (diverging("gauss_newton", 10).status == Status.KEPT_PREVIOUS).all()


def test_where_the_model_diverges_only_the_sample_at_rest_has_a_weight():
    def effective_samples(flight):
        return flight.telemetry[:, flight.telemetry_names.index("effective_samples")]

    assert np.median(effective_samples(diverging("mppi", 1))) > 1.5
    assert (effective_samples(diverging("mppi", 10)) == 1.0).all()


def test_reset_repeats_the_same_bits(rival):
    _, controller, state, preview = rival
    flown = []
    for _ in range(2):
        controller.reset()
        flown.append([controller.decide(state, preview).control.tobytes() for _ in range(4)])
    assert flown[0] == flown[1]


def test_the_scenario_s_seed_seeds_the_samples():
    flights = [simulate(scenario_of(RIVALS["mppi"], duration_s=0.2, seed=s)).commands for s in (1, 1, 2)]
    np.testing.assert_array_equal(flights[0], flights[1])
    assert not np.array_equal(flights[0], flights[2])


def test_commands_respect_the_slew_rate():
    for name in ("gauss_newton", "gauss_newton_held", "mppi", "lqr"):
        flight = simulate(scenario_of(RIVALS[name], duration_s=1.0))
        limits = flight.scenario.plant.limits
        change = np.abs(np.diff(flight.commands[:, 3], prepend=0.0))
        assert change.max() <= limits.alpha_rate * flight.scenario.dt_s + 1e-15
        assert (flight.commands >= np.array(limits.minimum)).all()
        assert (flight.commands <= np.array(limits.maximum)).all()


@pytest.fixture(scope="module")
def plant():
    return SkydiverPlant(load_scenario(TASK, {"plant.limbs.reaction": False}))


@pytest.fixture(scope="module")
def turning(plant):
    """A state in the turn, and the control applied last."""
    state, applied = plant.initial_state(), np.array([0.1, 0.4, 0.2, 0.5])
    held = np.append(applied, 0.0)
    for _ in range(200):
        state = plant.step(state, held, held)
    return state, applied


def sequences(generator, count, blocks):
    draws = generator.uniform(size=(count, blocks, 4))
    return draws * np.array([2.0, 1.0, 1.0, 0.1]) + np.array([0.01, 0.0, 0.0, 0.45])


def test_a_roll_out_is_the_plant_flown_step_by_step(plant, turning):
    state, applied = turning
    horizon = Horizon(steps=6, blocks=3, periods=1)
    drawn = sequences(np.random.default_rng(0), 4, 3)
    drawn[2, 0], drawn[3, :2] = drawn[0, 0], drawn[0, :2]
    outputs = np.empty((4, 6))
    SkydiverRollOut(plant.model, horizon, RATE_AT["yaw_rate"])(state, applied, drawn, outputs)
    for sequence, rates in zip(drawn, outputs, strict=True):
        x, alpha = state, applied[3]
        for j in range(6):
            control = sequence[j // 2].copy()
            control[3] = alpha + (0.5 if j % 2 == 0 else 1.0) * (control[3] - alpha)
            x = plant.step(x, np.zeros(5), np.append(control, 0.0))
            alpha = sequence[j // 2, 3] if j % 2 else alpha
            assert rates[j] == pytest.approx(x[12], abs=1e-12)


def test_a_long_model_step_stands_for_several_control_periods(plant, turning):
    state, applied = turning
    drawn = sequences(np.random.default_rng(1), 3, 2)
    fine, coarse = np.empty((3, 16)), np.empty((3, 4))
    SkydiverRollOut(plant.model, Horizon(16, 2, 1), RATE_AT["yaw_rate"])(state, applied, drawn, fine)
    SkydiverRollOut(plant.model, Horizon(4, 2, 4), RATE_AT["yaw_rate"])(state, applied, drawn, coarse)
    moved = np.abs(fine[:, -1] - state[12]).min()
    np.testing.assert_allclose(coarse, fine[:, 3::4], atol=0.02 * moved)


@pytest.mark.parametrize("name", ["lqr", "gauss_newton", "mppi"])
def test_a_reference_of_the_pitch_rate_is_tracked_in_the_pitch_rate(name):
    """A pitch rate changes the control, a yaw rate hardly."""
    scenario = load_scenario("front_layout", {"controller": RIVALS[name]})
    preview = np.zeros(build_controller(scenario).preview_steps + 1)

    def decided(**rates):
        state = build_plant(scenario).initial_state()
        for rate, value in rates.items():
            state[RATE_AT[rate]] = value
        return build_controller(scenario).decide(state, preview).control

    still = decided()
    by_pitch, by_yaw = decided(pitch_rate=0.05) - still, decided(yaw_rate=0.05) - still
    assert np.abs(by_pitch).max() > 10 * np.abs(by_yaw).max()


def test_horizon_and_blocks_must_fit():
    with pytest.raises(ParameterError, match="must be a multiple of blocks"):
        scenario_of({"kind": "mppi", "horizon_steps": 20, "blocks": 3})


def test_the_damping_fed_forward_is_that_of_the_steady_turn():
    """At the largest feed-forward the model's steady turn has the reference's yaw rate, for falling damping."""
    most, constant = 1.0, 0.5
    model = build_model(load_scenario(TASK))
    fall = straight_falls(model)[0]

    def steady(damping):
        (rate,) = steady_yaw_rates(model, fall, np.array([most]), damping)
        return rate

    gain = most / steady(constant)
    pose = {"kind": "pose", "K_p": 0.0, "K_FF": gain, "Cm_damp_yaw": constant, "alpha_feed_forward_max": most}
    controller = build_controller(scenario_of(pose))
    state = np.zeros(13)
    assert controller.decide(state, np.array([0.9 * steady(constant)])).control[0] == constant
    for damping in (0.3, 0.2, 0.1, 0.05):
        fed = controller.decide(state, np.array([steady(damping)])).control[0]
        assert fed == pytest.approx(damping, abs=0.01)

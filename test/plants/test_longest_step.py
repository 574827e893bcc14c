# SPDX-License-Identifier: Apache-2.0
"""A step that is too long for the integrator is refused, and one that is not falls straight."""

import re
from itertools import product

import numpy as np
import pytest
from skydivers import oracle_derivative

from skydiver_utc.loop.build import build_plant
from skydiver_utc.parameters import ParameterError, load_scenario
from skydiver_utc.plants.skydiver.linearise import linearise
from skydiver_utc.plants.skydiver.longest_step import FastestDamping, fastest_damping
from skydiver_utc.plants.skydiver.modes import modes
from skydiver_utc.plants.skydiver.skydiver import SkydiverPlant
from skydiver_utc.plants.skydiver.steady import HeldBody, straight_falls
from skydiver_utc.rotations import world_up

# The last of each is the bound of the setting.
STEPS_S = (0.0042, 0.012, 1.0)
YAW, ROLL, PITCH = (0.5, 50.0), (0.0, 8.0), (0.0, 50.0)
FALL = load_scenario("bank_recovery")


def skydiver(dt_s: float, yaw: float, roll: float, pitch: float) -> SkydiverPlant:
    """Almost level at first, so that a mode that the integrator makes unstable grows."""
    given = FALL.plant
    settings = given.replace(
        limits=given.limits.replace(Cm_damp_yaw=(0.01, yaw)),
        damping=given.damping.replace(Cm_damp_roll=roll, Cm_damp_pitch=pitch),
        initial=given.initial.replace(Cm_damp_yaw=yaw, bank_deg=1e-3),
    )
    return build_plant(FALL.replace(dt_s=dt_s, plant=settings))


def assert_falls_straight(plant: SkydiverPlant) -> None:
    """For 20 s, with the controls held."""
    state, held = plant.initial_state(), plant.initial_applied()
    for _ in range(round(20.0 / plant.dt_s)):
        state = plant.step(state, held, held)
        assert not plant.fault(state)
    assert np.linalg.norm(state[7:10]) == pytest.approx(57.2, abs=0.1)
    assert np.abs(state[10:13]).max() < 1e-3
    assert world_up(state)[2] > np.cos(np.deg2rad(9.0))


def longest_step(sentence: str) -> float:
    found = re.search(r"dt <= (\S+) s", sentence)
    assert found is not None
    return float(found[1])


@pytest.mark.long
def test_every_accepted_step_falls_straight_and_every_refusal_names_one_that_is_accepted() -> None:
    accepted, refused = 0, 0
    for dt_s, *dampings in product(STEPS_S, YAW, ROLL, PITCH):
        try:
            plant = skydiver(dt_s, *dampings)
        except ParameterError as error:
            refused += 1
            skydiver(longest_step(str(error)), *dampings)
        else:
            accepted += 1
            assert_falls_straight(plant)
    assert accepted > 4
    assert refused > 4


@pytest.mark.parametrize(
    ("axis", "dampings"), [("roll", (0.5, 50.0, 8.0)), ("pitch", (0.5, 0.0, 50.0)), ("yaw", (50.0, 0.0, 0.0))]
)
def test_the_longest_step_falls_straight(axis: str, dampings: tuple[float, float, float]) -> None:
    with pytest.raises(ParameterError, match=f"dt = 0.1 s .*{axis} damping of \\d+ 1/s") as refusal:
        skydiver(0.1, *dampings)
    assert_falls_straight(skydiver(longest_step(str(refusal.value)), *dampings))


def test_a_step_that_is_a_third_too_long_leaves_the_model(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bound is no wider than it has to be: 2.4 times the time constant, and Runge-Kutta ends at 2.785."""
    with pytest.raises(ParameterError) as refusal:
        skydiver(0.1, 0.5, 50.0, 8.0)
    monkeypatch.setattr("skydiver_utc.plants.skydiver.longest_step.LARGEST_RATE_TIMES_STEP", np.inf)
    plant = skydiver(round(4.0 / 3.0 * longest_step(str(refusal.value)), 6), 0.5, 50.0, 8.0)
    with pytest.raises(AssertionError):
        assert_falls_straight(plant)


def test_the_fastest_damping_is_the_fastest_mode_of_the_fall() -> None:
    """The linearised fall's, over the pattern angles; hands without force, so that its speed is the largest."""
    scenario = load_scenario("bank_recovery", {"plant.hands.K_N": 0.0})
    plant = build_plant(scenario)
    found = fastest_damping(plant.model, plant.initial_state(), 0.0)
    fall = straight_falls(plant.constants)[0]
    held = [np.array([6.0, 0.0, 0.0, alpha]) for alpha in (-1.5, 0.0, 1.5)]
    fastest = max(
        (modes(linearise(HeldBody(plant.constants, u), fall), fall)[0] for u in held),
        key=lambda mode: abs(mode.eigenvalue),
    )
    assert fastest.name.startswith(found.axis)
    assert found.rate == pytest.approx(abs(fastest.eigenvalue), rel=0.01)


@pytest.mark.parametrize("force", ["ventral", "dorsal"])
def test_hands_that_pull_down_make_the_damping_faster(force: str) -> None:
    """Damping goes with the speed, whose square goes with the force along the path."""
    limits = {f"plant.limits.k_{side}": [-2.0, 2.0] for side in ("right", "left")}
    level = {"plant.hands.force": force, "plant.initial.bank_deg": 0.0, "plant.initial.fall_speed_m_s": 1.0}
    rates = []
    for K_N in (0.0, 50.0):
        scenario = load_scenario("bank_recovery", {**limits, **level, "plant.hands.K_N": K_N})
        plant = build_plant(scenario)
        rates.append(fastest_damping(plant.model, plant.initial_state(), 0.0).rate)
    down = -world_up(plant.initial_state())[2] * plant.constants.mass * plant.constants.gravity
    assert (rates[1] / rates[0]) ** 2 == pytest.approx(1.0 + 4.0 * 50.0 / abs(down), rel=0.01)
    # The speed of that damping is the one whose drag is the pull.
    state = plant.initial_state()
    state[7:10] *= 200.0
    state[7:10] *= rates[1] / fastest_damping(plant.model, state, 0.0).rate
    control = np.array([6.0, *(2 * [2.0 if force == "ventral" else -2.0]), 0.0])
    assert abs(oracle_derivative(scenario, control)(state)[7:10] @ world_up(state)) < 1e-4


def test_damping_grows_with_the_initial_speed_whatever_its_direction() -> None:
    """Beyond the terminal speed, which counts below it."""
    plant = build_plant(FALL)
    state = plant.initial_state()
    terminal = fastest_damping(plant.model, state * np.r_[np.ones(7), np.zeros(6)], 0.0).rate
    state[10] = 9.0
    for velocity in 200.0 * np.eye(3):
        state[7:10] = velocity
        fast = fastest_damping(plant.model, state, 0.0).rate
        state[7:10] = 0.5 * velocity
        assert fast == pytest.approx(2.0 * fastest_damping(plant.model, state, 0.0).rate, rel=1e-9)
        assert fast > 2.0 * terminal


@pytest.mark.parametrize(("longest", "rounded"), [(0.0123456, 0.0123), (0.98765, 0.987), (12.345, 12.3)])
def test_the_longest_step_has_three_digits_and_a_longer_one_is_refused(
    longest: float, rounded: float
) -> None:
    damping = FastestDamping("yaw", 2.4 / longest)
    damping.refuse_longer(0.9999 * longest)
    with pytest.raises(ValueError, match="yaw") as refused:
        damping.refuse_longer(1.0001 * longest)
    assert {f"{2.4 / longest:.0f}", f"{rounded:g}"} <= set(str(refused.value).split())

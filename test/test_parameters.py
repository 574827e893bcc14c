"""Parameters: what is accepted, what is refused, and in which words."""

import math

import msgspec
import numpy as np
import paper_utc
import pytest

from skydiver_utc.parameters import (
    ParameterError,
    UtcParameters,
    leaves,
    load_scenario,
    scenario_names,
    to_yaml,
)

FAST = "fast_turn_unknown_dynamics"


def refused(overrides, name=FAST):
    with pytest.raises(ParameterError) as caught:
        load_scenario(name, overrides)
    message = str(caught.value)
    assert "\n" not in message
    return message


def test_names_do_not_include_the_base():
    assert FAST in scenario_names()
    assert not any(name.startswith("_") for name in scenario_names())


def test_extends_lays_files_over_each_other():
    scenario = load_scenario("fast_turn_pi_dynamics_rate_coupling")
    assert isinstance(scenario.controller, UtcParameters)
    assert scenario.controller.coupling == "yaw_acceleration"
    assert scenario.controller.horizon_steps == 5
    assert scenario.reference.amplitude_deg_s == 400.0


def test_a_scenario_is_frozen():
    with pytest.raises(AttributeError):
        load_scenario(FAST).dt_s = 1.0


def test_integers_are_accepted_for_numbers():
    scenario = load_scenario(FAST, {"plant.hands.K_N": 50})
    assert scenario.plant.hands.K_N == 50.0
    assert isinstance(scenario.plant.hands.K_N, float)


def test_steps_and_stamps_are_integers():
    scenario = load_scenario(FAST)
    assert scenario.dt_ns == 4_200_000
    assert scenario.steps == 4762
    assert scenario.stamp_ns(1000) - scenario.stamp_ns(0) == 4_200_000_000
    assert scenario.stamp_ns(0) > 0


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ({"controller.horizon_stepz": 5}, ["controller.horizon_stepz", "did you mean horizon_steps"]),
        ({"controler.horizon_steps": 5}, ["controler", "did you mean controller"]),
        ({"plant.hands.K_N": "fifty"}, ["plant.hands.K_N", "'fifty'"]),
        ({"plant.hands.K_N": math.nan}, ["plant.hands.K_N", "finite"]),
        ({"plant.hands.K_N": math.inf}, ["plant.hands.K_N", "finite"]),
        ({"plant.hands.K_N": "nan"}, ["parameter plant.hands.K_N: write a finite number, found 'nan'"]),
        ({"plant.hands.K_N": "-inf"}, ["parameter plant.hands.K_N: write a finite number, found '-inf'"]),
        ({"plant.hands.K_N": True}, ["plant.hands.K_N"]),
        ({"dt_s": -0.0042}, ["dt_s", "-0.0042"]),
        ({"dt_s": 0}, ["dt_s"]),
        ({"dt_s": 0.00420000001}, ["dt_s", "nanoseconds"]),
        ({"duration_s": 0.001}, ["duration_s"]),
        ({"plant.limits.alpha": [1.5, -1.5]}, ["alpha", "upside down"]),
        ({"plant.limits.alpha": [1.5]}, ["alpha", "a list of length 2"]),
        ({"plant.limits.alpha": None}, ["plant.limits.alpha", "a list", "nothing"]),
        ({"controller.Cm_damp_yaw": 1.0}, ["one of kind open_loop and pose", "controller.kind is utc"]),
        ({"initial.alpha": 2.0}, ["initial.alpha", "limits"]),
        ({"controller.coupling": "sometimes"}, ["controller.coupling", "sometimes", "yaw_acceleration"]),
        ({"controller.kind": "mpc"}, ["controller.kind", "mpc", "pose, utc"]),
        ({"plant.limits.alpha": [-100, 100]}, ["plant.limits.alpha"]),
        ({"controller.W0": 1.0}, ["controller.W0"]),
        ({"subject": "giant"}, ["giant", "average"]),
        ({"subject.mass_kg": 5}, ["subject.mass_kg"]),
        ({"name.first": 1}, ["name"]),
    ],
    ids=lambda value: str(value) if isinstance(value, dict) else "",
)
def test_bad_values_are_named(overrides, words):
    message = refused(overrides)
    for word in words:
        assert word in message


def test_unknown_scenario_is_named_with_a_near_one():
    assert "did you mean fast_turn_unknown_dynamics" in refused({}, "fast_turn_unknown_dynamic")


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("extends: nothing_there\n", "nothing_there"),
        ("name: a\nname: b\n", "'name'"),
        ("- 1\n", "mapping"),
        ("a: [1\n", "YAML"),
        ("dt_s: .nan\n", "dt_s"),
        ("title: x\n", "missing"),
    ],
)
def test_bad_files_are_named(tmp_path, text, word):
    path = tmp_path / "flight.yaml"
    path.write_text(text)
    message = refused({}, str(path))
    assert word in message


def test_file_that_does_not_exist():
    assert "nowhere.yaml" in refused({}, "nowhere.yaml")


def test_exponents_without_a_point_are_numbers(tmp_path):
    path = tmp_path / "flight.yaml"
    path.write_text(to_yaml(load_scenario(FAST)).replace("P_err: 0.0001", "P_err: 1e-4"))
    assert load_scenario(str(path)).controller.P_err == 1e-4


@pytest.mark.parametrize("name", scenario_names())
def test_resolved_scenario_reads_back_the_same(tmp_path, name):
    scenario = load_scenario(name)
    path = tmp_path / "scenario.yaml"
    path.write_text(to_yaml(scenario))
    assert load_scenario(str(path)) == scenario


@pytest.mark.parametrize("name", scenario_names())
def test_every_leaf_has_a_description_a_unit_and_can_be_set(name):
    scenario = load_scenario(name)
    for leaf in leaves(scenario):
        if leaf.kind in ("float", "int"):
            assert leaf.description, leaf.name
            assert leaf.unit, leaf.name
            assert leaf.minimum is not None, leaf.name
            assert leaf.minimum <= leaf.value <= leaf.maximum, leaf.name
    assert load_scenario(name, {leaf.name: leaf.value for leaf in leaves(scenario)}) == scenario


def test_pattern_must_have_unit_norm():
    pattern = msgspec.to_builtins(load_scenario(FAST).pattern)
    pattern["components"]["left_hip"] = [0.9, 0.0, 0.0]
    assert "unit norm" in refused({"pattern": pattern})


def test_a_utc_has_the_papers_numbers_where_its_scenario_says_nothing():
    found = load_scenario("fast_turn_pose_only", {"controller": {"kind": "utc", "W0": 0.5}}).controller
    names = ("Cm_damp_yaw", "k_right", "k_left", "alpha")
    variances = [getattr(found, f"variance_{name}") for name in names]
    np.testing.assert_array_equal(variances, paper_utc.VARIANCES)
    covariances = (found.covariance_12, found.covariance_13, found.covariance_14)
    assert covariances == (paper_utc.Q12, paper_utc.Q13, paper_utc.Q14)
    settings = paper_utc.Settings(dt=0.0042)
    assert (found.P_err, found.horizon_steps) == (settings.P_err, settings.N)
    assert found.W0 == 0.5


def test_a_controller_of_a_kind_without_a_file_must_say_what_it_needs():
    message = refused({"controller": {"kind": "lqr", "K_p": 1.0}})
    assert "controller.K_p" in message

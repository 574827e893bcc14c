# SPDX-License-Identifier: Apache-2.0
"""Settings: what is accepted, what is refused and under which name, and what comes back from YAML."""

import math
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Literal

import pydantic
import pytest
from refusals import assert_refused
from runs import CART

from skydiver_utc.parameters import (
    ParameterError,
    Parameters,
    from_yaml,
    leaves,
    load_scenario,
    override,
    quantity,
    scenario_names,
    text,
    to_yaml,
)
from skydiver_utc.parameters.loading import config_folder
from skydiver_utc.parameters.nanoseconds import stamp_ns
from skydiver_utc.parameters.nodes import SETTINGS, resolve, usage

FAST = "fast_turn_unknown_dynamics"
shipped = cache(load_scenario)


def test_a_file_is_laid_over_the_one_that_it_extends():
    scenario = shipped("fast_turn_pi_dynamics_rate_coupling")
    assert (scenario.controller.kind, scenario.controller.horizon_steps) == ("utc", 5)
    assert scenario.reference.amplitude_deg_s == 400.0
    assert not any(name.startswith("_") for name in scenario_names())


def test_a_scenario_is_frozen_and_replaced_by_checked_copies():
    scenario = shipped(FAST)
    with pytest.raises(pydantic.ValidationError):
        scenario.dt_s = 1.0
    for wrong in ({"dt_s": -1.0}, {"plant": {"kind": "skydiver"}}):
        with pytest.raises(pydantic.ValidationError):
            scenario.replace(**wrong)
    assert repr(scenario.replace(duration_s=2).duration_s) == "2.0"


def test_steps_and_stamps_are_integers():
    scenario, stamp = shipped(FAST), SimpleNamespace(sec=1_700_000_000, nanosec=999_999_999)
    assert (scenario.dt_ns, scenario.steps, stamp_ns(stamp)) == (4_200_000, 4762, 1_700_000_000_999_999_999)
    assert scenario.stamp_ns(1000) == 1_767_225_604_200_000_000
    assert load_scenario(FAST, {"duration_s": scenario.dt_s}).steps == 1


def test_limits_are_bounds_in_the_order_of_the_controls():
    bounds = {"Cm_damp_yaw": [0.1, 4.0], "k_right": [-0.2, 1.0], "k_left": [-0.3, 2.0], "alpha": [-0.4, 0.5]}
    limits = load_scenario(FAST, {f"plant.limits.{name}": pair for name, pair in bounds.items()}).plant.limits
    assert (limits.minimum, limits.maximum) == ((0.1, -0.2, -0.3, -0.4), (4.0, 1.0, 2.0, 0.5))
    assert load_scenario(FAST, {"plant.limits.alpha.1": 1.25}).plant.limits.maximum[3] == 1.25


def test_the_true_plant_is_the_plant_with_other_values_laid_over():
    scenario = load_scenario(FAST, {"truth": {"hands": {"K_N": 80.0}, "actuator_lag_s": 0.1}})
    assert scenario.true_plant == load_scenario(FAST, {"plant.hands.K_N": 80.0}).plant
    assert shipped(FAST).true_plant is shipped(FAST).plant


def test_another_controller_has_the_defaults_of_its_kind_and_the_true_state_is_no_estimate():
    changed = load_scenario(FAST, {"controller": {"kind": "lqr"}})
    assert changed.controller.kind == "lqr"
    assert load_scenario(FAST, {"controller.kind": "lqr"}) == changed
    two = {"controller": {"kind": "pose"}, "controller.horizon_steps": 7, "controller.kind": "lqr"}
    assert load_scenario(FAST, two).controller == changed.controller.replace(horizon_steps=7)
    assert load_scenario(FAST, {"controller.kind": "utc"}) == shipped(FAST)
    assert not shipped(FAST).has_estimator
    assert shipped("fast_turn_gyro_accelerometer").has_estimator


def path_of(*alphas):
    """A path of postures at these pattern angles."""
    frames = [{"alpha": alpha, "posture": "box"} for alpha in alphas]
    return {"kind": "path", "name": "p", "description": "", "source": "", "keyframes": frames}


DIRECTION = {"kind": "direction", "name": "p"}
HALF = {"left_hip": [0.6, 0.0, 0.0]}


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ({"controller.horizon_stepz": 5}, [".horizon_stepz", "did you mean controller.horizon_steps"]),
        ({"controler.horizon_steps": 5}, ["unknown parameter controler:", "did you mean controller"]),
        ({"duration": 5}, ["unknown parameter duration:", "did you mean duration_s"]),
        ({"qqqq": 5}, ["unknown parameter qqqq:"]),
        ({"subject": "heavy"}, ["unknown parameter subject", "did you mean plant.subject"]),
        *(({"plant.hands.K_N": value}, ["plant.hands.K_N", "finite"]) for value in (math.nan, math.inf)),
        ({"plant.hands.K_N": "nan"}, ["plant.hands.K_N", "number", "'nan'"]),
        *(({"plant.hands.K_N": value}, ["plant.hands.K_N"]) for value in (True, None, {"a": 1})),
        ({"plant.limbs.reaction": "no"}, ["plant.limbs.reaction", "true or false", "'no'"]),
        *(({"dt_s": value}, ["dt_s", str(value)]) for value in (-0.0042, 0, 2)),
        ({"dt_s": 0.00420000001}, ["dt_s", "nanoseconds"]),
        ({"duration_s": 0.001}, ["duration_s"]),
        ({"plant.limits.alpha": [1.5, -1.5]}, ["alpha", "upside down", "of 1.5, -1.5"]),
        ({"plant.limits.alpha": [0.5, 0.5]}, ["alpha", "upside down"]),
        (
            {"plant.subject.joint_limits.ranges_deg.knee.flexion": [10, -10]},
            ["knee", "flexion", "10.0, -10.0"],
        ),
        ({"plant.limits.alpha.2": 1.0}, ["no parameter plant.limits.alpha.2", "entries 0 to 1"]),
        ({"plant.limits.alpha.x": 1.0}, ["no parameter plant.limits.alpha.x", "entries 0 to 1"]),
        ({"plant.pattern": path_of(0.0)}, ["plant.pattern", "1 keyframes"]),
        ({"plant.pattern": path_of(0.0, 0.0)}, ["plant.pattern", "growing alpha"]),
        ({"plant.pattern": path_of(1.0, 0.0)}, ["plant.pattern", "growing alpha"]),
        ({"plant.pattern": DIRECTION}, [f"pattern.{name} is missing" for name in ("source", "components")]),
        ({"title": "a\x1b[2J"}, ["title in the override holds a control character"]),
        ({"plant.subject.name": "a\u202e"}, ["plant.subject.name in the override holds a control character"]),
        ({"truth": {"hands": {"K_N": -1.0}}}, ["truth.hands.K_N", "at least 0"]),
        ({"plant.limits.alpha": [1.5]}, ["alpha"]),
        ({"plant.limits.alpha": None}, ["plant.limits.alpha", "a list", "found None"]),
        ({"plant.limits.alpha": [-100, 100]}, ["plant.limits.alpha.0", "plant.limits.alpha.1"]),
        ({"plant.limits": 1.0}, ["plant.limits", "a block"]),
        ({"plant.subject": "ligth"}, ["did you mean light"]),
        ({"plant": "skydiver"}, ["plant", "a block", "'skydiver'"]),
        ({"plant.initial.alpha": 2.0}, ["initial.alpha", "limits"]),
        ({"plant.initial.bank_deg.x": 2.0}, ["plant.initial.bank_deg", "number"]),
        ({"controller.coupling": "sometimes"}, ["controller.coupling", "sometimes"]),
        ({"controller.kind": "uct"}, ["controller.kind", "did you mean utc"]),
        ({"controller": {"W0": 0.5}, "controller.kind": None}, ["controller.kind is missing"]),
        ({"controller.kind": [1]}, ["controller.kind"]),
        ({"plant.kind": "balloon"}, ["plant.kind", "skydiver, linear", "module:Class"]),
        ({"disturbances": [{"kind": "wind"}]}, ["disturbances[0].kind", "wind"]),
        ({"disturbances": 3}, ["disturbances", "a list"]),
        ({"plant.pattern.kind": "wave"}, ["plant.pattern.kind", "wave", "direction, path"]),
        ({"plant.pattern.components": HALF}, ["plant.pattern", "unit norm", "0.600000"]),
        ({"controller.W0": 1.0}, ["controller.W0"]),
        ({"plant.subject": "giant"}, ["giant", "average"]),
        ({"plant.skydiver": "nobody"}, ["nobody", "athlete, paper"]),
        ({"plant.skydiver": 3}, ["plant.skydiver"]),
        ({"plant.hands.force": "upwards"}, ["plant.hands.force", "ventral, dorsal"]),
        ({"name.first": 1}, ["there is no parameter name.first"]),
        ({"controller": {"kind": "lqr", "K_p": 1.0}}, ["controller.K_p"]),
        ({"controller.W0": 0.1, "controller.kind": "lqr"}, ["controller.W0"]),
    ],
    ids=lambda value: str(value) if isinstance(value, dict) else "",
)
def test_a_wrong_value_is_named(overrides, words):
    assert_refused(words, load_scenario, FAST, overrides)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("extends: nothing_there\n", ["nothing_there"]),
        ("name: a\nname: b\n", ["'name'", "line 1"]),
        ("title: x\n", ["name", "duration_s", "plant", "reference", "controller", "missing"]),
    ],
)
def test_a_wrong_file_is_named(tmp_path, text, words):
    path = tmp_path / "flight.yaml"
    path.write_text(text)
    assert_refused(words, load_scenario, str(path))


def test_a_block_with_a_name_replaces_that_of_its_kind_s_defaults(tmp_path):
    """A resolved layout, whose pattern has other joints than the turn that is the default."""
    path = tmp_path / "flight.yaml"
    path.write_text(to_yaml(shipped("front_layout")))
    assert load_scenario(str(path)) == shipped("front_layout")
    components = {"left_hip": [1.0, 0.0, 0.0]}
    pattern = load_scenario(FAST, {"plant.pattern.components": components}).plant.pattern
    assert pattern.components == {"left_hip": (1.0, 0.0, 0.0)}
    other = load_scenario(FAST, {"plant.subject": "heavy", "plant.subject.suit": "standard"})
    assert other.plant.subject.suit.name == "standard"


def test_a_scenario_picks_its_skydiver_and_keeps_what_it_sets_itself():
    """The file's choice, the choice of an override, and a file of one's own over what every skydiver has."""
    assert shipped(FAST).plant.hands.K_N == 100.0
    athlete = load_scenario(FAST, {"plant.skydiver": "athlete"}).plant
    assert athlete == load_scenario("fast_turn_beyond_the_paper").plant
    layout, other = (
        load_scenario("front_layout", change).plant for change in ({}, {"plant.skydiver": "paper"})
    )
    assert other.hands.K_N == 100.0 != layout.hands.K_N
    assert (other.pattern.name, other.damping.Cm_damp_pitch) == ("layout", layout.damping.Cm_damp_pitch)


def test_a_skydiver_may_be_a_file_and_is_refused_where_one_is_written_out(tmp_path):
    own, flight = tmp_path / "mine.yaml", tmp_path / "flight.yaml"
    text = (config_folder() / "skydivers" / "paper.yaml").read_text()
    own.write_text(text + "air: {density_kg_m3: 1.225}\n")
    plant = load_scenario("bank_recovery", {"plant.skydiver": str(own)}).plant
    assert (plant.air.density_kg_m3, plant.hands.K_N, plant.initial.bank_deg) == (1.225, 100.0, 20.0)
    flight.write_text(to_yaml(shipped(FAST)))
    change = {"plant.skydiver": "athlete"}
    assert_refused("written out", load_scenario, str(flight), change)
    assert_refused("plant.skydiver", override, shipped(FAST), change)


def test_a_setting_of_a_control_with_a_dot_in_its_name_is_found():
    text = CART.replace("force", "arm.force").replace(
        "{kind: open_loop}", "{kind: utc, horizon_steps: 5, Pu: {arm.force: 0.1}}"
    )
    scenario = override(from_yaml(text), {"controller.Pu.arm.force": 0.2})
    assert dict(scenario.controller.Pu) == {"arm.force": 0.2}


@pytest.mark.parametrize("name", scenario_names())
def test_a_scenario_comes_back_from_its_yaml_and_takes_its_own_leaves(name):
    scenario = shipped(name)
    assert from_yaml(to_yaml(scenario)) == scenario
    assert override(scenario, {leaf.name: leaf.value for leaf in leaves(scenario)}) == scenario


@pytest.mark.parametrize("name", scenario_names())
def test_every_number_has_a_description_and_a_unit_and_prose_is_no_leaf(name):
    found = leaves(shipped(name))
    for leaf in found:
        if type(leaf.value) in (float, int):
            assert leaf.description, leaf.name
            # A table's unit is that of what its rows are named after.
            assert leaf.unit or leaf.minimum is None, leaf.name
            assert leaf.minimum is None or leaf.minimum <= leaf.value, leaf.name
            assert leaf.maximum is None or leaf.value <= leaf.maximum, leaf.name
        assert not isinstance(leaf.value, str) or leaf.value in leaf.choices
    names, prose = {leaf.name for leaf in found}, {"name", "title", "description", "source", "kind"}
    assert {"dt_s", "plant.hands.K_N", "plant.subject.mass_kg"} <= names
    assert not {name for name in names if name.rpartition(".")[2] in prose}


def test_leaves_are_the_numbers_switches_and_choices_of_each_kind_of_field():
    class Block(Parameters):
        size: Annotated[float, quantity("m", "a size", gt=0, le=2)] = 1.0

    class Fields(Parameters):
        kind: Literal["fields"] = "fields"
        count: Annotated[int, quantity("1", "a count", ge=1, lt=9)] = 3
        switch: Annotated[bool, text("a switch")] = True
        choice: Annotated[Literal["a", "b"], text("a choice")] = "a"
        maybe: Literal["a", "b"] | None = "b"
        optional: Annotated[float, quantity("s", "a time", ge=0)] | None = 2.0
        absent: Annotated[float, quantity("s", "a time")] | None = None
        either: Literal["a"] | int | None = "a"
        row: tuple[float, ...] = (1.0, 2.0)
        nothing: tuple[float, ...] = ()
        words: tuple[str, ...] = ("a", "b")
        prose: str = "a"
        block: Block = Block()
        table: dict[str, float] = {"x": 1.0}
        texts: dict[str, str] = {"x": "a"}
        blocks: dict[str, Block] = {"y": Block()}
        disturbances: tuple[Block, ...] = (Block(), Block(size=2.0))

    size = 1.0, 0.0, 2.0, (), "m", "a size"
    assert [tuple(leaf) for leaf in leaves(Fields(), "of.")] == [
        ("of.count", 3, 1.0, 9.0, (), "1", "a count"),
        ("of.switch", True, None, None, (), "", "a switch"),
        ("of.choice", "a", None, None, ("a", "b"), "", "a choice"),
        ("of.maybe", "b", None, None, ("a", "b"), "", ""),
        ("of.optional", 2.0, 0.0, None, (), "s", "a time"),
        ("of.row", (1.0, 2.0), None, None, (), "", ""),
        ("of.block.size", *size),
        ("of.table.x", 1.0, None, None, (), "", ""),
        ("of.blocks.y.size", *size),
        ("of.disturbances.0.size", *size),
        ("of.disturbances.1.size", 2.0, *size[1:]),
    ]


def test_the_config_folder_is_in_the_checkout_or_a_share_folder(tmp_path, monkeypatch):
    share = tmp_path / "share" / "skydiver_utc" / "config"
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path}")
    monkeypatch.setattr(Path, "is_dir", lambda path: path == share / "scenarios")
    assert config_folder() == share
    monkeypatch.setattr(Path, "is_dir", lambda path: False)
    with pytest.raises(ParameterError, match="install"):
        config_folder()


def test_a_node_takes_its_own_parameters_and_those_of_the_scenario():
    found = resolve("plant", {"use_sim_time": True, "markers": False, "dt_s": 0.01})
    assert (found.settings.markers, found.scenario.dt_s, found.changes) == (False, 0.01, {"dt_s": 0.01})


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"command_timeout_s": "soon"}, ["command_timeout_s", "number", "'soon'"]),
        ({"comand_timeout_s": 1.0}, ["comand_timeout_s", "did you mean command_timeout_s"]),
        ({"qqqq.x": 1}, ["unknown parameter qqqq.x", "--help"]),
    ],
)
def test_a_wrong_parameter_of_a_node_is_named(given, words):
    assert_refused(words, resolve, "plant", given)


@pytest.mark.parametrize("kind", SETTINGS)
def test_the_help_of_a_node_has_each_parameter_with_its_default(kind):
    lines = {line.split()[0]: line for line in usage(kind).splitlines() if line.startswith("  ")}
    for name, field in SETTINGS[kind].model_fields.items():
        assert field.description in lines[name]
        if field.is_required():
            assert "(needed)" in lines[name]
        elif isinstance(field.default, float):
            unit = field.json_schema_extra["unit"]
            assert f"  {field.default}{'' if unit == '1' else ' ' + unit}  " in lines[name]
        elif field.default == "":
            assert "  (empty)  " in lines[name]
    assert SETTINGS[kind].__doc__ in usage(kind)
    assert ("controller.horizon_steps" in usage(kind)) == ("scenario" in SETTINGS[kind].model_fields)

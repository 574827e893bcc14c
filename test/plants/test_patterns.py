# SPDX-License-Identifier: Apache-2.0
"""The movement patterns: made by their command, in a body's reach, and doing what docs/patterns.md says."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke
from skydivers import falling_straight, oracle_derivative, plant_of, skydiver

from skydiver_utc.body.posture import joint_ranges, joint_rows, pattern_direction
from skydiver_utc.parameters import ParameterError
from skydiver_utc.parameters.loading import config_folder
from skydiver_utc.parameters.yaml_io import read_yaml
from skydiver_utc.plants.skydiver.pattern_design import design_pattern
from skydiver_utc.plants.skydiver.pattern_kinds import PATTERN_KINDS
from skydiver_utc.plants.skydiver.trim import straight_fall
from skydiver_utc.rotations import dorsal_axis_height

DOCUMENT = (Path(__file__).parents[2] / "docs" / "patterns.md").read_text(encoding="utf-8")
LARGEST = {  # of each acceleration over the whole range of alpha; infinite: the one that the pattern is for
    "turn": (0.8, 0.5, 3.0, 0.7, 0.7, np.inf),
    "pitch": (1.5, 0.0, 0.9, 0.0, np.inf, 0.0),
    "lateral": (0.05, np.inf, 0.6, 0.1, 0.1, 0.1),
    "fall_rate": (0.25, 0.0, np.inf, 0.0, 0.1, 0.0),
}
_NUMBER = re.compile(r"-?[\d.]+$")


def table(heading):
    """Rows of the table whose header starts so: the pattern, then numbers; what is no number stays text."""
    section = DOCUMENT.partition(f"| {heading}")[2].partition("\n\n")[0]
    rows = []
    for line in section.splitlines()[2:]:
        name, *cells = (cell.strip() for cell in line.strip("|").split("|"))
        rows.append((name, *(float(cell) if _NUMBER.match(cell) else cell for cell in cells)))
    return rows


EFFECTS = table("pattern | alpha [rad] | surge")


def scenario_of(name):
    return skydiver(pattern=name, initial__bank_deg=0.0)


@pytest.mark.parametrize(
    ("name", "kind", "skydiver"),
    [*((kind, kind, "athlete") for kind in PATTERN_KINDS), ("turn_paper", "turn", "paper")],
)
def test_a_pattern_is_made_again_by_its_command(name, kind, skydiver, tmp_path):
    path = tmp_path / f"{name}.yaml"
    of = ["--set", f"plant.skydiver={skydiver}", "--kind", kind]
    result = invoke("pattern", "design", "bank_recovery", *of, "--seed", "1", "--out", path)
    assert result.exit_code == 0, result.stderr
    made, committed = read_yaml(path), read_yaml(config_folder() / "patterns" / f"{name}.yaml")
    for joint, row in committed.pop("components").items():
        np.testing.assert_allclose(made["components"][joint], row, atol=2e-3)
        np.testing.assert_array_equal(made["components"][joint], np.round(made["components"][joint], 9))
    made.pop("components")
    assert made == committed


@pytest.mark.parametrize("name", PATTERN_KINDS)
def test_a_search_that_begins_near_a_pattern_of_the_library_ends_there(name):
    scenario = scenario_of(name)
    plant, rng = scenario.plant, np.random.default_rng(1)
    trim = straight_fall(scenario, plant.posture, plant.initial.pitch_deg)
    direction = pattern_direction(plant.pattern)
    near = direction * rng.uniform(0.8, 1.2, direction.shape)
    known = plant.pattern.replace(components=joint_rows(near / np.linalg.norm(near)))
    found = design_pattern(PATTERN_KINDS[name], scenario, trim, rng, starts=0, known=known)
    np.testing.assert_allclose(found, direction, atol=2e-5)
    lower, upper = joint_ranges(plant.subject.joint_limits)
    for alpha in plant.limits.alpha:
        angles = trim.angles + alpha * found
        assert ((lower <= angles) & (angles <= upper)).all()
    with pytest.raises(ParameterError, match="another seed"):
        design_pattern(PATTERN_KINDS[name], scenario, trim, rng, starts=0)


def test_the_library_is_the_kinds():
    files = {path.stem: read_yaml(path) for path in (config_folder() / "patterns").glob("*.yaml")}
    directions = {name for name, content in files.items() if content["kind"] == "direction"}
    assert directions == {*PATTERN_KINDS, "turn_paper"}
    assert {row[0] for row in EFFECTS} == set(LARGEST) == set(PATTERN_KINDS)


@pytest.mark.parametrize("name", PATTERN_KINDS)
def test_more_of_a_pattern_accelerates_more_and_little_else(name):
    """At once, in the straight fall, by the oracle."""
    scenario = scenario_of(name)

    def accelerations(alpha, speed):
        falling = falling_straight(scenario, speed)
        return oracle_derivative(scenario, np.array([0.0, 0.0, 0.0, alpha]))(falling)[7:]

    # Drag grows with the square of the speed and carries the weight in the straight fall.
    drag = accelerations(0.0, 50.0)[2] - accelerations(0.0, 1e-6)[2]
    speed = 50.0 * np.sqrt(-accelerations(0.0, 1e-6)[2] / drag)
    found = np.array([accelerations(alpha, speed) for alpha in np.linspace(-1.5, 1.5, 61)])
    assert np.abs(found[30]).max() < 1e-6
    assert np.diff(found[:, np.argmax(LARGEST[name])]).min() > 0
    assert (np.abs(found).max(axis=0) <= np.add(LARGEST[name], 1e-9)).all()


def shown(name, *arguments):
    result = invoke("pattern", "show", name, *arguments)
    assert result.exit_code == 0, result.stderr
    return result.stdout


@pytest.mark.parametrize("name", PATTERN_KINDS)
def test_show_prints_the_tables(name):
    at = {round(row["alpha_rad"], 9): row for row in json.loads(shown(name, "--json"))["at"]}
    assert list(at) == [-1.5, -1.0, -0.5, 0.5, 1.0, 1.5]
    for alpha, *row in (row[1:] for row in EFFECTS if row[0] == name):
        accelerations, (fall_rate, glide, *rest, stable), steady = row[:6], row[6:], at[alpha]["steady"]
        found = at[alpha]["acceleration_m_s2"] + at[alpha]["angular_acceleration_rad_s2"]
        np.testing.assert_allclose(found, accelerations, atol=0.006)
        if stable == "not found":
            assert steady is None
            continue
        angle, direction = glide.split()
        assert (steady["glide_direction"], steady["stable"]) == (direction, stable == "stable")
        names = ("fall_rate_m_s", "glide_angle_deg", "pitch_deg", "bank_deg", "yaw_rate_deg_s")
        found = [steady[name] for name in names]
        np.testing.assert_allclose(found, [fall_rate, float(angle), *rest], atol=0.06)


def test_show_prints_tables_on_the_screen():
    printed = shown("lateral")
    for part in ("Slide to the left", "seed 1", "sway", "stable"):
        assert part in printed


def test_the_largest_lateral_pattern_ends_in_a_slow_turn_to_its_side():
    """From the straight fall, held for two minutes."""
    plant = plant_of(pattern="lateral", initial__bank_deg=0.0)
    state, applied = plant.initial_state(), plant.initial_applied()
    for _ in range(round(120.0 / plant.dt_s)):
        state, applied = plant.advance(state, applied, np.array([0.5, 0.0, 0.0, 1.5]))
    assert 8 < np.rad2deg(state[12]) < 15
    assert dorsal_axis_height(state) > 0.99


def test_a_pattern_may_be_a_file(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text((config_folder() / "patterns" / "turn.yaml").read_text(encoding="utf-8"))
    assert json.loads(shown(str(path), "--json"))["pattern"] == "turn"
    result = invoke("pattern", "show", tmp_path / "none.yaml")
    assert result.exit_code == 2
    assert "there is no pattern file" in result.stderr

# SPDX-License-Identifier: Apache-2.0
"""Movement patterns of recorded postures: against designed patterns and algebra."""

import json

import numpy as np
import pytest
from command_line import invoke, refused
from postures import NAMES, csv_of, direction_of, neutral
from recordings import bag_of_postures

from skydiver_utc.body.posture import pattern_direction, posture_angles
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import load_scenario
from skydiver_utc.parameters.yaml_io import read_yaml
from skydiver_utc.plants.skydiver.pattern_kinds import PATTERN_KINDS


def extract(source, *arguments):
    result = invoke("pattern", "extract", source, *arguments)
    assert result.exit_code == 0, result.output
    return result.stdout


def components(path):
    return pattern_direction(
        load_scenario("bank_recovery", {"plant.pattern": str(path)}).plant.pattern
    ).ravel()


def posture_of(path):
    return posture_angles(load_scenario("bank_recovery", {"plant.posture": str(path)}).plant.posture).ravel()


def test_the_fast_turn_gives_its_pattern_back(tmp_path):
    """From a bag, every eighth step: the direction to rounding, all of the variance, the sign that turns left."""
    run = simulate(load_scenario("fast_turn_unknown_dynamics", {"duration_s": 5.0}))
    postures = np.array([run.plant.joint_angles(applied) for applied in run.applied[::8]])
    out, mean = tmp_path / "extracted.yaml", tmp_path / "mean.yaml"
    bag = bag_of_postures(tmp_path / "run", postures, NAMES)
    printed = extract(bag, "--out", str(out), "--mean", str(mean))
    assert "turns left" in printed
    np.testing.assert_allclose(components(out), direction_of("turn_paper"), atol=1e-8)
    (only,) = json.loads(extract(bag, "--json"))["components"]
    assert only["explained_variance"] == pytest.approx(1.0, abs=1e-12)
    content = read_yaml(out)
    assert content["name"] == "extracted"
    assert "explains 1.0000 of the variance" in content["source"]
    np.testing.assert_allclose(posture_of(mean), postures.mean(axis=0), atol=1e-10)


@pytest.mark.parametrize("name", PATTERN_KINDS)
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_sign_is_that_of_the_library_whichever_way_was_moved(tmp_path, name, way):
    """An uneven motion about neutral, and the same one backwards."""
    alphas = way * np.array([0.0, 0.1, 0.5, 0.2, -0.1, -0.2])
    source = csv_of(tmp_path / "moved.csv", neutral() + alphas[:, None] * direction_of(name))
    (only,) = json.loads(extract(source, "--json"))["components"]
    np.testing.assert_allclose(np.ravel(only["direction"]), direction_of(name), atol=1e-9)
    low, high = sorted((alphas - alphas.mean())[[alphas.argmin(), alphas.argmax()]])
    assert only["alpha_rad"] == pytest.approx([low, high], abs=1e-9)


def two_patterns():
    """Postures of turn and pitch at once with a tremor of the neck, and their shares of the variance, by algebra.

    Sines and cosines of whole periods have no mean and are orthogonal to one another: the variance along a
    direction is half the square of its amplitude.
    """
    phase = 2 * np.pi * np.arange(200) / 200
    amplitudes = np.array([0.3, 0.6, 0.05])
    tremor = np.zeros(45)
    tremor[NAMES.index("neck_rotation")] = 1.0
    directions = np.array([direction_of("turn"), direction_of("pitch"), tremor])
    scores = np.array([np.cos(phase), np.sin(2 * phase), np.sin(31 * phase)]).T * amplitudes
    return neutral() + scores @ directions, directions, amplitudes**2 / (amplitudes**2).sum()


def test_two_patterns_at_once_are_separated(tmp_path):
    postures, directions, shares = two_patterns()
    source = csv_of(tmp_path / "both.csv", postures)
    values = json.loads(extract(source, "--json"))
    assert values["postures"] == 200
    for row, place in zip(values["components"], (1, 0, 2), strict=True):
        assert row["explained_variance"] == pytest.approx(shares[place], rel=1e-9)
        found = np.ravel(row["direction"])
        assert abs(found @ directions[place]) == pytest.approx(1.0, abs=1e-9)
    for component, name in ((1, "pitch"), (2, "turn")):
        out = tmp_path / f"{name}.yaml"
        extract(source, "--component", str(component), "--out", str(out))
        np.testing.assert_allclose(components(out), direction_of(name), atol=1e-8)


def test_what_was_not_recorded_is_the_scenario_s_posture(tmp_path):
    names = ["left_hip_rotation", "right_hip_rotation"]
    degrees = np.deg2rad([[0.0, 0.0], [10.0, -10.0], [20.0, -20.0]])
    out, mean = tmp_path / "hips.yaml", tmp_path / "mean.yaml"
    extract(csv_of(tmp_path / "hips.csv", degrees, names), "--out", str(out), "--mean", str(mean))
    expected, changed = np.zeros(45), neutral().copy()
    hips = [NAMES.index(name) for name in names]
    expected[hips] = np.array([1.0, -1.0]) / np.sqrt(2.0)
    np.testing.assert_allclose(components(out), expected, atol=1e-8)
    changed[hips] = np.deg2rad([10.0, -10.0])
    np.testing.assert_allclose(posture_of(mean), changed, atol=1e-10)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "do not move"),
        (["--component", "4"], "move along 3 directions"),
        (["--component", "0"], "--component"),
        (["--out", "pattern.txt"], "must end in .yaml"),
        (["--mean", "nowhere/mean.yaml"], "a folder that exists"),
        (["--out", "two.yaml", "--mean", "./two.yaml"], "--mean"),
        (["--out", "mine.yaml"], "add --force"),
        (["--mean", "mine.yaml"], "add --force"),
    ],
)
def test_what_cannot_be_extracted_is_refused(tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    still = neutral() + np.deg2rad(0.09) * np.random.default_rng(1).random((4, 45))
    source = csv_of(tmp_path / "moved.csv", two_patterns()[0] if arguments else still)
    mine = tmp_path / "mine.yaml"
    mine.write_text("mine", encoding="utf-8")
    assert words in refused("pattern", "extract", source, *arguments)
    assert [path.name for path in tmp_path.glob("*.yaml")] == ["mine.yaml"]
    assert mine.read_text(encoding="utf-8") == "mine"
    if "mine.yaml" in arguments:
        extract(source, *arguments, "--force")
        assert mine.read_text(encoding="utf-8") != "mine"

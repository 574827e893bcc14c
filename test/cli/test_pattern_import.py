# SPDX-License-Identifier: Apache-2.0
"""Measured motions: thinned to a tolerance that is kept, and flown by the scenario that is written."""

import re
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke, refused
from postures import NAMES, csv_of, direction_of, neutral
from recordings import bag_of_postures
from scipy.interpolate import PchipInterpolator

from skydiver_utc.body.movement import movement, thin
from skydiver_utc.loop.build import build_plant
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import PosturePath, load_scenario
from skydiver_utc.parameters.loading import config_folder

EXAMPLES = Path(__file__).parents[2] / "examples"
ARMS = EXAMPLES / "arms_forward.csv"
KNEE = ["left_knee_flexion"]
SHOULDERS = ["left_shoulder_flexion", "right_shoulder_flexion"]


def imported(source, out, *arguments):
    """What is printed, and the scenario that is written."""
    result = invoke("pattern", "import", source, "--out", out, *arguments)
    assert result.exit_code == 0, result.output
    assert f"skydiver-utc simulate {out}" in result.stdout.replace("'", "")
    return result.stdout, load_scenario(str(out))


def refused_with(source, out, *arguments):
    """The sentence with which nothing is written."""
    sentence = refused("pattern", "import", source, "--out", out, *arguments)
    assert not out.exists()
    return sentence


def degrees(path, names, rows, time_s):
    """A file of angles [deg] at these times."""
    return csv_of(path, np.deg2rad(rows), names, time_s)


def measured(path):
    """Times (n,) and whole postures (n, 45) [rad] of a CSV file, read without the package."""
    table = np.genfromtxt(path, delimiter=",", names=True)
    postures = np.tile(neutral(), (len(table), 1))
    for name in table.dtype.names[1:]:
        postures[:, NAMES.index(name.removesuffix("_deg"))] = np.deg2rad(table[name])
    return table["time_s"], postures


def test_the_path_meets_every_measured_posture_and_the_scenario_flies_it(tmp_path):
    """Within the tolerance and what the command says; in flight, at its time and within a step of the fastest joint."""
    (tmp_path / "arms.yaml").touch()
    assert "--force" in refused("pattern", "import", ARMS, "--out", tmp_path / "arms.yaml")
    printed, scenario = imported(ARMS, tmp_path / "arms.yaml", "--force")
    assert isinstance(scenario.plant.pattern, PosturePath)
    time_s, postures = measured(ARMS)
    moves = movement(scenario.plant.posture, scenario.plant.pattern)
    path = np.array([moves.angles(2.0 * t / time_s[-1]).ravel() for t in time_s])
    error_deg = np.rad2deg(np.abs(path - postures)).max()
    assert error_deg < 0.5
    kept = len(scenario.plant.pattern.keyframes)
    assert f"kept {kept} of 81 postures" in printed
    assert f"{error_deg:.2g} deg" in printed
    assert kept < 30

    flight, plant = simulate(scenario), build_plant(scenario)
    assert flight.outcome.value == "completed"
    fastest = np.abs(np.diff(postures, axis=0) / np.diff(time_s)[:, None]).max()
    for moment, posture in zip(time_s, postures, strict=True):
        flown = plant.joint_angles(flight.applied[round((1.0 + moment) / scenario.dt_s)])
        assert np.abs(flown - posture).max() < np.deg2rad(0.5) + 2 * scenario.dt_s * fastest
    # The arms at their farthest push the head up; afterwards the fall is that of neutral again.
    x, y, z, w = flight.states[:, 3:7].T
    pitch = np.rad2deg(np.arcsin(2 * (y * w - x * z)))
    assert 5.0 < pitch.min() < 7.0
    assert 3.0 < scenario.dt_s * pitch.argmin() < 5.0
    assert pitch[-1] == pytest.approx(8.0, abs=0.5)


def test_a_recorded_turn_is_flown_again(tmp_path):
    """From a bag: postures along one direction come back as a path along it."""
    alphas = 0.8 * np.sin(np.linspace(0.0, np.pi, 41))
    bag = bag_of_postures(tmp_path / "run", neutral() + alphas[:, None] * direction_of("turn"), NAMES)
    # The second posture is sent twice; the first one counts.
    _, scenario = imported(bag, tmp_path / "again.yaml", "--tolerance", "0.1")
    moves = movement(scenario.plant.posture, scenario.plant.pattern)
    half_way = moves.angles(1.0).ravel() - neutral()
    np.testing.assert_allclose(half_way, 0.8 * direction_of("turn"), atol=np.deg2rad(0.1))


@pytest.mark.parametrize("tolerance", [0.0, 1e-4, 1e-2])
def test_thinning_keeps_the_tolerance(tolerance):
    """Noise, of which nothing can be left out without a tolerance; judged by SciPy's interpolation."""
    random = np.random.default_rng(3)
    time_s = np.cumsum(random.uniform(0.01, 0.05, 200))
    angles = np.sin(time_s)[:, None] + 1e-3 * random.normal(size=(200, 45))
    found = thin(time_s, angles, tolerance)
    path = PchipInterpolator(time_s[found.kept], angles[found.kept])
    assert np.abs(path(time_s) - angles).max() == pytest.approx(found.error, abs=1e-15)
    assert found.error <= tolerance
    assert (len(found.kept) == 200) is (tolerance < 1e-3)
    straight = thin(time_s, time_s[:, None] * np.arange(45.0), 1e-9)
    assert straight.kept.tolist() == [0, 199]


def test_the_file_and_the_settings_decide_posture_name_and_rate(tmp_path, monkeypatch):
    """Angles that it lacks are the posture's; 2 rad of alpha in 0.2 s are beyond the scenario's rate; any file name."""
    monkeypatch.chdir(tmp_path)
    elbows = degrees(
        tmp_path / "elbows.csv",
        ["left_elbow_flexion", "right_elbow_flexion"],
        [[90.0] * 2, [60.0] * 2],
        [0.0, 0.2],
    )
    name = '["Ärmel", b]'
    _, scenario = imported(elbows, Path(f"{name}.yaml"), "--set", "plant.posture=fast_fall")
    assert (scenario.name, scenario.title) == (name, f"Measured motion {name}")
    assert scenario.plant.limits.alpha_rate == pytest.approx(10.0)
    expected = load_scenario("bank_recovery", {"plant.posture": "fast_fall"}).plant.posture.joint_angles_deg
    found = scenario.plant.posture.joint_angles_deg
    assert found["left_elbow"][0] == pytest.approx(90.0)
    for joint, row in expected.items():
        assert "elbow" in joint or found[joint] == pytest.approx(row, abs=1e-8)


@pytest.mark.parametrize(
    ("angles", "time_s", "nodes"),
    [
        ([0, 0, 30, 0, 0], [0.0, 20.0, 20.05, 20.1, 40.0], 801),  # a node for each posture of a long file
        ([0, 0, 60, 0, 0], [0.0, 1.0, 1.1, 1.2, 3.0], 513),  # exact between the nodes of a quick motion
    ],
)
def test_the_table_that_is_flown_is_as_dense_as_the_motion_needs(tmp_path, angles, time_s, nodes):
    """test/body/test_movement.py has the error against the postures between the nodes."""
    names = ["neck_rotation"] if nodes == 801 else SHOULDERS
    source = degrees(tmp_path / "nod.csv", names, [[angle] * len(names) for angle in angles], time_s)
    printed, scenario = imported(source, tmp_path / "nod.yaml")
    assert scenario.plant.pattern_nodes == nodes
    assert float(re.search(rf"{nodes} nodes its table is off by (\S+) mm", printed)[1]) <= 0.5


def test_angles_just_beyond_the_joint_limits_are_clipped_and_named(tmp_path):
    """As published gaits have them: a straight knee a degree beyond."""
    rows = [[40.0, 9.0], [-1.1, 5.0], [20.0, 0.0]]
    source = degrees(tmp_path / "gait.csv", [*KNEE, "right_knee_flexion"], rows, [0.0, 1.0, 2.0])
    printed, scenario = imported(source, tmp_path / "gait.yaml")
    path = scenario.plant.pattern
    for text in (printed, path.source):
        assert "left_knee_flexion by 1.1 deg" in text
        assert "right_knee" not in text
    angles = [frame.posture.joint_angles_deg.get("left_knee", (0.0,))[0] for frame in path.keyframes]
    assert (min(angles), max(angles)) == (0.0, pytest.approx(40.0))


def test_an_angle_far_beyond_the_joint_limits_is_named_with_its_time(tmp_path):
    source = degrees(tmp_path / "bent.csv", KNEE, [[10.0], [-5.1]], [0.0, 0.25])
    message = refused_with(source, tmp_path / "bent.yaml")
    for words in ("bent.csv at 0.25 s", "left_knee_flexion of -5.1 deg", "joint limits adult"):
        assert words in message
    limits = (config_folder() / "joint_limits" / "adult.yaml").read_text(encoding="utf-8")
    own = tmp_path / "limber.yaml"
    own.write_text(limits.replace("knee: {flexion: [0", "knee: {flexion: [-10"), encoding="utf-8")
    imported(source, tmp_path / "bent.yaml", "--set", f"plant.subject.joint_limits={own}")


@pytest.mark.parametrize(
    ("out", "arguments", "words"),
    [
        ("arms.csv", [], "must end in .yaml"),
        ("nowhere/arms.yaml", [], "a folder that exists"),
        *(("arms.yaml", ["--tolerance", value], "--tolerance") for value in ("nan", "inf", "0", "-1")),
        ("arms.yaml", ["--set", "plant.posture=sitting"], "there is no posture 'sitting'"),
        ("arms.yaml", ["--set", "plant.pattern=turn", "--set", "plant.pattern.name=5"], "pattern.name"),
    ],
)
def test_what_cannot_be_imported_is_refused(tmp_path, out, arguments, words):
    assert words in refused_with(ARMS, tmp_path / out, *arguments)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("time_s", "angles", "words"),
    [
        ([0.0, 1e-300], [0, 20], "s apart: leave at least 1e-06 s"),
        ([0.0, 1e-300, 1.0], [0, 10, 20], "at 1e-300 s, are 1e-300 s apart"),
        ([0.0, 1e-3], [0, 20], "lasts 0.001 s, which cannot be flown: parameter plant.limits.alpha_rate"),
        ([0.0, 1e5], [0, 20], "lasts 100000 s, which cannot be flown: parameter duration_s"),
        ([-1e308, 1e308], [0, 20], "lasts inf s, which cannot be flown: duration_s"),
        ([0.0, 20.0, 20.05, 20.1, 400.0], [0, 0, 30, 0, 0], "less than 1/1024 of it apart"),
        ([0.0, 1.0, 2.0], [10.0, 10.09, 10.01], "do not move"),  # but for the noise of a measurement
        (
            [0.0, 20.0, 20.05, 20.1, 40.0],
            [0, 0, 60, 0, 0],
            "with 1025 nodes the plant's table is still off by",
        ),
    ],
)
def test_motions_that_cannot_be_flown_are_refused(time_s, angles, words, tmp_path):
    arms = degrees(tmp_path / "odd.csv", SHOULDERS, [[angle, angle] for angle in angles], time_s)
    message = refused_with(arms, tmp_path / "odd.yaml")
    assert words in message
    if found := re.search(r"off by (\S+) mm", message):
        assert float(found[1]) > 10

# SPDX-License-Identifier: Apache-2.0
"""Measured motions: thinned to a tolerance that is kept, and flown by the command that is printed."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from postures import NAMES, csv_of, direction_of, neutral
from recordings import bag_of_postures

from skydiver_utc.body.movement import movement, thin
from skydiver_utc.body.posture import configuration
from skydiver_utc.body.segments import build_body
from skydiver_utc.cli.main import main
from skydiver_utc.cli.settings import parse_setting
from skydiver_utc.loop.build import build_plant
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import PosturePath, load_scenario
from skydiver_utc.parameters.loading import config_folder
from skydiver_utc.plants.skydiver.dynamics import GEOMETRY_SIZE, posture_geometry

EXAMPLES = Path(__file__).parents[2] / "examples"
ARMS = EXAMPLES / "arms_forward.csv"


def imported(source, out, *arguments):
    """What is printed, and the settings of the command that flies the path."""
    result = CliRunner().invoke(main, ["pattern", "import", str(source), "--out", str(out), *arguments])
    assert result.exit_code == 0, result.output
    printed, command = result.stdout.rstrip().rsplit("\n\n", 1)
    words = shlex.split(command)
    assert words[:3] == ["skydiver-utc", "simulate", "bank_recovery"]
    assert set(words[3::2]) == {"--set"}
    return printed, dict(map(parse_setting, words[4::2]))


@pytest.fixture(scope="module")
def arms(tmp_path_factory):
    """The example, imported."""
    return imported(ARMS, tmp_path_factory.mktemp("arms") / "arms.yaml")


def measured(path):
    """Times (n,) and whole postures (n, 45) [rad] of a CSV file, read without the package."""
    table = np.genfromtxt(path, delimiter=",", names=True)
    postures = np.tile(neutral(), (len(table), 1))
    for name in table.dtype.names[1:]:
        postures[:, NAMES.index(name.removesuffix("_deg"))] = np.deg2rad(table[name])
    return table["time_s"], postures


def test_the_example_is_written_by_its_script():
    script = EXAMPLES / "arms_forward.py"
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    assert done.stdout == ARMS.read_text(encoding="utf-8")


def test_the_path_meets_every_measured_posture(arms):
    """As the plant will move: within the tolerance, and within what the command says."""
    printed, settings = arms
    scenario = load_scenario("bank_recovery", settings)
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


def test_the_printed_command_flies_the_motion(arms):
    """Every measured posture is taken at its time: within the tolerance and a step of the fastest joint."""
    _, settings = arms
    scenario = load_scenario("bank_recovery", settings)
    flight, plant = simulate(scenario), build_plant(scenario)
    assert flight.outcome.value == "completed"
    time_s, postures = measured(ARMS)
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
    _, settings = imported(bag, tmp_path / "again.yaml", "--tolerance", "0.1")
    scenario = load_scenario("bank_recovery", settings)
    moves = movement(scenario.plant.posture, scenario.plant.pattern)
    half_way = moves.angles(1.0).ravel() - neutral()
    np.testing.assert_allclose(half_way, 0.8 * direction_of("turn"), atol=np.deg2rad(0.1))


def test_a_straight_motion_needs_its_ends_alone():
    time_s = np.array([0.0, 0.1, 0.5, 0.6, 2.0])
    found = thin(time_s, time_s[:, None] * np.arange(45.0), 1e-9)
    assert found.kept.tolist() == [0, 4]
    assert found.error < 1e-12


@pytest.mark.parametrize("tolerance", [0.0, 1e-4, 1e-2])
def test_thinning_keeps_the_tolerance(tolerance):
    """Noise, of which nothing can be left out without a tolerance; judged by SciPy's interpolation."""
    from scipy.interpolate import PchipInterpolator

    random = np.random.default_rng(3)
    time_s = np.cumsum(random.uniform(0.01, 0.05, 200))
    angles = np.sin(time_s)[:, None] + 1e-3 * random.normal(size=(200, 45))
    found = thin(time_s, angles, tolerance)
    path = PchipInterpolator(time_s[found.kept], angles[found.kept])
    assert np.abs(path(time_s) - angles).max() == pytest.approx(found.error, abs=1e-15)
    assert found.error <= tolerance
    assert (len(found.kept) == 200) is (tolerance < 1e-3)


def test_what_the_file_lacks_is_that_of_the_posture_named(tmp_path):
    names = ["left_elbow_flexion", "right_elbow_flexion"]
    source = csv_of(tmp_path / "elbows.csv", np.deg2rad([[90.0, 90.0], [60.0, 60.0]]), names, dt=2.0)
    _, settings = imported(source, tmp_path / "elbows.yaml", "--set", "plant.posture=fast_fall")
    scenario = load_scenario("bank_recovery", settings)
    fast_fall = load_scenario("bank_recovery", {"plant.posture": "fast_fall"}).plant.posture.joint_angles_deg
    for joint, row in fast_fall.items():
        if "elbow" not in joint:
            assert scenario.plant.posture.joint_angles_deg[joint] == pytest.approx(row, abs=1e-8)
    assert scenario.plant.posture.joint_angles_deg["left_elbow"][0] == pytest.approx(90.0)


def test_a_motion_faster_than_the_limbs_may_go_raises_their_rate(tmp_path):
    """Alpha goes from 0 to 2 in 0.2 s: 10 rad/s, beyond the 3.5 of the scenario."""
    postures = neutral() + np.array([0.0, 0.05])[:, None] * direction_of("turn")
    _, settings = imported(csv_of(tmp_path / "jerk.csv", postures, dt=0.2), tmp_path / "jerk.yaml")
    assert settings["plant.limits.alpha_rate"] == pytest.approx(10.0)
    assert load_scenario("bank_recovery", settings).plant.limits.alpha_rate == pytest.approx(10.0)


def test_a_long_motion_gets_a_denser_table(tmp_path):
    """Three quick postures in a long file: the table has a node for each."""
    time_s = np.array([0.0, 20.0, 20.05, 20.1, 40.0])
    path = tmp_path / "nod.csv"
    rows = [f"{t},{angle}" for t, angle in zip(time_s, [0, 0, 30, 0, 0], strict=True)]
    path.write_text("\n".join(["time_s,neck_rotation", *rows]), encoding="utf-8")
    _, settings = imported(path, tmp_path / "nod.yaml")
    assert settings["plant.pattern_nodes"] == 801
    path.write_text("\n".join(["time_s,neck_rotation", *rows[:-1], "400,0"]), encoding="utf-8")
    assert "less than 1/1024 of it apart" in refused(path, tmp_path / "longer.yaml")


def refused(source, out, *arguments):
    result = CliRunner().invoke(main, ["pattern", "import", str(source), "--out", str(out), *arguments])
    assert result.exit_code == 2
    return result.output


KNEES = ["left_knee_flexion", "right_knee_flexion"]


def test_angles_just_beyond_the_joint_limits_are_clipped_and_named(tmp_path):
    """As published gaits have them: a straight knee a degree beyond."""
    source = csv_of(tmp_path / "gait.csv", np.deg2rad([[40.0, 9.0], [-1.1, 5.0], [20.0, 0.0]]), KNEES, dt=1.0)
    printed, settings = imported(source, tmp_path / "gait.yaml")
    assert "left_knee_flexion by 1.1 deg" in printed
    assert "right_knee" not in printed
    path = load_scenario("bank_recovery", settings).plant.pattern
    assert "left_knee_flexion by 1.1 deg" in path.source
    angles = [frame.posture.joint_angles_deg.get("left_knee", (0.0,))[0] for frame in path.keyframes]
    assert min(angles) == 0.0
    assert max(angles) == pytest.approx(40.0)


def test_an_angle_far_beyond_the_joint_limits_is_named_with_its_time(tmp_path):
    source = csv_of(tmp_path / "bent.csv", np.deg2rad([[10.0], [-5.1]]), ["left_knee_flexion"], dt=0.25)
    message = refused(source, tmp_path / "bent.yaml")
    for words in ("bent.csv at 0.25 s", "left_knee_flexion of -5.1 deg", "joint limits adult"):
        assert words in message
    assert not (tmp_path / "bent.yaml").exists()
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
    ],
)
def test_what_cannot_be_imported_is_refused(tmp_path, out, arguments, words):
    assert words in refused(ARMS, tmp_path / out, *arguments)


def test_a_path_names_postures_that_are_files(tmp_path):
    """A keyframe may name a posture by its path, as a scenario may."""
    file = tmp_path / "mine.yaml"
    file.write_text(
        (config_folder() / "postures" / "neutral.yaml").read_text(encoding="utf-8"), encoding="utf-8"
    )
    keyframes = [{"alpha": 0.0, "posture": str(file)}, {"alpha": 2.0, "posture": "track"}]
    path = load_scenario("front_layout_open_loop", {"plant.pattern.keyframes": keyframes}).plant.pattern
    assert [keyframe.posture.name for keyframe in path.keyframes] == ["neutral", "track"]
    assert path.as_dict()["kind"] == "path"


SHOULDERS = ["left_shoulder_flexion", "right_shoulder_flexion"]


def arms_of(path, time_s, angles_deg):
    """Both shoulders at these angles and times, every digit kept."""
    rows = [f"{t!r},{a!r},{a!r}" for t, a in zip(time_s, angles_deg, strict=True)]
    path.write_text("\n".join([",".join(["time_s", *SHOULDERS]), *rows]), encoding="utf-8")
    return path


def test_the_table_that_is_flown_is_exact_enough_for_a_quick_motion(tmp_path):
    """By the postures at three places between any two nodes, in metres and kg m2; and the error is printed."""
    source = arms_of(tmp_path / "quick.csv", [0.0, 1.0, 1.1, 1.2, 3.0], [0.0, 0.0, 60.0, 0.0, 0.0])
    printed, settings = imported(source, tmp_path / "quick.yaml")
    scenario = load_scenario("bank_recovery", settings)
    plant, row = build_plant(scenario), np.empty(GEOMETRY_SIZE)
    body, moves = build_body(scenario.plant.subject), movement(scenario.plant.posture, scenario.plant.pattern)
    quick = np.linspace(0.6, 0.85, 3 * scenario.plant.pattern_nodes // 4)
    place = inertia = 0.0
    for alpha in quick:
        posture_geometry(plant.constants, alpha, row)
        placed = configuration(body, moves.angles(alpha))
        place = max(place, np.abs(row[:48].reshape(3, 16).T - placed.centre).max())
        inertia = max(inertia, np.abs(row[144:147] - np.diag(placed.inertia)).max())
    assert place < 5e-4
    assert inertia < 5e-3
    # 257 nodes would miss a segment by several times as much.
    assert settings["plant.pattern_nodes"] > 257
    assert f"plant's {settings['plant.pattern_nodes']} nodes its table is off by" in printed
    assert float(re.search(r"off by (\S+) mm", printed)[1]) == pytest.approx(1e3 * place, rel=0.5)


def test_a_motion_too_quick_for_the_table_is_refused_with_its_error(tmp_path):
    source = arms_of(tmp_path / "quick.csv", [0.0, 20.0, 20.05, 20.1, 40.0], [0.0, 0.0, 60.0, 0.0, 0.0])
    message = refused(source, tmp_path / "quick.yaml")
    assert "moves too fast for its length, with 1025 nodes" in message
    assert float(re.search(r"off by (\S+) mm", message)[1]) > 10
    assert list(tmp_path.glob("*.yaml")) == []


@pytest.mark.parametrize("name", ["1", "it's #1", '["Ärmel", b]'])
def test_a_command_names_any_file(name, tmp_path, monkeypatch):
    """Relative, so that nothing before the name keeps YAML from reading a number or a list."""
    monkeypatch.chdir(tmp_path)
    source = arms_of(tmp_path / "source.csv", [0.0, 2.0], [0.0, 20.0])
    _, settings = imported(source, f"{name}.yaml")
    scenario = load_scenario("bank_recovery", settings)
    assert (scenario.name, scenario.title) == (name, f"Measured motion {name}")
    assert (scenario.plant.pattern.name, scenario.plant.posture.name) == (name, f"{name}_start")
    assert (settings["plant.pattern"], settings["plant.posture"]) == (f"{name}.yaml", f"{name}_start.yaml")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("time_s", "words"),
    [
        ([0.0, 1e-300], "s apart: leave at least 1e-06 s"),
        ([0.0, 1e-300, 1.0], "at 1e-300 s, are 1e-300 s apart"),
        ([0.0, 1e-3], "lasts 0.001 s, which cannot be flown: parameter plant.limits.alpha_rate"),
        ([0.0, 1e5], "lasts 100000 s, which cannot be flown: parameter duration_s"),
        ([-1e308, 1e308], "lasts inf s, which cannot be flown: parameter duration_s"),
    ],
)
def test_times_that_cannot_be_flown_are_refused(time_s, words, tmp_path):
    source = arms_of(tmp_path / "odd.csv", time_s, np.linspace(0.0, 20.0, len(time_s)).tolist())
    assert words in refused(source, tmp_path / "odd.yaml")
    assert list(tmp_path.glob("*.yaml")) == []


def test_postures_that_do_not_move_are_refused(tmp_path):
    """Not even by the noise of a measurement."""
    source = arms_of(tmp_path / "still.csv", [0.0, 1.0, 2.0], [10.0, 10.09, 10.01])
    assert "do not move: give the recording of a maneuver" in refused(source, tmp_path / "still.yaml")


def test_settings_that_do_not_go_with_the_path_are_refused_before_a_file_is_written(tmp_path):
    setting = ["--set", "plant.pattern=turn", "--set", "plant.pattern.name=5"]
    assert "pattern.name" in refused(ARMS, tmp_path / "arms.yaml", *setting)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_exists_is_kept_unless_forced(tmp_path):
    """Here that of the first posture, which the command line does not name."""
    taken = "arms_start.yaml"
    (tmp_path / taken).write_text("mine", encoding="utf-8")
    message = refused(ARMS, tmp_path / "arms.yaml")
    assert f"{tmp_path / taken} exists: choose another file, or add --force" in message
    assert [path.read_text(encoding="utf-8") for path in tmp_path.iterdir()] == ["mine"]
    _, settings = imported(ARMS, tmp_path / "arms.yaml", "--force")
    assert load_scenario("bank_recovery", settings).plant.pattern.name == "arms"

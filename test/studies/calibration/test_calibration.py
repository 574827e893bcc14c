# SPDX-License-Identifier: Apache-2.0
"""Calibrations: a known skydiver is found, repeatable, continued after an interruption, and flies from its files."""

import json
import sqlite3

import pytest
import yaml
from command_line import invoke

from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import ParameterError, load_scenario
from skydiver_utc.parameters.loading import config_folder
from skydiver_utc.studies.calibration.candidate import numbers_of, start_of
from skydiver_utc.studies.calibration.evaluation import evaluate
from skydiver_utc.studies.calibration.search import search
from skydiver_utc.studies.calibration.settings import load_calibration

pytestmark = pytest.mark.long

SHANK, TRUNK = (f"plant.subject.suit.drag_areas_m2.{name}.front" for name in ("shank", "upper_trunk"))
KNOWN = {SHANK: 0.17, TRUNK: 0.065}
STATICS = [
    {"measure": "fall_speed_m_s", "at_least": 50.0, "at_most": 65.0},
    {"measure": "yaw_acceleration_rad_s2", "at_least": 1.0},
    {"measure": "steady_yaw_rate_deg_s", "alpha": 0.5, "at_least": 1.0},
]
CONTENT = {
    "name": "known",
    "description": "A suit that was hidden",
    "start": {"scenario": "bank_recovery"},
    "numbers": {SHANK: [0.1, 0.25], TRUNK: [0.05, 0.1]},
    "statics": STATICS,
    "evaluations": 120,
}
LATER = {"at_most": 1.0, "times": "c"}
HARD = {"statics": [{"measure": "fall_speed_m_s", "at_most": 45.0}]}


def written(path, **changes):
    path.write_text(yaml.safe_dump(CONTENT | changes), encoding="utf-8")
    return path


def loaded(path, **changes):
    calibration = load_calibration(str(written(path, **changes)))
    return calibration, start_of(calibration)


def tried_in(folder, calibration, start, evaluations, seed=1):
    """Rows of the ledger."""
    folder.mkdir(exist_ok=True)
    search(calibration, start, seed, evaluations, folder, lambda _done: None)
    return sqlite3.connect(folder / "ledger.sqlite").execute("select number, metrics from runs").fetchall()


def test_the_measures_of_a_known_suit_are_found_and_its_files_are_the_skydiver_that_was_tried(tmp_path):
    known = evaluate(*loaded(tmp_path / "known.yaml"), KNOWN)
    within = [
        {**target, "at_least": value * 0.995, "at_most": value * 1.005}
        for target, value in zip(STATICS, known.found, strict=True)
    ]
    path, out = written(tmp_path / "towards.yaml", statics=within), tmp_path / "out"
    result = invoke("calibrate", path, "--out", out, "--json", "--quiet")
    assert result.exit_code == 0
    report = json.loads(result.stdout)
    assert report["evaluations"] > 1
    for target in report["targets"]:
        assert target["met"]
        assert target["at_least"] <= target["found"] <= target["at_most"]

    flown = {"plant.skydiver": str(out / "skydiver.yaml"), "plant.initial.bank_deg": 0.0, "duration_s": 2.0}
    scenario = load_scenario("bank_recovery", flown)
    plant = scenario.plant
    assert numbers_of(loaded(tmp_path / "again.yaml")[0], scenario) == report["numbers"]
    assert plant.initial.fall_speed_m_s == report["targets"][0]["found"]
    own = load_scenario("bank_recovery", {"plant.posture": str(out / "posture.yaml")}).plant.posture
    assert plant.posture == own
    assert all(part.source for part in (plant.subject.suit, plant.posture, plant.pattern))
    run = simulate(scenario)
    assert abs(run.output("yaw_rate")).max() < 1e-6
    assert run.output("fall_rate") == pytest.approx(run.output("fall_rate")[0], abs=1e-3)


def test_an_interrupted_search_ends_as_the_uninterrupted_one_of_its_seed(tmp_path):
    of_file = loaded(tmp_path / "hard.yaml", **HARD)
    whole = tried_in(tmp_path / "whole", *of_file, 14)
    assert tried_in(tmp_path / "other", *of_file, 2, seed=2)[1] != whole[1]
    assert tried_in(tmp_path / "part", *of_file, 9) == whole[:9]
    assert tried_in(tmp_path / "part", *of_file, 14) == whole
    with pytest.raises(ParameterError, match="holds runs of another"):
        tried_in(tmp_path / "part", *of_file, 1, seed=2)


@pytest.mark.parametrize(
    ("targets", "met", "goes_on"),
    [
        ({"rmse_deg_s": {"at_most": 400.0}}, (True, False), True),
        ({"rmse_deg_s": {"at_most": 1.0}}, (False, False), False),
        (
            {"rmse_deg_s": {"at_most": 1.0}, "peak_yaw_rate_deg_s": {"at_most": 500.0}},
            (True, False, False),  # in the order of the file, by name
            True,
        ),
    ],
)
def test_a_flight_is_compared_with_an_earlier_one_unless_that_is_far_off(tmp_path, targets, met, goes_on):
    flown, short = {"scenario": "fast_turn_pose_only"}, {"duration_s": 3.0}
    relative = {"rmse_deg_s": {"at_least": 2.0, "times": "own"}}
    flights = [
        {"name": "own", **flown, "settings": short, "targets": targets},
        {"name": "weak", **flown, "settings": short | {"controller.K_p": 0.0}, "targets": relative},
    ]
    calibration, start = loaded(tmp_path / "flights.yaml", statics=[], flights=flights)
    tried = evaluate(calibration, start, numbers_of(calibration, start))
    assert tried.met == met
    own, relative_to_it = tried.found[-2:]
    assert own > 3.0
    assert own < relative_to_it < 2.0 * own if goes_on else relative_to_it is None


def test_the_pattern_is_designed_for_the_candidate(tmp_path):
    calibration, start = loaded(tmp_path / "design.yaml", pattern="turn")
    kept, _ = loaded(tmp_path / "kept.yaml")
    numbers = numbers_of(calibration, start) | {SHANK: 0.11}
    designed, own = (evaluate(one, start, numbers).found[1] for one in (calibration, kept))
    assert designed > own


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"numbers": {SHANK: [0.3, 0.1]}}, SHANK),
        ({"numbers": {SHANK: [0.1, 0.2]}}, "0.207"),
        ({"numbers": {"plant.hands.K": [0.1, 0.2]}}, "plant.hands.K"),
        ({"numbers": {"plant.subject.suit.drag_areas_m2.shank.top": [0.1, 0.2]}}, "shank.top"),
        ({"numbers": {}}, "numbers"),
        ({"statics": []}, "target"),
        ({"statics": [{"measure": "fall_speed_m_s"}]}, "at_least"),
        ({"statics": [{"measure": "fall_speed", "at_least": 1.0}]}, "fall_speed_m_s"),
        ({"statics": [{"measure": "fall_speed_m_s", "at_least": 60.0, "at_most": 50.0}]}, "60"),
        ({"flights": [{"name": "a", "scenario": "b", "targets": {"rmse": {"at_most": 1.0}}}]}, "rmse_deg_s"),
        ({"flights": [{"name": "a", "scenario": "b", "targets": {"rmse_deg_s": LATER}}]}, "'c'"),
        ({"start": {"scenario": "nobody"}}, "nobody"),
        ({"flights": [{"name": "a", "scenario": "nowhere"}]}, "nowhere"),
        ({"budget": 3}, "budget"),
        ({"evaluations": 0}, "evaluations"),
    ],
)
def test_a_wrong_file_is_refused_with_the_name_of_the_field(tmp_path, changes, named):
    path = written(tmp_path / "wrong.yaml", **changes)
    result = invoke("calibrate", path, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert named in result.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "name", sorted(path.stem for path in (config_folder() / "calibrations").glob("*.yaml"))
)
def test_every_calibration_of_the_package_can_be_started(name):
    calibration = load_calibration(name)
    assert calibration.name == name
    start_of(calibration)


def test_the_papers_skydiver_meets_its_targets(tmp_path):
    content = yaml.safe_load((config_folder() / "calibrations" / "paper.yaml").read_text(encoding="utf-8"))
    content["start"]["settings"] = {"plant.skydiver": "paper", "plant.posture": "box"}
    calibration = load_calibration(str(written(tmp_path / "paper.yaml", **content)))
    start = start_of(calibration)
    assert all(evaluate(calibration, start, numbers_of(calibration, start)).met)

"""``replay --check``: the recorded controller answers as recorded, another one does not, and which one is told."""

import dataclasses
import json
from pathlib import Path
from typing import Any
from unittest.mock import patch

import msgspec
import numpy as np
import pytest
import test_analysis_recorded_flight as by_hand
from click.testing import CliRunner, Result
from test_analysis_recorded_flight import Edit, Message, preview, without

from skydiver_utc.analysis.controller_check import check
from skydiver_utc.analysis.recorded_flight import CONTROL_NAMES, RecordedFlight
from skydiver_utc.cli import main
from skydiver_utc.control.protocol import Controller
from skydiver_utc.parameters import load_scenario, override
from skydiver_utc.plant.skydiver import CONTROL_NAMES as OF_PLANT
from skydiver_utc.simulation.build import build_controller, build_reference
from skydiver_utc.simulation.closed_loop import simulate
from skydiver_utc.simulation.flight import Flight

SCENARIO = "fast_turn_unknown_dynamics"
SHORT = {"duration_s": 0.6}


@pytest.fixture(scope="module")
def flight() -> Flight:
    return simulate(load_scenario(SCENARIO, SHORT))


@pytest.fixture(scope="module")
def run(flight: Flight, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_bag(tmp_path_factory.mktemp("check") / "run", flight, with_previews(flight))


def write_bag(folder: Path, flight: Flight, edit: Edit = list) -> Path:
    """A bag of the flight's messages with its own stamps."""
    with patch.object(by_hand, "scenario_of", lambda: flight.scenario):
        return by_hand.write_bag(folder, flight, edit)


def with_previews(flight: Flight, offset: float = 0.0) -> Any:
    """Adds the previews of a flight in chunks that reach beyond its end, later ones moved by `offset`."""
    kind = "trajectory_msgs/msg/JointTrajectory"
    profile = build_reference(flight.scenario)
    count = 80 + flight.scenario.preview_steps  # just what the steps up to the next chunk need

    def edit(messages: list[Message]) -> list[Message]:
        chunks = [("reference", kind, k, preview(k, profile.preview(k, count) + offset * k)) for k in (0, 80)]
        return [*messages, *chunks]

    return edit


def call(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["replay", *map(str, arguments)])


def told(*arguments: object) -> dict[str, Any]:
    values: dict[str, Any] = json.loads(call(*arguments, "--check", "--json").stdout)
    return values


def test_the_names_of_the_controls_are_those_of_the_plant() -> None:
    assert CONTROL_NAMES == OF_PLANT


@pytest.mark.parametrize("scenario", [SCENARIO, "fast_turn_pose_only", "fast_turn_pi_dynamics"])
def test_a_recorded_controller_answers_as_recorded(scenario: str, tmp_path: Path) -> None:
    """Also without any preview in the bag: the setpoints, then the scenario's reference are taken."""
    flown = simulate(load_scenario(scenario, {"duration_s": 0.3}))
    result = call(write_bag(tmp_path / "run", flown), "--check")
    assert result.exit_code == 0, result.output
    assert f"all {len(flown.commands)} commands are the recorded ones, bit for bit" in result.output


def test_nothing_is_added_to_a_reference_that_was_recorded(run: Path) -> None:
    values = told(run)
    assert (values["equal"], values["reference_steps_not_recorded"]) == (True, 0)
    assert values["first_difference"] is None
    assert {of["largest"] for of in values["controls"].values()} == {0.0}


def by_hand_answers(flight: Flight, controller: Controller, reference: Any) -> Any:
    ahead = controller.preview_steps + 1
    states = flight.states[:-1]
    return np.array(
        [controller.decide(x, reference[k : k + ahead]).control.copy() for k, x in enumerate(states)]
    )


def test_the_previews_are_what_the_controller_is_fed(flight: Flight, tmp_path: Path) -> None:
    """Of two previews of one step the later one counts, as in the controller node."""
    folder = write_bag(tmp_path / "run", flight, with_previews(flight, offset=0.01))
    reference = build_reference(flight.scenario).preview(0, 400)
    reference[80:] += 0.01 * 80
    answers = by_hand_answers(flight, build_controller(flight.scenario), reference)
    values = told(folder)
    assert values["different_steps"] == (answers != flight.commands).any(axis=1).sum() > 0
    assert values["controls"]["alpha"]["largest"] == abs(answers - flight.commands)[:, 3].max()


@pytest.mark.parametrize(("step", "control"), [(0, 3), (57, 0), (142, 2)])
def test_one_bit_in_one_command_is_found(flight: Flight, tmp_path: Path, step: int, control: int) -> None:
    commands = flight.commands.copy()
    commands[step, control] = np.nextafter(commands[step, control], 9.0)
    changed = write_bag(tmp_path / "run", _with(flight, commands), with_previews(flight))
    result = call(changed, "--check", "--json")
    assert result.exit_code == 1
    values = json.loads(result.stdout)
    assert (values["equal"], values["different_steps"]) == (False, 1)
    assert values["first_difference"] == {
        "step": step,
        "time_s": pytest.approx(step * flight.scenario.dt_s),
        "control": CONTROL_NAMES[control],
        "recorded": commands[step, control],
        "answer": flight.commands[step, control],
    }


def test_the_sign_of_zero_counts(flight: Flight, tmp_path: Path) -> None:
    zero = int(np.flatnonzero(flight.commands[:, 1] == 0.0)[0])
    commands = flight.commands.copy()
    commands[zero, 1] = -commands[zero, 1]
    changed = write_bag(tmp_path / "run", _with(flight, commands), with_previews(flight))
    assert told(changed)["first_difference"]["step"] == zero


def _with(flight: Flight, commands: Any) -> Flight:
    return dataclasses.replace(flight, commands=commands)


def test_another_controller_is_asked_at_the_recorded_states(run: Path, flight: Flight) -> None:
    """Its answers are those of that controller called by hand with the same states, and so are the figures."""
    other = load_scenario("fast_turn_pose_only")
    controller = build_controller(msgspec.structs.replace(flight.scenario, controller=other.controller))
    answers = by_hand_answers(flight, controller, flight.reference)
    error = answers - flight.commands
    values = told(run, "--controller", "fast_turn_pose_only")
    assert values["asked"] == "the controller of fast_turn_pose_only"
    for j, name in enumerate(CONTROL_NAMES):
        of = values["controls"][name]
        assert of["rms"] == pytest.approx(np.linalg.norm(error[:, j]) / np.sqrt(143), rel=1e-12)
        assert of["largest"] == max(abs(error[:, j]))
        assert abs(error[round(of["largest_at_s"] / 0.0042), j]) == of["largest"]
    assert call(run, "--check", "--controller", "fast_turn_pose_only").exit_code == 1


def test_settings_change_the_controller_that_is_asked(run: Path) -> None:
    same = told(run, "--set", "controller.horizon_steps=20")
    other = told(run, "--set", "controller.horizon_steps=5")
    assert other["asked"] == "the recorded controller with controller.horizon_steps=5"
    assert (same["equal"], other["equal"]) == (True, False)


def test_a_longer_preview_than_recorded_is_told(flight: Flight, tmp_path: Path) -> None:
    folder = write_bag(tmp_path / "run", flight)
    assert told(folder)["reference_steps_not_recorded"] == flight.scenario.preview_steps - 1


def test_a_hole_in_the_reference_is_told_and_does_not_matter(flight: Flight, tmp_path: Path) -> None:
    """As a reference node leaves it that was killed and started again."""
    folder = write_bag(tmp_path / "run", flight, without("reference/setpoint", *range(60, 100)))
    shown = call(folder, "--check")
    added = 40 + flight.scenario.preview_steps - 1
    assert shown.exit_code == 0, shown.output
    sentence = "steps of the reference are not in the recording: the recorded scenario stands in"
    assert f"{added} {sentence}" in shown.output
    values = told(folder)
    assert (values["equal"], values["reference_steps_not_recorded"]) == (True, added)
    analysed = CliRunner().invoke(main, ["analyse", str(folder)])
    assert "40 steps of the reference are not in the recording" in analysed.output
    assert json.loads((folder / "metrics.json").read_text())["reference_steps_not_recorded"] == 40


def test_a_flight_that_was_cut_short_is_checked_as_far_as_it_goes(flight: Flight, tmp_path: Path) -> None:
    later = tuple(range(90, 144))
    edits = [without(topic, *later) for topic in ("state", "command", "applied_command")]
    cut = [with_previews(flight), *edits, without("outcome")]

    def edit(messages: list[Message]) -> list[Message]:
        for each in cut:
            messages = each(messages)
        return messages

    values = told(write_bag(tmp_path / "run", flight, edit))
    assert values["equal"]
    assert 80 < values["steps"] < 90


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("dt_s=0.005", "dt_s is the recording's"),
        ("reference.amplitude_deg_s=10", "reference is the recording's"),
        ("controller.horizon=5", "unknown parameter controller.horizon"),
    ],
)
def test_what_cannot_be_asked(run: Path, setting: str, words: str) -> None:
    result = call(run, "--check", "--set", setting)
    assert result.exit_code == 2
    assert words in result.output


def test_a_controller_for_another_reference_is_refused(run: Path) -> None:
    result = call(run, "--check", "--controller", "back_layout_open_loop")
    assert result.exit_code == 2
    assert "need each other" in result.output


def test_figure(run: Path, tmp_path: Path) -> None:
    path = tmp_path / "check.png"
    assert call(run, "--check", "--controller", "fast_turn_pose_only", "--figure", path).exit_code == 1
    assert path.read_bytes().startswith(b"\x89PNG")


def test_override_changes_a_copy() -> None:
    scenario = load_scenario(SCENARIO)
    assert override(scenario, {}) == scenario
    assert override(scenario, {"duration_s": 1.0}) == load_scenario(SCENARIO, {"duration_s": 1.0})


def test_check_uses_no_memory_of_an_earlier_call(run: Path) -> None:
    recording = RecordedFlight(run)
    assert check(recording).equal
    assert check(recording).equal

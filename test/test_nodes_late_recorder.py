"""A recorder that comes into a flight: what is there is analysed, checked and played as far as it can be."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from ros_fixtures import Ros
from test_nodes_lifecycle import ACTIVATE, DEACTIVATE, Manager, Stage

from skydiver_utc.analysis.recorded_flight import read_flight
from skydiver_utc.cli import main
from skydiver_utc.nodes import bag_recorder, topics
from skydiver_utc.recording.playback import in_order
from skydiver_utc.recording.reader import read_bag
from skydiver_utc.simulation.closed_loop import simulate

pytest_plugins = ("ros_fixtures",)


def record_the_rest(ros: Ros, folder: Path, with_another_controller: bool) -> int:
    """Fly, start the recorder in a pause; the step of that pause."""
    stage = Stage(ros, 2.0)
    stage.add("controller", "reference")
    plant = stage.add("plant", command_timeout_s=0.2, command_retries=1000)
    pause = Manager(ros, "plant")
    ros.spin_until(lambda: plant.k >= 100)
    assert pause.transition(DEACTIVATE)
    ros.spin_until(lambda: stage.nodes["controller"].answered == plant.k)
    paused_at: int = plant.k
    ready = ros.partner("listener").hear(topics.RECORDER_READY)
    recorder = stage.add("recorder", bag_folder=str(folder))
    ros.spin_until(lambda: ready)
    if with_another_controller:
        ros.remove(stage.nodes["controller"])
        stage.add("controller")
    assert pause.transition(ACTIVATE)
    ros.spin_until(lambda: recorder.finished)
    assert recorder.close() == 0
    return paused_at


def call(*arguments: object) -> Result:
    return CliRunner().invoke(main, list(map(str, arguments)))


@pytest.fixture(autouse=True)
def no_repair(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody sends again what was sent before the recorder came."""
    monkeypatch.setattr(bag_recorder, "_REPAIR_S", 1.0)


def test_the_rest_of_a_flight_is_analysed_and_played(ros: Ros, tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    first = record_the_rest(ros, folder, with_another_controller=False) + 1
    flight = read_flight(folder)
    assert flight.first_step == first
    whole = simulate(flight.scenario)
    for name in ("states", "commands", "applied", "reference"):
        assert getattr(flight, name).tobytes() == getattr(whole, name)[first:].tobytes(), name
    result = call("analyse", folder)
    assert result.exit_code == 0, result.output
    sentence = f"steps 0 to {first - 1} are not in the recording, it begins at {first * 0.0042:.3f} s"
    assert sentence in result.output
    assert sentence in (folder / "report.html").read_text()
    assert json.loads((folder / "metrics.json").read_text())["missing_steps"] == first
    played = in_order(read_bag(folder))
    assert played[-1].log_time_ns - played[0].log_time_ns <= (len(flight.commands) + 1) * 4_200_000


def test_its_controller_cannot_be_checked_where_it_never_began_anew(ros: Ros, tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    first = record_the_rest(ros, folder, with_another_controller=False) + 1
    result = call("replay", folder, "--check")
    assert result.exit_code == 2
    assert f"the recording begins at step {first}, and what the controller remembered there" in result.output


def test_its_controller_is_checked_from_where_it_began_anew(ros: Ros, tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    record_the_rest(ros, folder, with_another_controller=True)
    flight = read_flight(folder)
    begun = [change.step for change in flight.changes if change.node == "controller"]
    assert begun
    result = call("replay", folder, "--check", "--json")
    values = json.loads(result.stdout)
    assert (values["equal"], values["first_step"]) == (True, begun[0])
    assert values["steps"] == flight.first_step + len(flight.commands) - begun[0] > 100
    assert f"checked from step {begun[0]} on" in call("replay", folder, "--check").output
    other = call("replay", folder, "--check", "--json", "--set", "controller.P_err=9e-4")
    difference = json.loads(other.stdout)["first_difference"]
    row = difference["step"] - flight.first_step
    control = ["Cm_damp_yaw", "k_right", "k_left", "alpha"].index(difference["control"])
    assert difference["recorded"] == flight.commands[row, control]
    assert difference["time_s"] == pytest.approx(difference["step"] * 0.0042)

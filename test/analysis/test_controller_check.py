# SPDX-License-Identifier: Apache-2.0
"""``replay --check``: the recorded controller decides as recorded, another one does not."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from recordings import added, change, since, with_previews, without, write_run

from skydiver_utc.analysis.controller_check import check
from skydiver_utc.analysis.recorded_run import RecordedRun
from skydiver_utc.cli.main import main
from skydiver_utc.controllers.protocol import Controller
from skydiver_utc.loop.build import build_controller, build_reference
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters import load_scenario

SCENARIO = "fast_turn_unknown_dynamics"


@pytest.fixture(scope="module")
def run() -> Run:
    return simulate(load_scenario(SCENARIO, {"duration_s": 0.6}))


@pytest.fixture(scope="module")
def folder(run: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("check") / "run", run, with_previews(run))


def call(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["replay", *map(str, arguments), "--check"])


def report(*arguments: object) -> dict[str, Any]:
    values: dict[str, Any] = json.loads(call(*arguments, "--json").stdout)
    return values


def own(run: Run, **changes: Any) -> Controller:
    """The run's controller with other settings."""
    scenario = load_scenario(SCENARIO, {"duration_s": 0.6, **changes})
    return build_controller(scenario, run.plant, build_reference(scenario))


def computed(run: Run, controller: Controller, reference: Any) -> Any:
    """Commands of a controller at the run's states, by hand."""
    ahead = controller.preview_steps + 1
    return np.array(
        [controller.decide(x, reference[k : k + ahead]).control.copy() for k, x in enumerate(run.states[:-1])]
    )


@pytest.mark.parametrize("scenario", [SCENARIO, "fast_turn_pose_only", "fast_turn_pi_dynamics"])
@pytest.mark.long
def test_a_recorded_controller_decides_as_recorded(scenario: str, tmp_path: Path) -> None:
    """Also without any preview in the bag: from the setpoints, then the scenario's reference."""
    found = simulate(load_scenario(scenario, {"duration_s": 0.3}))
    result = call(write_run(tmp_path / "run", found))
    assert result.exit_code == 0, result.output
    assert f"all {len(found.commands)} commands" in result.output


def test_nothing_is_added_to_a_reference_that_was_recorded_and_no_check_keeps_a_memory(folder: Path) -> None:
    values = report(folder)
    assert (values["equal"], values["reference_steps_not_recorded"]) == (True, 0)
    assert values["reference_steps_revised"] == 0
    assert values["first_difference"] is None
    assert {of["largest"] for of in values["controls"].values()} == {0.0}
    recording = RecordedRun(folder)
    assert check(recording).equal
    assert check(recording).equal


def test_the_controller_gets_the_previews(run: Run, tmp_path: Path) -> None:
    """Of two previews of one step the later one counts, as in the controller node."""
    folder = write_run(tmp_path / "run", run, with_previews(run, offset=0.8))
    reference = build_reference(run.scenario).preview(0, 400)
    reference[80:] += 0.8
    controller = own(run)
    commands = computed(run, controller, reference)
    values = report(folder)
    assert values["different_steps"] == (commands != run.commands).any(axis=1).sum() > 0
    assert values["controls"]["alpha"]["largest"] == abs(commands - run.commands)[:, 3].max()
    assert values["reference_steps_revised"] == controller.preview_steps


@pytest.mark.parametrize(("step", "control"), [(0, 3), (142, 2), (0, 1)])
def test_one_bit_in_one_command_is_found(run: Run, tmp_path: Path, step: int, control: int) -> None:
    """Also the sign of a zero."""
    commands = run.commands.copy()
    value = commands[step, control]
    commands[step, control] = np.nextafter(value, 9.0) if value else -value
    changed = dataclasses.replace(run, commands=commands)
    result = call(write_run(tmp_path / "run", changed, with_previews(run)), "--json")
    assert result.exit_code == 1
    values = json.loads(result.stdout)
    assert (values["equal"], values["different_steps"]) == (False, 1)
    assert values["first_difference"] == {
        "step": step,
        "time_s": pytest.approx(step * run.scenario.dt_s),
        "control": run.plant.control_names[control],
        "recorded": commands[step, control],
        "computed": run.commands[step, control],
    }


def test_another_controller_decides_at_the_recorded_states(folder: Path, run: Run, tmp_path: Path) -> None:
    other = load_scenario("fast_turn_pose_only")
    reference = build_reference(run.scenario)
    controller = build_controller(run.scenario.replace(controller=other.controller), run.plant, reference)
    error = computed(run, controller, run.reference) - run.commands
    values = report(folder, "--controller", "fast_turn_pose_only")
    for j, name in enumerate(run.plant.control_names):
        of = values["controls"][name]
        assert of["rms"] == pytest.approx(np.linalg.norm(error[:, j]) / np.sqrt(143), rel=1e-12)
        assert of["largest"] == max(abs(error[:, j]))
        assert abs(error[round(of["largest_at_s"] / 0.0042), j]) == of["largest"]
    figure = tmp_path / "check.png"
    assert call(folder, "--controller", "fast_turn_pose_only", "--figure", figure).exit_code == 1
    assert figure.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("setting", "equal"),
    [
        ("controller.horizon_steps=20", True),
        ("controller.horizon_steps=5", False),
        ("plant.air.density_kg_m3=0.95", False),
    ],
)
def test_settings_change_the_controller_and_the_plant_it_predicts_with(
    folder: Path, setting: str, equal: bool
) -> None:
    values = report(folder, "--set", setting)
    assert values["equal"] is equal
    assert setting in values["controller"]


@pytest.mark.usefixtures("unrendered")
def test_a_hole_in_the_reference_is_reported_and_filled(run: Run, tmp_path: Path) -> None:
    """As a reference node leaves it that was killed and restarted."""
    folder = write_run(tmp_path / "run", run, without("reference/setpoint", *range(60, 100)))
    added_steps = 40 + own(run).preview_steps - 1
    values = report(folder)
    assert (values["equal"], values["reference_steps_not_recorded"]) == (True, added_steps)
    assert str(added_steps) in call(folder).output
    analysed = CliRunner().invoke(main, ["analyse", str(folder)])
    assert "40 steps" in analysed.output
    assert json.loads((folder / "metrics.json").read_text())["reference_steps_not_recorded"] == 40


def test_a_recording_is_checked_as_far_as_it_goes_without_a_hole(run: Run, tmp_path: Path) -> None:
    def cut(messages: Any) -> Any:
        kept = [m for m in messages if m[0] != "outcome" and (m[2] < 90 or m[0] == "reference")]
        return with_previews(run)(kept)

    holed, short = (
        report(write_run(tmp_path / name, run, edit))
        for name, edit in (("hole", without("state", 70)), ("cut", cut))
    )
    assert (holed["equal"], holed["steps"], holed["hole_at_step"]) == (True, 70, 70)
    assert (short["equal"], short["hole_at_step"]) == (True, None)
    assert 80 < short["steps"] <= 90


def test_a_controller_that_got_other_settings_is_checked_with_them(run: Run, tmp_path: Path) -> None:
    """From step 50 on: a shorter horizon, resumed from the control that was applied then."""
    reference = build_reference(run.scenario).preview(0, 400)
    later = own(run, **{"controller.horizon_steps": 5})
    control = run.applied[49]
    later.resume(control.copy())
    commands = run.commands.copy()
    for k in range(50, len(commands)):
        commands[k] = later.decide(run.states[k], reference[k : k + later.preview_steps + 1]).control
    changed = dataclasses.replace(run, commands=commands)
    restart = change(50, "controller", control.tolist(), controller__horizon_steps=5)
    folder = write_run(tmp_path / "run", changed, added(restart))
    assert report(folder)["equal"]
    rest = write_run(tmp_path / "rest", changed, lambda m: since(30)(added(restart)(m)))
    values = report(rest)
    assert (values["equal"], values["first_step"], values["steps"]) == (True, 50, 93)


def test_without_its_beginning_a_recording_cannot_be_checked(run: Run, tmp_path: Path) -> None:
    result = call(write_run(tmp_path / "run", run, since(30)))
    assert (result.exit_code, "step 30" in result.output) == (2, True)


@pytest.mark.parametrize("setting", ["dt_s=0.005", "reference.amplitude_deg_s=10", "controller.horizon=5"])
def test_wrong_settings_are_refused(folder: Path, setting: str) -> None:
    result = call(folder, "--set", setting)
    assert result.exit_code == 2
    assert setting.split("=")[0].removesuffix(".amplitude_deg_s") in result.output

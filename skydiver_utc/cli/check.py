# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc replay --check``: the commands of a controller at the states of a recorded run."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.outputs import check_figure_path, save_figure
from skydiver_utc.cli.screen import show_lines, show_values
from skydiver_utc.cli.settings import parse_setting
from skydiver_utc.errors import FAILED

if TYPE_CHECKING:
    from skydiver_utc.parameters import Scenario

# What the states and the reference of a recording belong to.
_RECORDED = ("dt_s", "epoch_s", "duration_s", "reference")


def check(
    folder: Path, controller: str | None, settings: Sequence[str], figure: Path | None, as_json: bool
) -> int:
    """Compute the commands, print the differences; returns the exit code."""
    from skydiver_utc.analysis import controller_check
    from skydiver_utc.analysis.metrics import to_json
    from skydiver_utc.analysis.recorded_run import RecordedRun

    check_figure_path(figure)
    found = controller_check.check(
        RecordedRun(folder), lambda recorded: _other_scenario(recorded, controller, settings)
    )
    name = "the recorded controller" if controller is None else f"the controller of {controller}"
    name += f" with {', '.join(settings)}" if settings else ""
    values = {**controller_check.report(found), "controller": name}
    if as_json:
        print(to_json(values))
    else:
        _show(values)
    if figure is not None:
        from skydiver_utc.analysis.control_figures import check_figure

        save_figure(figure, check_figure(found, name))
    return 0 if found.equal else FAILED


def _other_scenario(recorded: "Scenario", controller: str | None, settings: Sequence[str]) -> "Scenario":
    """The recorded scenario with another one's controller, then with the settings."""
    from skydiver_utc.parameters import load_scenario, override

    overrides: dict[str, object] = {}
    if controller is not None:
        overrides["controller"] = load_scenario(controller).controller.as_dict()
    overrides |= dict(map(parse_setting, settings))
    scenario = override(recorded, overrides)
    for name in _RECORDED:
        if getattr(scenario, name) != getattr(recorded, name):
            raise CommandError(
                f"{name} is the recording's and cannot be set: use `skydiver-utc simulate` for another one"
            )
    return scenario


def _show(values: dict[str, Any]) -> None:
    show_values(values, False, "schema_version", "first_difference", "equal")
    if values["first_step"]:
        show_lines("the recording lacks the beginning: checked from the controller's restart on")
    if values["hole_at_step"] is not None:
        show_lines("the recording has a hole: checked up to there")
    if values["reference_steps_revised"]:
        show_lines("a decision before a change of the live reference is computed with the later values")
    first = values["first_difference"]
    if first is None:
        show_lines(
            f"{values['controller']}: all {values['steps']} commands are the recorded ones, bit for bit"
        )
        return
    show_lines(
        f"{values['different_steps']} of {values['steps']} commands differ, the first at step {first['step']}"
        f" ({first['time_s']:.3f} s): {first['control']} was {first['recorded']!r}, is {first['computed']!r}"
    )
    if values["in_real_time"]:
        show_lines("recorded in real time, where a controller does not receive every state")

"""``skydiver-utc replay --check``: the controller of a recorded run asked again, or another one in its place."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
from rich.console import Console
from rich.table import Column, Table
from rich.text import Text

from skydiver_utc.analysis.controller_check import Check, report
from skydiver_utc.analysis.controller_check import check as ask
from skydiver_utc.analysis.labels import reference_added
from skydiver_utc.analysis.metrics import to_json
from skydiver_utc.analysis.recorded_flight import RecordedFlight
from skydiver_utc.parameters import Scenario, load_scenario, override
from skydiver_utc.verbs.errors import VerbError
from skydiver_utc.verbs.settings import parse_setting
from skydiver_utc.verbs.simulate import check_figure_path

_DIFFERENT = 1

# What the states and the reference of a recording belong to.
_RECORDED = ("dt_s", "epoch_s", "duration_s", "reference")


def check(
    folder: Path, controller: str | None, settings: Sequence[str], figure: Path | None, as_json: bool
) -> int:
    """Ask, print what differs; returns the exit code."""
    if figure is not None:
        check_figure_path(figure)
    recording = RecordedFlight(folder)
    found = ask(recording, lambda recorded: other_scenario(recorded, controller, settings))
    asked = _asked(controller, settings)
    values = {**report(found), "asked": asked}
    if figure is not None:
        _draw(found, asked, figure)
    if as_json:
        print(to_json(values))
    else:
        _show(values)
    return 0 if found.equal else _DIFFERENT


def other_scenario(recorded: Scenario, controller: str | None, settings: Sequence[str]) -> Scenario:
    """The recorded scenario with another one's controller, then with the settings."""
    overrides: dict[str, object] = {}
    if controller is not None:
        overrides["controller"] = msgspec.to_builtins(load_scenario(controller).controller)
    overrides |= dict(map(parse_setting, settings))
    scenario = override(recorded, overrides)
    for name in _RECORDED:
        if getattr(scenario, name) != getattr(recorded, name):
            raise VerbError(
                f"{name} is the recording's and cannot be set: fly with it by `skydiver-utc simulate`"
            )
    return scenario


def _asked(controller: str | None, settings: Sequence[str]) -> str:
    """Whose answers they are."""
    name = "the recorded controller" if controller is None else f"the controller of {controller}"
    return f"{name} with {', '.join(settings)}" if settings else name


def _draw(found: Check, asked: str, path: Path) -> None:
    from skydiver_utc.analysis.check_figure import check_figure
    from skydiver_utc.analysis.style import png

    path.write_bytes(png(check_figure(found, asked)))


def _show(values: dict[str, Any]) -> None:
    console = Console()
    if values["first_step"]:
        begins = f"checked from step {values['first_step']} on, where the controller began anew"
        console.print(Text(f"{begins}: the recording lacks the beginning"), soft_wrap=True)
    if sentence := reference_added(values["reference_steps_not_recorded"]):
        console.print(Text(sentence), soft_wrap=True)
    if values["equal"]:
        console.print(
            Text(f"{values['asked']}: all {values['steps']} commands are the recorded ones, bit for bit")
        )
        return
    console.print(Text(f"{values['asked']}, less what is recorded", style="bold"), soft_wrap=True)
    table = Table("control", *(Column(heading, justify="right") for heading in ("RMS", "largest", "at, s")))
    for name, of in values["controls"].items():
        table.add_row(name, f"{of['rms']:.6g}", f"{of['largest']:.6g}", f"{of['largest_at_s']:.3f}")
    console.print(table)
    first = values["first_difference"]
    then, now = first["recorded"], first["answer"]
    console.print(
        Text(
            f"{values['different_steps']} of {values['steps']} commands differ, the first at step {first['step']}"
            f" ({first['time_s']:.3f} s): {first['control']} was {then!r}, now it is {now!r}"
        ),
        soft_wrap=True,
    )
    if values["in_real_time"]:
        console.print(Text("flown in real time, where a controller does not see every state"), soft_wrap=True)

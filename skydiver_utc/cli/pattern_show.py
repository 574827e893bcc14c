# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc pattern show``: the effect of a movement pattern on a straight fall, at once and in the end."""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from skydiver_utc.cli.screen import show_tables
from skydiver_utc.cli.settings import load_skydiver
from skydiver_utc.parameters import Scenario
from skydiver_utc.plants.skydiver.linearise import linearise
from skydiver_utc.plants.skydiver.model import build_model
from skydiver_utc.plants.skydiver.steady import HeldBody, SteadyFall, straight_falls
from skydiver_utc.plants.skydiver.trim import in_straight_fall
from skydiver_utc.plants.skydiver.yaw import steady_turns

# Shares of the smallest and of the largest pattern angle that are shown.
_SHARES = np.array([1 / 3, 2 / 3, 1.0])


def show(pattern: str, scenario: str, settings: Sequence[str], as_json: bool) -> None:
    """Print accelerations and steady falls over the range of the pattern angle."""
    values = report(in_straight_fall(load_skydiver(scenario, [f"plant.pattern={pattern}", *settings])))
    if as_json:
        print(json.dumps(values, indent=2))
    else:
        _show(values)


def report(scenario: Scenario) -> dict[str, Any]:
    """What the scenario's pattern does in its posture, which must fall straight; plain data."""
    given, model = scenario.plant, build_model(scenario.plant, scenario.dt_s)
    fall = straight_falls(model)[0]
    damping = given.initial.Cm_damp_yaw
    rows = []
    for end in filter(None, given.limits.alpha):
        alphas = end * _SHARES
        for alpha, steady in zip(alphas, steady_turns(model, fall, alphas, damping), strict=True):
            held = HeldBody(model, np.array([damping, 0.0, 0.0, alpha]))
            accelerations = held.accelerations(fall.up, fall.velocity, fall.rates)
            rows.append(
                {
                    "alpha_rad": float(alpha),
                    "acceleration_m_s2": accelerations[:3].tolist(),
                    "angular_acceleration_rad_s2": accelerations[3:].tolist(),
                    "steady": None if steady is None else _of_steady(held, steady),
                }
            )
    return {
        "pattern": given.pattern.name,
        "description": given.pattern.description,
        "source": given.pattern.source,
        "posture": given.posture.name,
        "subject": given.subject.name,
        "suit": given.subject.suit.name,
        "fall_rate_m_s": fall.fall_rate,
        "Cm_damp_yaw": damping,
        "at": sorted(rows, key=lambda row: row["alpha_rad"]),
    }


def _of_steady(held: HeldBody, fall: SteadyFall) -> dict[str, Any]:
    return {
        "stable": bool(np.linalg.eigvals(linearise(held, fall)).real.max() < 0.0),
        "fall_rate_m_s": fall.fall_rate,
        "glide_angle_deg": float(np.rad2deg(fall.glide_angle)),
        "glide_direction": fall.glide_direction,
        "pitch_deg": float(np.rad2deg(fall.pitch)),
        "bank_deg": float(np.rad2deg(fall.bank)),
        "yaw_rate_deg_s": float(np.rad2deg(fall.yaw_rate)),
    }


def _show(values: dict[str, Any]) -> None:
    about = (
        f"{values['pattern']}: {values['description']}",
        values["source"],
        f"shown for posture {values['posture']}, subject {values['subject']}, suit {values['suit']}",
    )
    Console().print(*map(Text, about), sep="\n", soft_wrap=True)
    show_tables(_at_once(values["at"]), _in_the_end(values))


def _table(title: str) -> Table:
    return Table(title=Text(title), title_justify="left", title_style="bold")


def _at_once(rows: list[dict[str, Any]]) -> Table:
    table = _table("Accelerations when put in at once, body axes")
    table.add_column("alpha\nrad", justify="right")
    for name in ("surge", "sway", "heave"):
        table.add_column(f"{name}\nm/s2", justify="right")
    for name in ("roll", "pitch", "yaw"):
        table.add_column(f"{name}\nrad/s2", justify="right")
    for row in rows:
        values = (*row["acceleration_m_s2"], *row["angular_acceleration_rad_s2"])
        table.add_row(f"{row['alpha_rad']:g}", *(_number(value, 2) for value in values))
    return table


def _in_the_end(values: dict[str, Any]) -> Table:
    table = _table(f"Steady fall when held, Cm_damp_yaw = {values['Cm_damp_yaw']:g}")
    for name in (
        "alpha\nrad",
        "fall rate\nm/s",
        "glide\ndeg",
        "",
        "pitch\ndeg",
        "bank\ndeg",
        "yaw rate\ndeg/s",
        " ",
    ):
        table.add_column(name, justify="right" if name.strip() else "left")
    for row in values["at"]:
        steady = row["steady"]
        if steady is None:
            table.add_row(f"{row['alpha_rad']:g}", "not found")
        else:
            table.add_row(
                f"{row['alpha_rad']:g}",
                _number(steady["fall_rate_m_s"], 1),
                _number(steady["glide_angle_deg"], 1),
                steady["glide_direction"],
                *(_number(steady[name], 1) for name in ("pitch_deg", "bank_deg", "yaw_rate_deg_s")),
                "stable" if steady["stable"] else "unstable",
            )
    return table


def _number(value: float, digits: int) -> str:
    return f"{round(value, digits) + 0.0:.{digits}f}"

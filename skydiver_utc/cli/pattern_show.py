# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc pattern show``: the effect of a movement pattern on a straight fall, at once and in the end."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.screen import numbers, show_json_or, show_lines, show_tables, table
from skydiver_utc.cli.settings import load_skydiver

if TYPE_CHECKING:
    from rich.table import Table


@click.command(cls=options.Computing, short_help="Show the effect of PATTERN on a straight fall.")
@click.argument("pattern", metavar="PATTERN")
@options.within
@options.settings
@options.as_json
def show(pattern: str, scenario: str, settings: Sequence[str], as_json: bool) -> None:
    """Show what PATTERN does to the straight fall of a scenario's posture, at once and when it is held.

    PATTERN is a name below config/patterns, or the path of a YAML file. The posture is first moved, by as little as
    it takes, to fall straight down at the scenario's initial pitch.
    """
    from skydiver_utc.plants.skydiver.pattern_report import pattern_report
    from skydiver_utc.plants.skydiver.trim import in_straight_fall

    values = pattern_report(
        in_straight_fall(load_skydiver(scenario, [f"plant.pattern={pattern}", *settings]))
    )
    show_json_or(values, as_json, _show)


def _show(values: dict[str, Any]) -> None:
    show_lines(
        f"{values['pattern']}: {values['description']}",
        values["source"],
        f"shown for posture {values['posture']}, subject {values['subject']}, suit {values['suit']}",
    )
    show_tables(_at_once(values["at"]), _in_the_end(values))


def _at_once(rows: list[dict[str, Any]]) -> "Table":
    forces = (f">{name}\nm/s2" for name in ("surge", "sway", "heave"))
    moments = (f">{name}\nrad/s2" for name in ("roll", "pitch", "yaw"))
    made = table("Accelerations when put in at once, body axes", ">alpha\nrad", *forces, *moments)
    for row in rows:
        values = (*row["acceleration_m_s2"], *row["angular_acceleration_rad_s2"])
        made.add_row(f"{row['alpha_rad']:g}", *(numbers([value], 2) for value in values))
    return made


def _in_the_end(values: dict[str, Any]) -> "Table":
    made = table(
        f"Steady fall when held, Cm_damp_yaw = {values['Cm_damp_yaw']:g}",
        *(
            ">alpha\nrad",
            ">fall rate\nm/s",
            ">glide\ndeg",
            "",
            ">pitch\ndeg",
            ">bank\ndeg",
            ">yaw rate\ndeg/s",
            " ",
        ),
    )
    for row in values["at"]:
        steady = row["steady"]
        if steady is None:
            made.add_row(f"{row['alpha_rad']:g}", "not found")
            continue
        fall_rate, glide, *angles = (
            numbers([steady[name]], 1)
            for name in ("fall_rate_m_s", "glide_angle_deg", "pitch_deg", "bank_deg", "yaw_rate_deg_s")
        )
        stable = "stable" if steady["stable"] else "unstable"
        made.add_row(f"{row['alpha_rad']:g}", fall_rate, glide, steady["glide_direction"], *angles, stable)
    return made

# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc trim``: the straight fall of a posture, its modes and its turning."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.screen import facts, numbers, run_progress, show_json_or, show_lines, show_tables, table
from skydiver_utc.cli.settings import load_skydiver

if TYPE_CHECKING:
    from rich.table import Table

    from skydiver_utc.parameters import Scenario

# Accelerations [m/s2, rad/s2] below this are rounding errors.
_ROUNDING = 1e-12


@click.command(
    cls=options.Computing, short_help="Find the straight fall of POSTURE, its modes and its turning."
)
@click.argument("posture", metavar="[POSTURE]", required=False)
@options.within
@options.settings
@click.option(
    "--reachable", is_flag=True, help="Also find the largest amplitude of the fast turn that is tracked."
)
@options.as_json
@options.quiet
def trim(
    posture: str | None,
    scenario: str,
    settings: Sequence[str],
    reachable: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Find the straight fall of POSTURE, linearise it, and show how it turns.

    POSTURE is a name below config/postures; --set plant.subject=NAME chooses who falls. The scenario's own posture,
    which is also taken without POSTURE, is first moved, by as little as it takes, to fall straight down at the
    scenario's initial pitch; any other posture is held as it is and may glide. The fast turns of --reachable
    (0.2 Hz, UTC, about a minute of runs) start from the straight fall of the posture, moved so in either case.
    """
    from skydiver_utc.plants.skydiver.fall_report import fall_report
    from skydiver_utc.plants.skydiver.trim import in_straight_fall

    chosen = [] if posture is None else [f"plant.posture={posture}"]
    loaded = load_skydiver(scenario, [*chosen, *settings])
    if posture is None or loaded.plant.posture == load_skydiver(scenario, settings).plant.posture:
        loaded = in_straight_fall(loaded)
    values = fall_report(loaded)
    if reachable:
        values["reachable_turn_deg_s"] = _reachable(loaded, quiet)
    show_json_or(values, as_json, _show)


def _reachable(scenario: "Scenario", quiet: bool) -> int:
    from skydiver_utc.studies.reachable import reachable_amplitude, tracked

    def is_tracked(turn: "Scenario") -> bool:
        with run_progress(turn, quiet) as progress:
            return tracked(turn, progress)

    return reachable_amplitude(scenario, is_tracked)


def _show(values: dict[str, Any]) -> None:
    show_tables(_table_of_fall(values), _table_of_modes(values), _table_of_turning(values))
    if "reachable_turn_deg_s" in values:
        show_lines(f"largest fast turn that is tracked: {values['reachable_turn_deg_s']} deg/s")
    for other in values["other_falls"]:
        stable = "stable" if other["statically_stable_in_pitch"] else "unstable"
        show_lines(f"also falls {other['facing']} at {other['speed_m_s']:.1f} m/s, {stable} in pitch")


def _table_of_fall(values: dict[str, Any]) -> "Table":
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = values["inertia_kg_m2"]
    glide = numbers([values["glide_angle_deg"]], 2)
    # A glide of nothing points where rounding errors point.
    direction = f", {values['glide_direction']}" if float(glide) else ""
    made = facts(
        f"Straight fall: {values['posture']}, subject {values['subject']}, {values['facing']}",
        show_edge=False,
    )
    for row in (
        ("air density", f"{values['air_density_kg_m3']:g}", "kg/m3"),
        ("mass", f"{values['mass_kg']:.1f}", "kg"),
        ("centre of mass from mid hip", numbers(values["centre_of_mass_m"], 3), "m, head left dorsal"),
        ("inertia Ixx Iyy Izz", numbers([xx, yy, zz], 2), "kg m2"),
        ("inertia Ixy Ixz Iyz", numbers([xy, xz, yz], 2), "kg m2"),
        ("speed", f"{values['speed_m_s']:.2f}", "m/s"),
        ("fall rate", f"{values['fall_rate_m_s']:.2f}", "m/s"),
        ("glide angle", glide, f"deg{direction}"),
        ("pitch, head low", numbers([values["pitch_deg"]], 2), "deg"),
        ("left of linear acceleration", _residual(values["residual_m_s2"]), "m/s2"),
        ("left of angular acceleration", _residual(values["residual_rad_s2"]), "rad/s2"),
    ):
        made.add_row(*row)
    return made


def _table_of_modes(values: dict[str, Any]) -> "Table":
    from rich.text import Text

    made = table(f"Modes at Cm_damp_yaw = {values['Cm_damp_yaw']:g}", "mode", show_edge=False)
    for unit in ("eigenvalue\n1/s", "time\nconst. s", "frequency\nHz", "damping\nratio"):
        made.add_column(unit, justify="right", no_wrap=True)
    made.add_column("", no_wrap=True)
    keys = ("time_constant_s", "frequency_hz", "damping_ratio")
    for mode in values["modes"]:
        real, imaginary = mode["eigenvalue_1_s"]
        made.add_row(
            mode["name"],
            f"{real:.3g}" + (f" ± {imaginary:.2g}i" if imaginary else ""),
            *("" if mode[key] is None else f"{mode[key]:.3g}" for key in keys),
            Text("stable", style="green") if mode["stable"] else Text("unstable", style="red"),
        )
    return made


def _table_of_turning(values: dict[str, Any]) -> "Table":
    turning = values["turning"]
    title = f"Steady yaw rate, deg/s; at once {numbers([turning['yaw_acceleration_rad_s2']], 2)} rad/s2"
    alphas = (f">alpha\n{alpha:g} rad" for alpha in turning["alpha_rad"])
    made = table(title, ">Cm_damp_yaw", *alphas, show_edge=False)
    for row in turning["steady"]:
        rates = ("none" if rate is None else numbers([rate], 1) for rate in row["yaw_rate_deg_s"])
        made.add_row(f"{row['Cm_damp_yaw']:g}", *rates)
    return made


def _residual(value: float) -> str:
    """The residual of an acceleration; below a bound, rounding errors are not shown."""
    return f"{value:.1e}" if value >= _ROUNDING else f"< {_ROUNDING:.0e}"

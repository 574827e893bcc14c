# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc trim``: the straight fall of a posture, its modes and its turning."""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from rich.text import Text

from skydiver_utc.body.posture import configuration, posture_angles, refuse_beyond
from skydiver_utc.body.segments import build_body
from skydiver_utc.cli.screen import flight_progress, show_tables
from skydiver_utc.cli.settings import load_skydiver
from skydiver_utc.parameters import ParameterError, PosturePath, Scenario
from skydiver_utc.plants.skydiver.linearise import linearise
from skydiver_utc.plants.skydiver.model import PlantModel, build_model
from skydiver_utc.plants.skydiver.modes import Mode, modes
from skydiver_utc.plants.skydiver.steady import HeldBody, SteadyFall, straight_falls
from skydiver_utc.plants.skydiver.trim import in_straight_fall
from skydiver_utc.plants.skydiver.yaw import steady_yaw_rates, yaw_acceleration

Array = NDArray[np.float64]

# Shares of the largest pattern angle and of the largest yaw damping at which steady turns are shown.
_ALPHA_SHARES = (0.25, 0.5, 0.75, 1.0)
_DAMPING_SHARES = (1 / 12, 1 / 3, 2 / 3, 1.0)
# Accelerations [m/s2, rad/s2] below this are rounding errors.
_ROUNDING = 1e-12


def trim(
    posture: str | None,
    subject: str | None,
    scenario: str,
    settings: Sequence[str],
    reachable: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Find the straight fall and print its properties."""
    named = {"posture": posture, "subject": subject}
    chosen = [f"plant.{name}={value}" for name, value in named.items() if value is not None]
    loaded = load_skydiver(scenario, [*chosen, *settings])
    if posture is None or loaded.plant.posture == load_skydiver(scenario, settings).plant.posture:
        loaded = in_straight_fall(loaded)
    values = report(loaded)
    if reachable:
        values["reachable_turn_deg_s"] = _reachable(loaded, quiet)
    if as_json:
        print(json.dumps(values, indent=2))
    else:
        _show(values)


def _reachable(scenario: Scenario, quiet: bool) -> int:
    from skydiver_utc.cli.reachable import reachable_amplitude, tracked

    def is_tracked(turn: Scenario) -> bool:
        with flight_progress(turn, quiet) as progress:
            return tracked(turn, progress)

    return reachable_amplitude(scenario, is_tracked)


def report(scenario: Scenario) -> dict[str, Any]:
    """The straight fall of a scenario's posture and subject, plain data."""
    _check(scenario)
    plant = scenario.plant
    body, model = build_body(plant.subject), build_model(plant, scenario.dt_s)
    placed = configuration(body, posture_angles(plant.posture))
    try:
        fall, *others = straight_falls(model)
    except ParameterError as error:
        raise ParameterError(f"posture {plant.posture.name}: {error}") from error
    control = np.array([plant.initial.Cm_damp_yaw, 0.0, 0.0, 0.0])
    return {
        "posture": plant.posture.name,
        "subject": plant.subject.name,
        "scenario": scenario.name,
        "air_density_kg_m3": plant.air.density_kg_m3,
        "mass_kg": body.total_mass,
        "centre_of_mass_m": placed.centre_of_mass.tolist(),
        "inertia_kg_m2": placed.inertia.tolist(),
        "joint_angles_deg": {joint: list(row) for joint, row in plant.posture.joint_angles_deg.items()},
        **_of_fall(fall),
        "Cm_damp_yaw": plant.initial.Cm_damp_yaw,
        "modes": [_of_mode(mode) for mode in modes(linearise(HeldBody(model, control), fall), fall)],
        "other_falls": [_of_fall(other) for other in others],
        "turning": _of_turning(model, fall),
    }


def _check(scenario: Scenario) -> None:
    """Refuse what has no posture at rest at pattern angle 0, and a posture that the body cannot take."""
    plant = scenario.plant
    posture, pattern, (lowest, largest) = plant.posture, plant.pattern, plant.limits.alpha
    if isinstance(pattern, PosturePath):
        raise ParameterError(
            f"pattern {pattern.name} is a path through postures, trim needs a movement pattern: choose"
            " another --scenario, or --set plant.pattern=turn"
        )
    if not lowest <= 0.0 <= largest:
        raise ParameterError(
            f"plant.limits.alpha from {lowest:g} to {largest:g} leaves out 0, the posture at rest: widen it"
        )
    refuse_beyond(plant.subject.joint_limits, posture_angles(posture), f"posture {posture.name}")


def _of_fall(fall: SteadyFall) -> dict[str, Any]:
    return {
        "facing": fall.facing,
        "statically_stable_in_pitch": fall.pitch_stiffness > 0.0,
        "speed_m_s": fall.speed,
        "fall_rate_m_s": fall.fall_rate,
        "glide_angle_deg": float(np.rad2deg(fall.glide_angle)),
        "glide_direction": fall.glide_direction,
        "pitch_deg": float(np.rad2deg(fall.pitch)),
        "up_in_body": fall.up.tolist(),
        "velocity_in_body_m_s": fall.velocity.tolist(),
        "residual_m_s2": float(np.abs(fall.residual[:3]).max()),
        "residual_rad_s2": float(np.abs(fall.residual[3:]).max()),
    }


def _of_mode(mode: Mode) -> dict[str, Any]:
    return {
        "name": mode.name,
        "stable": mode.stable,
        "eigenvalue_1_s": [mode.eigenvalue.real, mode.eigenvalue.imag],
        "time_constant_s": mode.time_constant if np.isfinite(mode.time_constant) else None,
        "frequency_hz": mode.frequency if mode.oscillates else None,
        "damping_ratio": mode.damping_ratio if mode.oscillates else None,
        "shares": mode.shares,
    }


def _of_turning(model: PlantModel, fall: SteadyFall) -> dict[str, Any]:
    alphas = np.array(_ALPHA_SHARES) * model.control_max[3]
    rows = []
    for damping in np.array(_DAMPING_SHARES) * model.control_max[0]:
        rates = steady_yaw_rates(model, fall, alphas, float(damping))
        in_deg = [None if rate is None else float(np.rad2deg(rate)) for rate in rates]
        rows.append({"Cm_damp_yaw": float(damping), "yaw_rate_deg_s": in_deg})
    return {
        "yaw_acceleration_rad_s2": yaw_acceleration(model, fall),
        "alpha_rad": alphas.tolist(),
        "steady": rows,
    }


def _show(values: dict[str, Any]) -> None:
    console = Console()
    show_tables(_table_of_fall(values), _table_of_modes(values), _table_of_turning(values))
    if "reachable_turn_deg_s" in values:
        reached = f"largest fast turn that is tracked: {values['reachable_turn_deg_s']} deg/s"
        console.print(Text(reached), soft_wrap=True)
    for other in values["other_falls"]:
        console.print(
            Text(
                f"also falls {other['facing']} at {other['speed_m_s']:.1f} m/s,"
                f" {'' if other['statically_stable_in_pitch'] else 'un'}stable in pitch"
            ),
            soft_wrap=True,
        )


def _table(title: str, header: bool) -> Table:
    return Table(
        title=Text(title), title_justify="left", title_style="bold", show_header=header, show_edge=False
    )


def _table_of_fall(values: dict[str, Any]) -> Table:
    inertia = values["inertia_kg_m2"]
    table = _table(
        f"Straight fall: {values['posture']}, subject {values['subject']}, {values['facing']}", False
    )
    table.add_column(no_wrap=True)
    table.add_column(justify="right", overflow="fold")
    table.add_column(style="dim")
    table.add_row("air density", f"{values['air_density_kg_m3']:g}", "kg/m3")
    table.add_row("mass", f"{values['mass_kg']:.1f}", "kg")
    table.add_row(
        "centre of mass from mid hip", _numbers(values["centre_of_mass_m"], 3), "m, head left dorsal"
    )
    table.add_row("inertia Ixx Iyy Izz", _numbers([inertia[i][i] for i in range(3)], 2), "kg m2")
    table.add_row("inertia Ixy Ixz Iyz", _numbers([inertia[0][1], inertia[0][2], inertia[1][2]], 2), "kg m2")
    table.add_row("speed", f"{values['speed_m_s']:.2f}", "m/s")
    table.add_row("fall rate", f"{values['fall_rate_m_s']:.2f}", "m/s")
    glide = _numbers([values["glide_angle_deg"]], 2)
    # A glide of nothing points where rounding errors point.
    direction = f", {values['glide_direction']}" if float(glide) else ""
    table.add_row("glide angle", glide, f"deg{direction}")
    table.add_row("pitch, head low", _numbers([values["pitch_deg"]], 2), "deg")
    table.add_row("left of linear acceleration", _residual(values["residual_m_s2"]), "m/s2")
    table.add_row("left of angular acceleration", _residual(values["residual_rad_s2"]), "rad/s2")
    return table


def _table_of_modes(values: dict[str, Any]) -> Table:
    table = _table(f"Modes at Cm_damp_yaw = {values['Cm_damp_yaw']:g}", True)
    table.add_column("mode")
    for unit in ("eigenvalue\n1/s", "time\nconst. s", "frequency\nHz", "damping\nratio"):
        table.add_column(unit, justify="right", no_wrap=True)
    table.add_column("", no_wrap=True)
    for mode in values["modes"]:
        real, imaginary = mode["eigenvalue_1_s"]
        style = "green" if mode["stable"] else "red"
        table.add_row(
            mode["name"],
            f"{real:.3g}" + (f" ± {imaginary:.2g}i" if imaginary else ""),
            *(
                "" if mode[key] is None else f"{mode[key]:.3g}"
                for key in ("time_constant_s", "frequency_hz", "damping_ratio")
            ),
            Text("stable" if mode["stable"] else "unstable", style=style),
        )
    return table


def _table_of_turning(values: dict[str, Any]) -> Table:
    turning = values["turning"]
    table = _table(
        f"Steady yaw rate, deg/s; at once {_numbers([turning['yaw_acceleration_rad_s2']], 2)} rad/s2",
        True,
    )
    table.add_column("Cm_damp_yaw", justify="right")
    for alpha in turning["alpha_rad"]:
        table.add_column(f"alpha\n{alpha:g} rad", justify="right")
    for row in turning["steady"]:
        rates = ("none" if rate is None else _numbers([rate], 1) for rate in row["yaw_rate_deg_s"])
        table.add_row(f"{row['Cm_damp_yaw']:g}", *rates)
    return table


def _residual(value: float) -> str:
    """What is left of an acceleration; below a bound, rounding errors are not shown."""
    return f"{value:.1e}" if value >= _ROUNDING else f"< {_ROUNDING:.0e}"


def _numbers(values: Sequence[float], digits: int) -> str:
    return "  ".join(f"{round(value, digits) + 0.0:.{digits}f}" for value in values)

# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc stability``: linear theory of UTC around a steady fall, or on a linear plant."""

from collections.abc import Sequence
from typing import Any

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.screen import facts, show_json_or, show_lines, show_tables, table
from skydiver_utc.cli.settings import load_skydiver

_OF_BALL = {
    "radius": "radius R",
    "kept": "radius kept",
    "from_rest": "bound from rest",
    "measured": "largest distance simulated",
}


@click.command(
    cls=options.Computing, short_help="Whether UTC is stable around a steady fall, or on a linear plant."
)
@click.argument("scenario", metavar="[SCENARIO]", default="fast_turn_unknown_dynamics")
@click.option(
    "--plant", metavar="NAME|FILE.yaml", help="A linear plant instead, see config/linear_plants/admire.yaml."
)
@click.option(
    "--alpha", default=0.0, show_default=True, type=options.number, metavar="RAD",
    help="Pattern angle [rad] of the steady turn; 0: the straight fall.",
)  # fmt: skip
@click.option(
    "--steps", type=click.IntRange(1, 500), help="Prediction steps, instead of those of the settings."
)
@options.settings
@options.as_json
def stability(
    scenario: str, plant: str | None, settings: Sequence[str], alpha: float, steps: int | None, as_json: bool
) -> None:
    """Linear theory of UTC: closed-loop eigenvalues, Riccati margin, and the ball of a bounded nonlinearity.

    Around the skydiver's straight fall, or the steady turn at --alpha, of SCENARIO, which must fly UTC with held
    controls (without it: fast_turn_unknown_dynamics); or on a linear plant. Bounds of the controls are left out.
    """
    from skydiver_utc.studies.linear_theory import of_linear_plant, of_skydiver, report

    if plant is not None:
        if settings or alpha:
            raise CommandError(
                "--plant takes neither --set nor --alpha: write the numbers into the plant's file"
            )
        tuned = of_linear_plant(plant)
    else:
        tuned = of_skydiver(load_skydiver(scenario, settings), alpha)
    values = report(tuned if steps is None else tuned._replace(horizon_steps=steps))
    show_json_or(values, as_json, _show)


def _show(values: dict[str, Any]) -> None:
    from rich.text import Text

    verdict, style = ("stable", "green") if values["stable"] else ("unstable", "red")
    measured = values["measured_decay"]
    made = facts()
    rows: list[tuple[str, str | Text, str]] = [
        ("states, controls, outputs", f"{values['states']}  {values['controls']}  {values['outputs']}", ""),
        ("prediction steps", str(values["horizon_steps"]), f"of {values['dt_s']:g} s"),
        ("decay without control", f"{values['open_loop_decay']:.5f}", "per step"),
        ("control kept, 1 - K H", "  ".join(f"{v:.3f}" for v in values["control_memory"]), "per step"),
        ("growth of unseen Pu", f"{values['Pu_growth_per_step']:.2g}", "per step"),
        ("directions of rest", str(values["states_of_rest"]), "of (x, u)"),
        ("decay under UTC", Text(f"{values['decay']:.5f}", style=style), f"per step, {verdict}"),
        *([] if measured is None else [("the same, simulated", f"{measured:.5f}", "per step")]),
        ("Riccati margin, one step", f"{values['riccati_margin_one_step']:.3g}", ""),
        ("Riccati margin, all steps", f"{values['riccati_margin']:.3g}", ""),
        ("its additional term", f"{values['riccati_additional']:.3g}", "largest"),
        *(
            (_OF_BALL[key], f"{value:.4g}", f"for |f| <= {values['nonlinearity']:g}")
            for key, value in (values["ball"] or {}).items()
        ),
    ]
    for row in rows:
        made.add_row(*row)
    eigenvalues = table("")
    for heading in ("eigenvalue", "size", "time constant s"):
        eigenvalues.add_column(heading, justify="right", no_wrap=True)
    for (real, imaginary), constant in zip(values["eigenvalues"], values["time_constants_s"], strict=True):
        if imaginary >= 0.0:
            eigenvalues.add_row(
                f"{real:.4f}" + (f" ± {imaginary:.4f}i" if imaginary else ""),
                f"{abs(complex(real, imaginary)):.5f}",
                "" if constant is None else f"{constant:.3g}",
            )
    show_lines(values["plant"])
    show_tables(made, eigenvalues)

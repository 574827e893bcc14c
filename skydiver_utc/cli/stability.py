# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc stability``: linear theory of UTC around a steady fall, or on a linear plant."""

from collections.abc import Sequence

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.screen import show_values
from skydiver_utc.cli.settings import load_skydiver


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
    if not as_json:
        pairs = zip(values["eigenvalues"], values["time_constants_s"], strict=True)
        values["eigenvalues"] = [
            {
                "real": real,
                "imaginary": imaginary,
                "size": abs(complex(real, imaginary)),
                "time_constant_s": constant,
            }
            for (real, imaginary), constant in pairs
        ]
    show_values(values, as_json, "gain", "time_constants_s")

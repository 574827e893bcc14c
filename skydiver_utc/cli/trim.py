# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc trim``: the straight fall of a posture, its modes and its turning."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.screen import count_progress, show_values
from skydiver_utc.cli.settings import load_skydiver

if TYPE_CHECKING:
    from skydiver_utc.parameters import Scenario

# Of the report, only in the JSON object.
_LEFT_OUT = (
    "joint_angles_deg",
    "up_in_body",
    "velocity_in_body_m_s",
    "shares",
    "residual_m_s2",
    "residual_rad_s2",
)


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
    posture: str | None, scenario: str, settings: Sequence[str], reachable: bool, as_json: bool, quiet: bool
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
        from skydiver_utc.studies.reachable import reachable_amplitude, tracked

        def is_tracked(turn: "Scenario") -> bool:
            with count_progress(f"{turn.name}, steps", turn.steps, quiet) as progress:
                return tracked(turn, lambda step, _: progress(step))

        values["reachable_turn_deg_s"] = reachable_amplitude(loaded, is_tracked)
    show_values(values, as_json, *_LEFT_OUT)

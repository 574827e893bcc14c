# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc pattern show``: the effect of a movement pattern on a straight fall, at once and in the end."""

from collections.abc import Sequence
from operator import itemgetter

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.screen import show_values
from skydiver_utc.cli.settings import load_skydiver

# Of a pattern angle: the accelerations at once, in body axes.
_SHOWN = ("alpha_rad", "surge_m_s2", "sway_m_s2", "heave_m_s2", "roll_rad_s2", "pitch_rad_s2", "yaw_rad_s2")
_SHOWN_OF = itemgetter("alpha_rad", "acceleration_m_s2", "angular_acceleration_rad_s2", "steady")


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
    if not as_json:
        values["at"] = [
            dict(zip(_SHOWN, (angle, *moves, *turns), strict=True)) | (steady or {})
            for angle, moves, turns, steady in map(_SHOWN_OF, values["at"])
        ]
    show_values(values, as_json)

# SPDX-License-Identifier: Apache-2.0
"""What each subject can do, with each suit: ``python benchmarks/subjects.py`` prints the table of docs/model.md.

The amplitude of the fast turn is that of ``skydiver-utc trim --reachable`` (skydiver_utc/studies/reachable.py).
"""

import click

from skydiver_utc.body.posture import pattern_direction
from skydiver_utc.body.segments import build_body
from skydiver_utc.parameters import load_scenario
from skydiver_utc.plants.skydiver.model import build_model
from skydiver_utc.plants.skydiver.trim import in_posture, straight_fall
from skydiver_utc.studies.reachable import reachable_amplitude, tracked

# Subject, suit and the neutral posture for both.
ROWS = (
    ("light", "formation", "neutral_female"),
    ("light", "standard", "neutral_female_standard"),
    ("average", "formation", "neutral"),
    ("average", "standard", "neutral_standard"),
    ("heavy", "formation", "neutral"),
    ("heavy", "standard", "neutral_standard"),
)


def row(subject: str, suit: str, posture: str) -> str:
    """One line of the table in Markdown."""
    overrides: dict[str, object] = {
        "plant.subject": subject,
        "plant.subject.suit": suit,
        "plant.posture": posture,
    }
    scenario = load_scenario("bank_recovery", overrides)
    person, alpha = scenario.plant.subject, scenario.plant.limits.alpha[1]
    trim = straight_fall(scenario, scenario.plant.posture, scenario.plant.initial.pitch_deg)
    turned = trim.angles + alpha * pattern_direction(scenario.plant.pattern)
    held = in_posture(build_body(person), build_model(scenario.plant, scenario.dt_s), turned)
    yaw = held.straight_down(trim.speed, trim.pitch)[5]
    amplitude = reachable_amplitude(scenario, tracked)
    return (
        f"| `{subject}` | `{suit}` | `{posture}` | {person.mass_kg:g} | {person.height_m:.2f}"
        f" | {trim.speed:.1f} | {yaw:.1f} | {amplitude} |"
    )


@click.command(help=__doc__)
def main() -> None:
    print(
        "| subject | suit | posture | mass [kg] | height [m] | speed [m/s] | yaw [rad/s2] | fast turn [deg/s] |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for names in ROWS:
        print(row(*names))


if __name__ == "__main__":
    main()

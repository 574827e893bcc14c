"""What each subject can do, with each suit: ``python benchmarks/subjects.py`` prints the table of docs/model.md.

The fast turn is that of fast_turn_unknown_dynamics (0.2 Hz, 20 s) with other amplitudes. An amplitude is reached
when it and every smaller one is tracked: the error within 5 % of the amplitude for good from 2 s on, in steps of
10 deg/s. The damping's reference area and length are scaled with the subject's areas and height.
"""

from itertools import count

import click

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.body.posture import pattern_direction
from skydiver_utc.body.segments import area_scale, build_body
from skydiver_utc.parameters import Scenario, load_scenario
from skydiver_utc.plant.model import build_model
from skydiver_utc.plant.trim import FallingBody, straight_fall
from skydiver_utc.simulation.closed_loop import simulate

# Subject, suit and the neutral posture for both.
ROWS = (
    ("light", "formation", "neutral_female"),
    ("light", "standard", "neutral_female_standard"),
    ("average", "formation", "neutral"),
    ("average", "standard", "neutral_standard"),
    ("heavy", "formation", "neutral"),
    ("heavy", "standard", "neutral_standard"),
)
_FIRST_DEG_S, _STEP_DEG_S = 200, 10
_SETTLED_S = 2.0


def tracked(scenario: Scenario) -> bool:
    """Whether the flight converges within the time allowed."""
    values = metrics(simulate(scenario))
    since = values["convergence_time_s"]
    return values["outcome"] == "completed" and since is not None and since <= _SETTLED_S


def reached(overrides: dict[str, object]) -> int:
    """Largest amplitude [deg/s] up to which every one is tracked; 0 if not even the first."""
    for amplitude in count(_FIRST_DEG_S, _STEP_DEG_S):
        turn = overrides | {"reference.amplitude_deg_s": float(amplitude)}
        if not tracked(load_scenario("fast_turn_unknown_dynamics", turn)):
            return amplitude - _STEP_DEG_S if amplitude > _FIRST_DEG_S else 0
    raise AssertionError


def row(subject: str, suit: str, posture: str) -> str:
    """One line of the table in Markdown."""
    overrides: dict[str, object] = {"subject": subject, "subject.suit": suit, "posture": posture}
    scenario = load_scenario("fast_turn_unknown_dynamics", overrides)
    person, alpha = scenario.subject, scenario.plant.limits.alpha[1]
    trim = straight_fall(scenario, scenario.posture, scenario.initial.pitch_deg)
    falling = FallingBody(build_body(person), build_model(scenario), trim.pitch)
    yaw = falling.acceleration(trim.angles + alpha * pattern_direction(scenario.pattern), trim.speed)[5]
    damping, taller = scenario.plant.damping, person.height_m / person.suit.reference_height_m
    amplitude = reached(
        overrides
        | {
            "initial.fall_speed_m_s": trim.speed,
            "plant.damping.reference_area_m2": damping.reference_area_m2 * area_scale(person),
            "plant.damping.reference_length_m": damping.reference_length_m * taller,
        }
    )
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

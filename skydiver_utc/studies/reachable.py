# SPDX-License-Identifier: Apache-2.0
"""The largest fast turn that a subject flies.

The fast turn is that of fast_turn_unknown_dynamics (0.2 Hz, 20 s) with other amplitudes. An amplitude is reached
when it and every smaller one, from 200 deg/s on in steps of 10 deg/s, is tracked: the error within 5 % of the
amplitude for good from 2 s on. The damping's reference area and length, which are those of the scenario's own
subject, are scaled with mass and height, whatever the suit.
"""

from collections.abc import Callable
from itertools import count

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.body.segments import area_ratio
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import Scenario, load_scenario
from skydiver_utc.plants.skydiver.trim import in_straight_fall

FAST_TURN = "fast_turn_unknown_dynamics"
_FIRST_DEG_S, _STEP_DEG_S = 200, 10
_SETTLED_S = 2.0


def reachable_amplitude(scenario: Scenario, is_tracked: Callable[[Scenario], bool]) -> int:
    """Largest amplitude [deg/s] up to which every one is tracked; 0 if not even the first."""
    turn = fast_turn(scenario)
    for amplitude in count(_FIRST_DEG_S, _STEP_DEG_S):
        reference = turn.reference.replace(amplitude_deg_s=float(amplitude))
        if not is_tracked(turn.replace(name=f"{amplitude} deg/s", reference=reference)):
            return amplitude - _STEP_DEG_S if amplitude > _FIRST_DEG_S else 0
    raise AssertionError


def fast_turn(scenario: Scenario) -> Scenario:
    """The fast turn of a scenario's subject in its posture, which is first moved to fall straight."""
    falling, person = in_straight_fall(scenario), scenario.plant.subject
    turn, damping = load_scenario(FAST_TURN), scenario.plant.damping
    usual = turn.plant.subject
    scaled = damping.replace(
        reference_area_m2=damping.reference_area_m2 * area_ratio(person, usual.mass_kg, usual.height_m),
        reference_length_m=damping.reference_length_m * person.height_m / usual.height_m,
    )
    start = falling.plant.initial
    initial = turn.plant.initial.replace(fall_speed_m_s=start.fall_speed_m_s, pitch_deg=start.pitch_deg)
    return turn.replace(
        plant=scenario.plant.replace(damping=scaled, posture=falling.plant.posture, initial=initial)
    )


def tracked(scenario: Scenario, progress: Callable[[int, int], None] | None = None) -> bool:
    """Whether a flight converges within the time allowed, and stays converged."""
    values = metrics(simulate(scenario, progress))
    since = values["convergence_time_s"]
    return values["outcome"] == "completed" and since is not None and since <= _SETTLED_S

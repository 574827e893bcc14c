# SPDX-License-Identifier: Apache-2.0
"""One setting for every reference that the body can follow: ``make references`` prints the table of docs/beyond.md.

Sines of 100 to 400 deg/s and 0.05 to 0.3 Hz that ask for at most 0.95 of the body's yaw acceleration
(reachability.py), other profiles, other starts, a gust, a long flight, other subjects; flown by UTC with the paper's
setting, by UTC with fast_turn_beyond_the_paper, by Gauss-Newton predictive control with one held control, and by
path-integral control, all with the athlete or with ``--skydiver paper``.
"""

from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

import click
import reachability
from athlete import flown_by

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import Scenario, load_scenario
from skydiver_utc.studies.reachable import fast_turn

AMPLITUDES = (100, 200, 300, 400)
FREQUENCIES = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3)
BEYOND, GAUSS_NEWTON = "fast_turn_beyond_the_paper", "fast_turn_gauss_newton_held"
SETTINGS = {
    "UTC, paper": "fast_turn_unknown_dynamics",
    "UTC, beyond": BEYOND,
    "Gauss-Newton": GAUSS_NEWTON,
    "MPPI": "fast_turn_mppi",
}
LARGEST_SHARE = 0.95
# A flight with a larger RMSE [deg/s] has lost the reference.
LOST_DEG_S = 20.0
POSTURES = {"light": "neutral_female", "heavy": "neutral"}


class Case(NamedTuple):
    """What is flown: changes to a scenario, and who flies."""

    name: str
    changes: Mapping[str, Any]
    subject: str = ""
    is_turn: bool = False

    def scenario(self, name: str, skydiver: str) -> Scenario:
        """This case with the controller of a scenario."""
        scenario = load_scenario(name, flown_by(skydiver, name) | dict(self.changes))
        return scenario.replace(plant=of_subject(self.subject)) if self.subject else scenario


class Result(NamedTuple):
    """RMSE after 2 s [deg/s] and convergence time [s], None for never."""

    rmse: float
    converged: float | None

    @property
    def lost(self) -> bool:
        """Whether the reference is lost."""
        return self.rmse > LOST_DEG_S


@cache
def of_subject(subject: str) -> Any:
    """The plant of another subject in his or her own neutral posture and straight fall."""
    changes = {"plant.subject": subject, "plant.posture": POSTURES[subject]}
    return fast_turn(load_scenario("bank_recovery", changes)).plant


def cases(skydiver: str) -> list[Case]:
    """All of them, the turns first."""
    turns = load_scenario(GAUSS_NEWTON, flown_by(skydiver, GAUSS_NEWTON))
    shares = reachability.of_sines(turns, AMPLITUDES, FREQUENCIES)
    sines = [
        Case(f"{a} at {f:g} Hz", sine(a, f), is_turn=True)
        for a, row in zip(AMPLITUDES, shares, strict=True)
        for f, share in zip(FREQUENCIES, row, strict=True)
        if share <= LARGEST_SHARE
    ]
    subjects = POSTURES if skydiver == "athlete" else ()
    gust = {"kind": "gust", "speed_m_s": 10.0, "start_s": 6.0, "duration_s": 2.0}
    trapezoid = {"kind": "trapezoid", "rise_s": 1.2, "hold_s": 4.0, "start_s": 1.0}
    doublet = {"kind": "doublet", "rise_s": 1.0, "hold_s": 2.0, "start_s": 1.0}
    chirp = {"kind": "chirp", "from_hz": 0.05, "to_hz": 0.2, "duration_s": 20.0}
    random = [{"kind": "random", "to_hz": 0.2, "seed": seed} for seed in (1, 2)]
    return [
        *sines,
        Case("trapezoid 300", profile(300, trapezoid)),
        Case("doublet 250", profile(250, doublet)),
        Case("chirp 300, 0.05 to 0.2 Hz", profile(300, chirp)),
        *(Case(f"random 350 to 0.2 Hz, seed {one['seed']}", profile(350, one)) for one in random),
        *(Case(f"300 at 0.15 Hz from {p} deg", sine(300, 0.15, phase_deg=float(p))) for p in (90, 225)),
        Case("-300 at 0.1 Hz, bank of 30 deg", sine(-300, 0.1) | {"plant.initial.bank_deg": 30.0}),
        Case("300 at 0.1 Hz, gust", sine(300, 0.1) | {"disturbances": [gust]}),
        Case("400 at 0.15 Hz for 60 s", sine(400, 0.15) | {"duration_s": 60.0}),
        *(Case(f"350 at 0.15 Hz, {who}", sine(350, 0.15), who) for who in subjects),
    ]  # fmt: skip


def sine(amplitude: float, frequency: float, **further: float) -> dict[str, Any]:
    """A turn, as changes to a scenario."""
    return profile(amplitude, {"kind": "sine", "frequency_hz": frequency, **further})


def profile(amplitude: float, settings: Mapping[str, Any]) -> dict[str, Any]:
    """A reference of the yaw rate with an amplitude [deg/s], as changes to a scenario."""
    return {"reference": {**settings, "amplitude_deg_s": float(amplitude)}}


def fly(case: Case, scenario: str, skydiver: str) -> Result:
    """One flight; a run that does not reach its end is lost."""
    values = metrics(simulate(case.scenario(scenario, skydiver)))
    rmse = values["rmse_deg_s"] if values["outcome"] == "completed" else None
    return Result(float("inf") if rmse is None else rmse, values["convergence_time_s"])


def holds(case: Case, result: Result, gauss_newton: Result) -> bool:
    """A reachable turn: RMSE of at most 1 deg/s, converged within 1 s.

    Anything else: at most 1 deg/s or 1.5 times Gauss-Newton's, whichever is larger, and not lost.
    """
    if case.is_turn:
        return result.rmse <= 1.0 and result.converged is not None and result.converged <= 1.0
    return not result.lost and result.rmse <= max(1.0, 1.5 * gauss_newton.rmse)


def shown(result: Result, held: bool) -> str:
    """RMSE and convergence; bold where it does not hold."""
    if result.lost:
        return "**lost**"
    rmse = f"{result.rmse:.0f}" if result.rmse >= 10 else f"{result.rmse:.2f}"
    text = rmse if result.converged is None else f"{rmse} ({result.converged:.1f})"
    return text if held else f"**{text}**"


@click.command(help=__doc__)
@click.option("--skydiver", default="athlete", show_default=True, help="Who is flown, as plant.skydiver.")
def main(skydiver: str) -> None:
    print("| reference, deg/s | " + " | ".join(SETTINGS) + " |\n" + "|---" * (len(SETTINGS) + 1) + "|")
    held_by = dict.fromkeys(SETTINGS, 0)
    flown = cases(skydiver)
    for case in flown:
        results = {name: fly(case, scenario, skydiver) for name, scenario in SETTINGS.items()}
        held = {name: holds(case, result, results["Gauss-Newton"]) for name, result in results.items()}
        cells = [shown(result, held[name]) for name, result in results.items()]
        print(f"| {case.name} | " + " | ".join(cells) + " |", flush=True)
        for name in SETTINGS:
            held_by[name] += held[name]
    print(f"| held, of {len(flown)} | " + " | ".join(str(count) for count in held_by.values()) + " |")


if __name__ == "__main__":
    main()

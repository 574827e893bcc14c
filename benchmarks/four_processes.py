# SPDX-License-Identifier: Apache-2.0
"""Time a lockstep flight over four processes with the recorder on beside a bare loop of four: ``make bench-ros``.

The bare loop (``bare_nodes.py``) sends the same messages from plain callbacks and computes nothing. The two take
turns; a step lasts from one state to the next, by the senders' clock. Asked for: a median step of at most 1.2 times
the bare one plus the controller's solve time, and more steps a second than real time has.
"""

import json
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
from bare_nodes import Loop
from flights import BAG, SCENARIO, bare, fly
from rich.console import Console
from rich.progress import track
from timing import machine

from skydiver_utc.arrays import Array
from skydiver_utc.loop.build import build_controller, build_plant, build_reference
from skydiver_utc.parameters import Scenario, load_scenario
from skydiver_utc.parameters.nodes import ReferenceNodeSettings
from skydiver_utc.parameters.skydiver import CONTROLS as CONTROL_NAMES
from skydiver_utc.recording.reader import read_bag

_FACTOR = 1.2
_JOINT_STATES_EVERY = 10  # steps: the display rate of about 25 Hz
_STATE, _TELEMETRY = "/skydiver/state", "/skydiver/controller/telemetry"


class Turn(NamedTuple):
    """One loop from its first state to its last."""

    steps_s: Array
    solves_s: Array

    @property
    def rate_hz(self) -> float:
        """Steps a second over the whole."""
        return len(self.steps_s) / float(self.steps_s.sum())


def bare_turn(scenario: Scenario) -> Turn:
    """The bare loop."""
    loop = json.dumps(_loop(scenario))
    others = (["recorder"], ["controller", loop], ["reference", loop])
    sent_at_ns = bare(["plant", loop], others)
    return Turn(np.diff(np.array(sent_at_ns)) * 1e-9, np.empty(0))


def our_turn(scenario: Scenario) -> Turn:
    """Our nodes; the times of the steps and of the solver are those in the bag."""
    with tempfile.TemporaryDirectory(prefix="skydiver_utc_bench_") as folder:
        found = fly(scenario, "lockstep", Path(folder))
        if found["outcome"] != "completed":
            raise click.ClickException(f"the flight ended with {found['outcome']}: {found['reason']}")
        recorded = read_bag(Path(folder) / BAG, (_STATE, _TELEMETRY))
        telemetry = recorded[_TELEMETRY].readable
        solve_time = telemetry[0].name.index("solve_time")
        solves_s = np.array([message.position[solve_time] for message in telemetry])
        return Turn(np.diff(recorded[_STATE].publish_times_ns) * 1e-9, solves_s)


def _loop(scenario: Scenario) -> Loop:
    chunk_steps = ReferenceNodeSettings().chunk_steps
    plant, reference = build_plant(scenario), build_reference(scenario)
    controller = build_controller(scenario, plant, reference)
    return Loop(
        steps=scenario.steps,
        dt_ns=scenario.dt_ns,
        control_names=list(CONTROL_NAMES),
        joint_names=list(plant.joint_names),
        telemetry_names=[*controller.telemetry_names, "solve_time", "status"],
        joint_states_every=_JOINT_STATES_EVERY,
        chunk_steps=chunk_steps,
        preview_points=controller.preview_steps + 2 * chunk_steps + 1,
    )


def compare(bare_turns: list[Turn], our_turns: list[Turn], dt_s: float) -> dict[str, Any]:
    """The figures in ms and Hz, and whether they are what is asked for."""
    bare_ms, ours_ms = (
        1e3 * np.concatenate([turn.steps_s for turn in turns]) for turns in (bare_turns, our_turns)
    )
    solve_ms = 1e3 * float(np.median(np.concatenate([turn.solves_s for turn in our_turns])))
    bare_median, our_median = float(np.median(bare_ms)), float(np.median(ours_ms))
    allowed_ms = _FACTOR * bare_median + solve_ms
    rate_hz = float(np.median([turn.rate_hz for turn in our_turns]))
    return {
        "bare": {
            "steps": len(bare_ms),
            "step_ms": bare_median,
            "step_ms_p99": float(np.percentile(bare_ms, 99)),
            "rate_Hz": float(np.median([turn.rate_hz for turn in bare_turns])),
        },
        "ours": {
            "steps": len(ours_ms),
            "step_ms": our_median,
            "step_ms_p99": float(np.percentile(ours_ms, 99)),
            "rate_Hz": rate_hz,
        },
        "solve_ms": solve_ms,
        "allowed_step_ms": allowed_ms,
        "ratio": (our_median - solve_ms) / bare_median,
        "ratio_of_each_turn": [
            float((np.median(our.steps_s) - np.median(our.solves_s)) / np.median(other.steps_s))
            for other, our in zip(bare_turns, our_turns, strict=True)
        ],
        "real_time_factor": rate_hz * dt_s,
        "step_within_bar": our_median <= allowed_ms,
        "faster_than_real_time": rate_hz * dt_s > 1.0,
    }


@click.command(help=__doc__)
@click.option("--turns", default=3, show_default=True, help="How often each loop runs.")
@click.option("--duration-s", default=20.0, show_default=True, help="Simulated seconds of each turn.")
def main(turns: int, duration_s: float) -> None:
    """Let the two loops take turns; print one JSON object."""
    scenario = load_scenario(SCENARIO, {"duration_s": duration_s})
    bare_turns, our_turns = [], []
    for _ in track(range(turns), "flying", console=Console(stderr=True)):
        bare_turns.append(bare_turn(scenario))
        our_turns.append(our_turn(scenario))
    found = {"machine": machine(), **compare(bare_turns, our_turns, scenario.dt_s)}
    click.echo(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()

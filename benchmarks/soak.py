# SPDX-License-Identifier: Apache-2.0
"""Fly for long, in lockstep and in real time, and say what grew, what is missing and what was late: ``make soak``.

Each part is one flight over four processes with the recorder on. The real-time part is set beside a bare pair of
rclpy processes at the same rate, in one run: on a shared machine the ratios count. ``chrt -f 20`` before the command
shows the stack without the rest of the machine.
"""

import json
import os
import statistics
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
import yaml
from flights import BAG, SCENARIO, bare, fly

from skydiver_utc.parameters import Scenario, load_scenario
from skydiver_utc.recording.reader import read_bag

# Messages of a flight of n states, n minus this, on the topics that have one each step.
EACH_STEP = {
    "/clock": 0,
    "/skydiver/state": 0,
    "/skydiver/reference/setpoint": 0,
    "/skydiver/command": 1,
    "/skydiver/controller/telemetry": 1,
    "/skydiver/applied_command": 1,
}
ANSWERS = ("/skydiver/command", "/skydiver/controller/telemetry")  # in real time a state may have none
_WARM_UP = 60  # diagnostics, one a second
DIAGNOSTICS = "/diagnostics"
MOST_GROWTH_MB = 5.0  # of each node, after the first minute
RATE_WITHIN = 1e-3


def growth(memory: Mapping[str, list[float]]) -> dict[str, float]:
    """The most by which each node grew after its first minute, of a short run after its first quarter [MB]."""
    found = {}
    for node, sizes in memory.items():
        if len(sizes) >= 4:
            warm = sizes[min(_WARM_UP, len(sizes) // 4) :]
            found[node] = round(max(warm) - warm[0], 2)
    return found


def missing(bag: Path, report: dict[str, Any], mode: str) -> dict[str, int]:
    """Messages that the bag lacks, by topic; in real time only of topics that do not depend on answers."""
    described = yaml.safe_load((bag / "metadata.yaml").read_text(encoding="utf-8"))
    listed = described["rosbag2_bagfile_information"]["topics_with_message_count"]
    counts = {topic["topic_metadata"]["name"]: topic["message_count"] for topic in listed}
    expected = {
        name: report["states"] - fewer
        for name, fewer in EACH_STEP.items()
        if mode == "lockstep" or name not in ANSWERS
    }
    return {name: n - counts[name] for name, n in expected.items() if counts[name] < n}


def flight(scenario: Scenario, mode: str) -> dict[str, Any]:
    """A recorded flight: what the plant reported, what grew and what the bag lacks."""
    with tempfile.TemporaryDirectory(prefix="skydiver_utc_soak_") as folder:
        found = fly(scenario, mode, Path(folder))
        lacks = missing(Path(folder) / BAG, found, mode)
        memory, cpu = (diagnosed(Path(folder) / BAG, key) for key in ("memory_MB", "cpu_percent"))
    cpu_percent = {name: statistics.median(values) for name, values in cpu.items()}
    return {**found, "memory_growth_MB": growth(memory), "cpu_percent": cpu_percent, "missing": lacks}


def diagnosed(bag: Path, key: str) -> dict[str, list[float]]:
    """A number that each node published of itself, once a second."""
    said: dict[str, list[float]] = {}
    for message in read_bag(bag, [DIAGNOSTICS])[DIAGNOSTICS].readable:
        for status in message.status:
            values = {pair.key: pair.value for pair in status.values}
            said.setdefault(status.name, []).append(float(values[key]))
    return said


def lockstep(simulated_s: float) -> dict[str, Any]:
    """A long flight in lockstep."""
    found = flight(load_scenario(SCENARIO, {"duration_s": simulated_s}), "lockstep")
    rate = (found["states"] - 1) / found["wall_time_s"]
    return {"simulated_s": simulated_s, "step_rate_Hz": round(rate, 1), **found}


def real_time(duration_s: float) -> dict[str, Any]:
    """A long flight by the clock, between two halves of as many steps of a bare pair of processes."""
    scenario = load_scenario(SCENARIO, {"duration_s": duration_s})
    before = bare_pair(duration_s / 2, scenario.dt_s)
    found = flight(scenario, "real_time")
    after = bare_pair(duration_s / 2, scenario.dt_s)
    pair = {name: before[name] + after[name] for name in before}
    account = found["real_time"]
    return {
        "duration_s": duration_s,
        "nominal_rate_Hz": round(1.0 / scenario.dt_s, 3),
        "ping_pong": pair,
        "late_steps_percent": percent(account["late_steps"], account["steps"]),
        "late_ping_pong_percent": percent(pair["late"], pair["count"]),
        "late_answers_percent": percent(account["steps"] - account["on_time"], account["steps"]),
        **found,
    }


def bare_pair(duration_s: float, dt_s: float) -> dict[str, int]:
    """The ping-pong of ``bare_nodes.py`` in two processes of its own."""
    result: dict[str, int] = bare(["ping", str(duration_s), str(dt_s)], [["pong"]])
    return result


def percent(part: int, whole: int) -> float:
    """Part of a whole in percent."""
    return round(100.0 * part / max(1, whole), 3)


def bars(report: Mapping[str, Any]) -> dict[str, bool]:
    """Whether each bar is met by the parts that were flown; a growth that was not measured is none."""
    found: dict[str, bool] = {}
    for part in ("lockstep", "real_time"):
        if part in report:
            flight = report[part]
            growth = flight["memory_growth_MB"]
            found[f"{part}: completed"] = flight["outcome"] == "completed"
            found[f"{part}: no message missing in the bag"] = not flight["missing"]
            found[f"{part}: no node grew by {MOST_GROWTH_MB:g} MB"] = bool(growth) and all(
                megabytes < MOST_GROWTH_MB for megabytes in growth.values()
            )
    if "real_time" in report:
        flight = report["real_time"]
        account, pair, nominal = flight["real_time"], flight["ping_pong"], flight["nominal_rate_Hz"]
        found["real_time: average rate within 0.1 %"] = (
            abs(account["rate_Hz"] - nominal) <= RATE_WITHIN * nominal
        )
        found["real_time: late steps at most twice those of the bare pair"] = (
            account["late_steps"] * pair["count"] <= 2 * pair["late"] * account["steps"]
        )
    return found


@click.command()
@click.option(
    "--lockstep-s", default=1800.0, show_default=True, help="Simulated seconds in lockstep; 0: none."
)
@click.option("--real-time-s", default=600.0, show_default=True, help="Seconds in real time; 0: none.")
def main(lockstep_s: float, real_time_s: float) -> None:
    """Fly for long; one JSON object says what grew, what is missing, what was late, and which bars are met.

    The exit code is 1 where one is missed.
    """
    result: dict[str, Any] = {"load_average": os.getloadavg()}
    if lockstep_s > 0.0:
        result["lockstep"] = lockstep(lockstep_s)
    if real_time_s > 0.0:
        result["real_time"] = real_time(real_time_s)
    result["bars"] = bars(result)
    click.echo(json.dumps(result, indent=2))
    sys.exit(0 if all(result["bars"].values()) else 1)


if __name__ == "__main__":
    main()

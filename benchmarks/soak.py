"""Fly for long, in lockstep and in real time, and say what grew, what is missing and what was late: ``make soak``.

Each part is one flight over four processes with the recorder on. The real-time part is set beside a bare pair of
rclpy processes at the same rate and beside the wake-ups of a process that only sleeps, all in one run: on a shared
machine the ratios count. ``chrt -f 20`` before the command shows the stack without the rest of the machine.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import click
import yaml
from ping_pong import paced_lateness

from skydiver_utc.parameters import Scenario, load_scenario, to_yaml
from skydiver_utc.verbs.node_processes import (
    CONTROLLER,
    PLANT,
    RECORDER,
    REFERENCE,
    NodeProcesses,
    Parameters,
)
from skydiver_utc.verbs.ros_environment import node_environment

SCENARIO = "fast_turn_unknown_dynamics"
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
_WARM_UP_S = 60.0
_BARE_S = 60.0


def fly(scenario: Scenario, mode: str, folder: Path) -> dict[str, Any]:
    """One flight; what the plant reported last, the memory of each node over time, what the bag lacks."""
    with NodeProcesses(node_environment(os.environ), folder) as nodes:
        resolved = folder / "scenario.yaml"
        resolved.write_text(to_yaml(scenario), encoding="utf-8")
        bag = folder / "bag"
        common: Parameters = {"scenario": str(resolved), "wait_for_recorder": True}
        nodes.start(RECORDER, {"scenario": str(resolved), "bag_folder": str(bag)})
        nodes.start(CONTROLLER, common | {"mode": mode})
        nodes.start(REFERENCE, common)
        nodes.start(PLANT, common | {"mode": mode, "progress": True})
        memory: list[tuple[float, dict[str, float]]] = []
        report: dict[str, Any] = {}
        while not nodes.ended(PLANT):
            for line in nodes.reports():
                report = line
            if report and (not memory or time.monotonic() - memory[-1][0] > 1.0):
                memory.append((time.monotonic(), resident_mb(nodes.pids())))
        nodes.end()
    return {**report, "memory_growth_MB": growth(memory), "missing": missing(bag, report, mode)}


def resident_mb(pids: dict[str, int]) -> dict[str, float]:
    """Resident memory of each process that still runs [MB]."""
    sizes = {}
    for kind, pid in pids.items():
        try:
            pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
        except (OSError, IndexError):
            continue
        if pages:  # a process that has ended but was not waited for has none
            sizes[kind] = pages * os.sysconf("SC_PAGESIZE") / 1e6
    return sizes


def growth(memory: list[tuple[float, dict[str, float]]]) -> dict[str, float]:
    """The most by which each node grew after its first minute, of a short run after its first quarter [MB]."""
    if len(memory) < 4:
        return {}
    began, ended = memory[0][0], memory[-1][0]
    warm = began + min(_WARM_UP_S, (ended - began) / 4)
    after = [sizes for at, sizes in memory if at >= warm]
    return {
        kind: round(max(sizes.get(kind, 0.0) for sizes in after) - size, 2) for kind, size in after[0].items()
    }


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


def lockstep(simulated_s: float) -> dict[str, Any]:
    """A long flight in lockstep."""
    scenario = load_scenario(SCENARIO, {"duration_s": simulated_s})
    with tempfile.TemporaryDirectory(prefix="skydiver_utc_soak_") as folder:
        told = fly(scenario, "lockstep", Path(folder))
    rate = (told["states"] - 1) / told["wall_time_s"]
    return {"simulated_s": simulated_s, "step_rate_Hz": round(rate, 1), **told}


def real_time(duration_s: float) -> dict[str, Any]:
    """A long flight by the clock, after a bare pair of processes and a process that only sleeps."""
    scenario = load_scenario(SCENARIO, {"duration_s": duration_s})
    bare = bare_pair(min(_BARE_S, duration_s), scenario.dt_s)
    with tempfile.TemporaryDirectory(prefix="skydiver_utc_soak_") as folder:
        told = fly(scenario, "real_time", Path(folder))
    account = told["real_time"]
    sleeping = paced_lateness(min(_BARE_S, duration_s), scenario.dt_s, lambda: None)
    return {
        "duration_s": duration_s,
        "nominal_rate_Hz": round(1.0 / scenario.dt_s, 3),
        "late_steps_percent": percent(account["late_steps"], account["steps"]),
        "late_ping_pong_percent": percent(bare["late"], bare["count"]),
        "late_answers_percent": percent(account["steps"] - account["on_time"], account["steps"]),
        "late_pongs_percent": percent(bare["unanswered"], bare["count"]),
        "wake_up_ms_p99": 1e3 * statistics.quantiles(sleeping, n=100)[-1],
        "late_wake_ups_percent": percent(sum(late > scenario.dt_s for late in sleeping), len(sleeping)),
        **told,
    }


def bare_pair(duration_s: float, dt_s: float) -> dict[str, Any]:
    """The ping-pong of ``ping_pong.py`` in two processes of its own."""
    environment = node_environment(os.environ)
    script = str(Path(__file__).with_name("ping_pong.py"))
    with subprocess.Popen([sys.executable, script, "pong"], env=environment) as pong:
        try:
            command = [sys.executable, script, "ping", str(duration_s), str(dt_s)]
            done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        finally:
            pong.terminate()
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result


def percent(part: int, whole: int) -> float:
    """Part of a whole in percent."""
    return round(100.0 * part / max(1, whole), 3)


@click.command()
@click.option(
    "--lockstep-s", default=1800.0, show_default=True, help="Simulated seconds in lockstep; 0: none."
)
@click.option("--real-time-s", default=600.0, show_default=True, help="Seconds in real time; 0: none.")
def main(lockstep_s: float, real_time_s: float) -> None:
    """Fly for long; one JSON object says what grew, what is missing and what was late."""
    result: dict[str, Any] = {"load_average": os.getloadavg()}
    if lockstep_s > 0.0:
        result["lockstep"] = lockstep(lockstep_s)
    if real_time_s > 0.0:
        result["real_time"] = real_time(real_time_s)
    click.echo(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()

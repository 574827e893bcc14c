# SPDX-License-Identifier: Apache-2.0
"""One flight over four processes with the recorder on, and the bare nodes beside it."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from skydiver_utc.cli.node_processes import (
    CONTROLLER,
    PLANT,
    RECORDER,
    REFERENCE,
    NodeProcesses,
    Parameters,
)
from skydiver_utc.cli.ros_environment import node_environment
from skydiver_utc.parameters import Scenario, to_yaml

SCENARIO = "fast_turn_unknown_dynamics"
BAG = "bag"  # where a flight is recorded, in its folder
_LONGEST_FLIGHT_S = 600.0
_GRACE_S = 10.0  # for a bare node to end when it is found to


def fly(scenario: Scenario, mode: str, folder: Path) -> dict[str, Any]:
    """One flight; what the plant reported last."""
    with NodeProcesses(node_environment(os.environ), folder) as nodes:
        resolved = folder / "scenario.yaml"
        resolved.write_text(to_yaml(scenario), encoding="utf-8")
        common: Parameters = {"scenario": str(resolved), "wait_for_recorder": True}
        nodes.start(RECORDER, {"scenario": str(resolved), "out": str(folder / BAG)})
        nodes.start(CONTROLLER, common | {"mode": mode})
        nodes.start(REFERENCE, common)
        nodes.start(PLANT, common | {"mode": mode, "progress": True})
        return outcome_of(nodes)


def outcome_of(nodes: NodeProcesses) -> dict[str, Any]:
    """What the plant reported last, once plant and recorder have ended; RuntimeError where the run does not end."""
    report: dict[str, Any] = {}
    deadline = time.monotonic() + _LONGEST_FLIGHT_S
    while not nodes.ended(PLANT) and time.monotonic() < deadline:
        for line in nodes.reports():
            report = line
    if "outcome" not in report:
        said = "".join(
            f"\n{kind}:{nodes.last_lines(kind)}" for kind in (RECORDER, CONTROLLER, REFERENCE, PLANT)
        )
        raise RuntimeError(f"the flight has no outcome; the nodes said{said}")
    nodes.exit_code(RECORDER)
    return report


def bare(leader: Sequence[str], others: Sequence[Sequence[str]]) -> Any:
    """Run nodes of ``bare_nodes.py`` until the leader ends; what it printed, from JSON."""
    environment = node_environment(os.environ)
    with _running([_command(other) for other in others], environment):
        done = subprocess.run(_command(leader), env=environment, capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def _command(arguments: Sequence[str]) -> list[str]:
    return [sys.executable, str(Path(__file__).with_name("bare_nodes.py")), *arguments]


@contextmanager
def _running(commands: Sequence[list[str]], environment: dict[str, str]) -> Iterator[None]:
    processes = [subprocess.Popen(command, env=environment) for command in commands]
    try:
        yield
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            try:
                process.wait(_GRACE_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

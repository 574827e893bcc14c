"""``skydiver-utc run``: the flight over ROS 2, each node a process, recorded and analysed."""

import os
import re
import tempfile
from collections.abc import Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import NamedTuple

import click

from skydiver_utc.analysis.errors import AnalysisError
from skydiver_utc.parameters import Scenario, to_yaml
from skydiver_utc.recording.errors import RecordingError
from skydiver_utc.recording.metadata import METADATA_FILE, message_count
from skydiver_utc.verbs.errors import VerbError
from skydiver_utc.verbs.node_processes import (
    CONTROLLER,
    PLANT,
    RECORDER,
    REFERENCE,
    NodeProcesses,
    Parameters,
    interruptible,
)
from skydiver_utc.verbs.ros_environment import node_environment, require_rclpy
from skydiver_utc.verbs.screen import Progressed, flight_progress
from skydiver_utc.verbs.settings import load
from skydiver_utc.verbs.simulate import exit_code

_FAILED = 1
_READY = "[skydiver.recorder]: ready"  # its log line when it hears everything
_STOPPED = 130


class Pace(NamedTuple):
    """Lockstep or real time, and by how many steps the controller predicts the state ahead."""

    real_time: bool = False
    delay_steps: int = 0


def run(
    scenario_name: str,
    settings: Sequence[str],
    bags: Path,
    folder: Path | None,
    as_json: bool,
    quiet: bool,
    pace: Pace,
) -> int:
    """Fly, record, print the metrics; returns the exit code."""
    scenario = load(scenario_name, settings)
    folder = folder or new_run_folder(bags, scenario)
    check_place(folder)
    require_rclpy()
    environment = node_environment(os.environ)
    if not quiet:
        click.echo(f"recording into {folder}, on ROS domain {environment['ROS_DOMAIN_ID']}", err=True)
    with interruptible():
        try:
            _fly(scenario, folder, environment, quiet, pace)
        except KeyboardInterrupt:
            click.echo(f"stopped: {_whereabouts(folder)}", err=True)
            return _STOPPED
    return _analyse(folder, as_json)


def new_run_folder(bags: Path, scenario: Scenario) -> Path:
    """``<bags>/<YYYYMMDDTHHMMSSZ>_<scenario>``, numbered if there is one of this second already."""
    name = re.sub(r"[^\w.-]+", "_", scenario.name)
    first = bags / f"{datetime.now(timezone.utc):%Y%m%dT%H%M%SZ}_{name}"
    folder, number = first, 1
    while folder.exists():
        number += 1
        folder = first.with_name(f"{first.name}_{number}")
    return folder


def check_place(folder: Path) -> None:
    """Refuse, before any node starts, a run folder that cannot be made."""
    if folder.exists():
        raise VerbError(f"{folder} exists already: name another run folder, or move this one away")
    folder.parent.mkdir(parents=True, exist_ok=True)
    if not os.access(folder.parent, os.W_OK):
        raise VerbError(
            f"nothing can be written into {folder.parent}: choose another place for the run folder"
        )


def _fly(scenario: Scenario, folder: Path, environment: dict[str, str], quiet: bool, pace: Pace) -> None:
    """Start the nodes, follow the flight to its end, end the nodes."""
    with (
        tempfile.TemporaryDirectory(prefix="skydiver_utc_") as scratch,
        NodeProcesses(environment, Path(scratch)) as nodes,
    ):
        resolved = Path(scratch) / "scenario.yaml"
        resolved.write_text(to_yaml(scenario), encoding="utf-8")
        mode = "real_time" if pace.real_time else "lockstep"
        common: Parameters = {"scenario": str(resolved), "wait_for_recorder": True}
        nodes.start(RECORDER, {"scenario": str(resolved), "bag_folder": str(folder.absolute())})
        nodes.start(CONTROLLER, common | {"mode": mode, "delay_steps": pace.delay_steps})
        nodes.start(REFERENCE, common)
        nodes.start(PLANT, common | {"mode": mode, "progress": True})
        with flight_progress(scenario, quiet) as progress:
            failed = _follow(nodes, progress)
        nodes.end()
        if failed:
            raise VerbError(
                f"the {failed} node failed ({nodes.ending(failed)}), {_whereabouts(folder)}"
                + nodes.last_lines(failed),
                _FAILED,
            )
        if nodes.failed() == RECORDER:
            raise VerbError(
                f"the flight went on to its end, but its recorder failed ({nodes.ending(RECORDER)}):"
                f" {_whereabouts(folder)}" + nodes.last_lines(RECORDER),
                _FAILED,
            )


def _follow(nodes: NodeProcesses, progress: Progressed) -> str | None:
    """Show the plant's reports until it ends; the node that failed, None if none did.

    A recorder that was ready, and fails later, does not stop a flight.
    """
    told_outcome = False
    recorded = True
    while True:
        for report in nodes.reports():
            if "step" in report:
                progress(report["step"], report["steps"])
            told_outcome = told_outcome or "outcome" in report
        failed = nodes.failed() if recorded else nodes.failed(RECORDER)
        if failed == RECORDER and nodes.has_said(RECORDER, _READY):
            click.echo("the recorder has ended, the flight goes on without a recording", err=True)
            recorded = False
        elif failed and not told_outcome:
            return failed
        if nodes.ended(PLANT):
            return None if told_outcome else PLANT


def _whereabouts(folder: Path) -> str:
    if (folder / METADATA_FILE).is_file():
        if message_count(folder) == 0:
            return f"nothing was recorded yet, {folder} can be deleted"
        return f"the recording so far is in {folder}, `skydiver-utc analyse {folder}` looks at it"
    if folder.is_dir():
        return f"the recording has no end, `skydiver-utc recover {folder}` saves what is there"
    return "nothing was recorded"


def _analyse(folder: Path, as_json: bool) -> int:
    from skydiver_utc.verbs.analyse import analyse

    try:
        flight = analyse(folder, as_json)
    except (AnalysisError, RecordingError) as error:
        raise VerbError(f"the flight has ended but cannot be analysed: {error}", _FAILED) from error
    if not as_json:
        click.echo(str(folder))
    return exit_code(flight)

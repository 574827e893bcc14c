"""``skydiver-utc run``: the flight over ROS 2, each node a process, recorded and analysed."""

import json
import os
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import click

from skydiver_utc.analysis.errors import AnalysisError
from skydiver_utc.parameters import to_yaml
from skydiver_utc.recording.errors import RecordingError
from skydiver_utc.recording.metadata import METADATA_FILE, message_count
from skydiver_utc.verbs.divers import Diver, divers
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
from skydiver_utc.verbs.screen import Progressed, flights_progress
from skydiver_utc.verbs.simulate import exit_code

_FAILED = 1
_STOPPED = 130


class Pace(NamedTuple):
    """Lockstep or real time, and by how many steps the controller predicts the state ahead."""

    real_time: bool = False
    delay_steps: int = 0


def run(
    scenarios: Sequence[str],
    settings: Sequence[str],
    bags: Path,
    folder: Path | None,
    as_json: bool,
    quiet: bool,
    pace: Pace,
) -> int:
    """Fly, record, print the metrics; returns the exit code."""
    flying = divers(scenarios, settings, bags, folder)
    require_rclpy()
    environment = node_environment(os.environ)
    if not quiet:
        places = ", ".join(str(diver.folder) for diver in flying)
        click.echo(f"recording into {places}, on ROS domain {environment['ROS_DOMAIN_ID']}", err=True)
    with interruptible():
        try:
            _fly(flying, environment, quiet, pace)
        except KeyboardInterrupt:
            for diver in flying:
                click.echo(f"stopped: {_whereabouts(diver.folder)}", err=True)
            return _STOPPED
    return _analyse(flying, as_json)


class _Flight:
    """The nodes of one skydiver, and what its plant has reported."""

    def __init__(self, diver: Diver, nodes: NodeProcesses, progress: Progressed) -> None:
        self.diver, self.nodes = diver, nodes
        self.failed: str | None = None  # the node that ended the flight, or left it without an outcome
        self._progress = progress
        self._told_outcome = False
        self._recorded = True

    def start(self, scenario: Path, pace: Pace, of_plant: Parameters) -> None:
        """Start the four nodes; `of_plant` adds to the parameters of the plant."""
        common: Parameters = {"scenario": str(scenario), "wait_for_recorder": True}
        mode: Parameters = {"mode": "real_time" if pace.real_time else "lockstep"}
        bag = str(self.diver.folder.absolute())
        self.nodes.start(RECORDER, {"scenario": str(scenario), "bag_folder": bag})
        self.nodes.start(CONTROLLER, common | mode | {"delay_steps": pace.delay_steps})
        self.nodes.start(REFERENCE, common)
        self.nodes.start(PLANT, common | mode | {"progress": True} | of_plant)

    def goes_on(self) -> bool:
        """Show the plant's reports; False when the flight has ended, or a node has `failed`.

        A recorder that was ready, and fails later, does not stop a flight.
        """
        for report in self.nodes.reports():
            if "step" in report:
                self._progress(report["step"], report["steps"])
            self._told_outcome = self._told_outcome or "outcome" in report
        failed = self.nodes.failed() if self._recorded else self.nodes.failed(RECORDER)
        if failed == RECORDER and self.nodes.has_said(RECORDER, f"[{self.diver.name}.recorder]: ready"):
            click.echo("the recorder has ended, the flight goes on without a recording", err=True)
            self._recorded = False
        elif failed and not self._told_outcome:
            self.failed = failed
            return False
        if not self.nodes.ended(PLANT):
            return True
        self.failed = None if self._told_outcome else PLANT
        return False

    def refuse_failure(self, others: Sequence[Diver]) -> None:
        """Say which node failed and where the recordings are; `others` were stopped with it."""
        place, nodes = _whereabouts(self.diver.folder), self.nodes
        whose = f" of {self.diver.name}" if others else ""
        if failed := self.failed:
            places = [place, *(f"of {other.name}: {_whereabouts(other.folder)}" for other in others)]
            raise VerbError(
                f"the {failed} node{whose} failed ({nodes.ending(failed)}), {'; '.join(places)}"
                + nodes.last_lines(failed),
                _FAILED,
            )
        if nodes.failed() == RECORDER:
            raise VerbError(
                f"the flight{whose} went on to its end, but its recorder failed ({nodes.ending(RECORDER)}):"
                f" {place}" + nodes.last_lines(RECORDER),
                _FAILED,
            )


def _fly(flying: Sequence[Diver], environment: Mapping[str, str], quiet: bool, pace: Pace) -> None:
    """Start the nodes, follow the flights to their ends, end the nodes.

    Of several skydivers the first one's plant has the clock, the others follow it.
    """
    with ExitStack() as stack:
        scratch = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="skydiver_utc_")))
        nodes = [_nodes(stack, diver, environment, scratch) for diver in flying]
        with flights_progress({diver.name: diver.scenario for diver in flying}, quiet) as bars:
            flights = [_Flight(*each, bars[each[0].name]) for each in zip(flying, nodes, strict=True)]
            for flight in flights:
                leads: Parameters = {"followers": len(flights) - 1}
                scenario = scratch / flight.diver.name / "scenario.yaml"
                flight.start(scenario, pace, leads if flight is flights[0] else {"clock": "follow"})
            going = flights
            while going and not any(flight.failed for flight in flights):
                going = [flight for flight in going if flight.goes_on()]
        for its in reversed(nodes):
            its.end()
        for flight in flights:
            flight.refuse_failure([diver for diver in flying if diver is not flight.diver])


def _nodes(stack: ExitStack, diver: Diver, environment: Mapping[str, str], scratch: Path) -> NodeProcesses:
    folder = scratch / diver.name
    folder.mkdir()
    (folder / "scenario.yaml").write_text(to_yaml(diver.scenario), encoding="utf-8")
    return stack.enter_context(NodeProcesses(environment, folder, diver.name))


def _whereabouts(folder: Path) -> str:
    if (folder / METADATA_FILE).is_file():
        if message_count(folder) == 0:
            return f"nothing was recorded yet, {folder} can be deleted"
        return f"the recording so far is in {folder}, `skydiver-utc analyse {folder}` looks at it"
    if folder.is_dir():
        return f"the recording has no end, `skydiver-utc recover {folder}` saves what is there"
    return "nothing was recorded"


def _analyse(flying: Sequence[Diver], as_json: bool) -> int:
    """Analyse each run; of several, one JSON object by name."""
    from skydiver_utc.verbs.analyse import analyse, examine

    code = 0
    by_name: dict[str, Any] = {}
    for diver in flying:
        try:
            if as_json and len(flying) > 1:
                flight, by_name[diver.name] = examine(diver.folder)
            else:
                flight = analyse(diver.folder, as_json)
        except (AnalysisError, RecordingError) as error:
            raise VerbError(f"the flight has ended but cannot be analysed: {error}", _FAILED) from error
        if not as_json:
            click.echo(str(diver.folder))
        code = max(code, exit_code(flight))
    if by_name:
        click.echo(json.dumps(by_name, indent=2))
    return code

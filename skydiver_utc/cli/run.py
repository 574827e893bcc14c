# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc run``: runs over ROS 2, each node a process, recorded and analysed."""

import json
import os
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.node_processes import (
    CONTROLLER,
    ESTIMATOR,
    PLANT,
    RECORDER,
    REFERENCE,
    NodeProcesses,
    Parameters,
    interruptible,
)
from skydiver_utc.cli.planned_runs import PlannedRun, planned_runs
from skydiver_utc.cli.ros_environment import node_environment, require_rclpy
from skydiver_utc.cli.simulate import exit_code
from skydiver_utc.errors import FAILED, STOPPED, AnalysisError, RecordingError

if TYPE_CHECKING:
    from skydiver_utc.cli.run_status import RunStatus


@click.command(epilog=options.EXIT_CODES, short_help="Run SCENARIO over ROS 2, recorded.")
@click.argument("scenarios", metavar="[NAME=]SCENARIO...", nargs=-1, required=True)
@options.settings
@click.option(
    "--out", "folder", type=options.PATH, metavar="FOLDER",
    help="The run folder, instead of a new one below bags/.",
)  # fmt: skip
@click.option("--real-time", is_flag=True, help="Step by the clock instead of waiting for each command.")
@click.option(
    "--delay-steps", default=0, show_default=True, type=click.IntRange(0, 50),
    help="Let the controller predict the state so many steps ahead; a real-time command acts one step later.",
)  # fmt: skip
@options.as_json
@options.quiet
def run(
    scenarios: Sequence[str],
    settings: Sequence[str],
    folder: Path | None,
    real_time: bool,
    delay_steps: int,
    as_json: bool,
    quiet: bool,
) -> int:
    """Run SCENARIO over ROS 2, recorded.

    Several scenarios run side by side, each in a namespace with its own clock topic and its own run folder. NAME is
    the namespace, as in anna=turn_360_left; without it: skydiver, skydiver_2 and so on.

    Starts all nodes of the scenario and a recorder as processes of their own, on a ROS domain of its own
    unless ROS_DOMAIN_ID is set. The run folder holds the bag, the scenario, metrics.json, tracking.png and
    report.html.
    """
    require_rclpy()
    environment = node_environment(os.environ)
    planned = planned_runs(scenarios, settings, folder)
    if not quiet:
        places = ", ".join(str(each.folder) for each in planned)
        click.echo(f"recording into {places}, on ROS domain {environment['ROS_DOMAIN_ID']}", err=True)
    waiting: Parameters = {"wait_for_recorder": True, "mode": "real_time" if real_time else "lockstep"}
    with interruptible():
        try:
            _run(planned, environment, quiet, waiting, delay_steps)
        except KeyboardInterrupt:
            for each in planned:
                click.echo(f"stopped: {recording_state(each.folder)}", err=True)
            return STOPPED
        finally:
            with suppress(OSError):  # only a folder into which nothing was recorded is empty
                (planned[0].folder if len(planned) == 1 else planned[0].folder.parent).rmdir()
    return _analyse(planned, as_json)


class _NodesOfRun:
    """The nodes of one run, and the reports of its plant."""

    def __init__(self, planned: PlannedRun, nodes: NodeProcesses, status: "RunStatus") -> None:
        self.planned, self.nodes = planned, nodes
        self.failed: str | None = None  # the node whose failure ended the run
        self._status = status
        self._began = self._outcome = False
        self._recorder_reported = False

    def start(self, scenario: Path, waiting: Parameters, delay_steps: int) -> None:
        """Start the nodes; `waiting` are the parameters of all but the recorder."""
        common: Parameters = {"scenario": str(scenario)}
        waiting = common | waiting
        self.nodes.start(RECORDER, common | {"out": str(self.planned.folder.absolute())})
        self.nodes.start(CONTROLLER, waiting | {"delay_steps": delay_steps})
        if self.planned.scenario.has_estimator:
            self.nodes.start(ESTIMATOR, waiting)
        self.nodes.start(REFERENCE, waiting)
        self.nodes.start(PLANT, waiting | {"progress": True})

    def running(self) -> bool:
        """Show the plant's reports; False at the end, or when a node has `failed`; after step 0 a recorder may."""
        for report in self.nodes.reports():
            self._began = self._began or "step" in report
            self._status.show(self.planned.name, report)
            self._outcome = self._outcome or "outcome" in report
        failed = self.nodes.failed(RECORDER) if self._began else self.nodes.failed()
        if failed and not self._outcome:
            self.failed = failed
            return False
        if self.nodes.failed() == RECORDER and not self._recorder_reported:
            self._recorder_reported = True
            click.echo(f"the recorder of {self.planned.name} failed, the run continues unrecorded", err=True)
        if not self.nodes.ended(PLANT):
            return True
        self.failed = None if self._outcome else PLANT
        return False

    def raise_failure(self, others: Sequence[PlannedRun]) -> None:
        """Raise the failure of a node, with its last lines; `others` were stopped by it."""
        name, place, nodes = self.planned.name, recording_state(self.planned.folder), self.nodes
        failed = self.failed or (RECORDER if nodes.failed() == RECORDER else None)
        if failed is None:
            return
        sentence = (
            f"the run {name} reached its end, but its recorder failed ({nodes.ending(failed)}): {place}"
        )
        if self.failed:
            places = [place, *(f"of {other.name}: {recording_state(other.folder)}" for other in others)]
            sentence = f"the {failed} node of {name} failed ({nodes.ending(failed)}), {'; '.join(places)}"
        raise CommandError("\n    ".join([sentence, *nodes.last_lines(failed)]), FAILED)


def _run(
    planned: Sequence[PlannedRun],
    environment: Mapping[str, str],
    quiet: bool,
    waiting: Parameters,
    delay_steps: int,
) -> None:
    """Start the nodes, follow the runs to their ends, end the nodes."""
    from skydiver_utc.cli.run_status import RunStatus
    from skydiver_utc.parameters import to_yaml

    with ExitStack() as stack:
        scratch = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="skydiver_utc_")))
        status = stack.enter_context(RunStatus({run.name: run.scenario for run in planned}, quiet))
        runs = []
        for each in planned:
            folder = scratch / each.name
            folder.mkdir()
            scenario = folder / "scenario.yaml"
            scenario.write_text(to_yaml(each.scenario), encoding="utf-8")
            own_clock = len(planned) > 1
            nodes = NodeProcesses(environment, folder, each.name, own_clock, each.module_folder)
            runs.append(_NodesOfRun(each, stack.enter_context(nodes), status))
            runs[-1].start(scenario, waiting, delay_steps)
        running = runs
        while running and not any(run.failed for run in runs):
            running = [run for run in running if run.running()]
        for run in runs:
            run.nodes.end()
        for run in runs:
            run.raise_failure([other for other in planned if other is not run.planned])


def recording_state(folder: Path) -> str:
    """The files of a run folder, and the command that reads them."""
    from skydiver_utc.recording.metadata import METADATA_FILE, message_count

    if (folder / METADATA_FILE).is_file():
        if message_count(folder) == 0:
            return f"nothing was recorded yet, {folder} can be deleted"
        return f"the recording so far is in {folder}, `skydiver-utc analyse {folder}` evaluates it"
    if any(folder.glob("*.mcap")):
        return f"the recording is unfinished, `skydiver-utc recover {folder}` completes it"
    return "nothing was recorded"


def _analyse(planned: Sequence[PlannedRun], as_json: bool) -> int:
    """Analyse each run; of several, print one JSON object by name."""
    from skydiver_utc.cli.analyse import examine, show

    code = 0
    by_name: dict[str, Any] = {}
    for each in planned:
        try:
            flight, by_name[each.name] = examine(each.folder)
        except (AnalysisError, RecordingError) as error:
            raise CommandError(f"the run has ended but cannot be analysed: {error}", FAILED) from error
        if len(planned) == 1 or not as_json:
            show(flight, by_name[each.name], as_json)
        if not as_json:
            click.echo(str(each.folder))
        code = max(code, exit_code(flight))
    if as_json and len(planned) > 1:
        click.echo(json.dumps(by_name, indent=2))
    return code

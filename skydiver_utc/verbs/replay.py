"""``skydiver-utc replay``: a recorded run published again by a node of its own."""

import os
import signal
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from skydiver_utc.recording.reader import read_bag
from skydiver_utc.verbs.errors import VerbError
from skydiver_utc.verbs.keyboard import keys
from skydiver_utc.verbs.node_processes import PLAYER, NodeProcesses, interruptible
from skydiver_utc.verbs.ros_environment import node_environment, require_rclpy

_STOPPED = 130
_PAUSE_KEY = " "


def replay(
    folder: Path, rate: float, start_s: float, loop: bool, paused: bool, topics: Sequence[str], quiet: bool
) -> int:
    """Play the run to its end, or until it is interrupted; returns the exit code."""
    require_rclpy()
    read_bag(folder)
    # Others are to hear it: the caller's domain, not one of its own as for a flight.
    environment = node_environment({**os.environ, "ROS_DOMAIN_ID": os.environ.get("ROS_DOMAIN_ID") or "0"})
    place = f"{folder} on ROS domain {environment['ROS_DOMAIN_ID']}"
    parameters: dict[str, str | bool | float | list[str]] = {
        "run": str(folder.absolute()),
        "rate": rate,
        "start_s": start_s,
        "loop": loop,
        "paused": paused,
        "attended": True,
    }
    if topics:
        parameters["topics"] = list(topics)
    with (
        interruptible(),
        tempfile.TemporaryDirectory(prefix="skydiver_utc_") as scratch,
        NodeProcesses(environment, Path(scratch)) as nodes,
    ):
        try:
            nodes.start(PLAYER, parameters)
            with keys() as pressed, _progress(quiet) as show:
                not_sent = _follow(nodes, pressed, show, "" if quiet else f"playing {place}")
        except KeyboardInterrupt:
            click.echo("stopped", err=True)
            return _STOPPED
        if nodes.ending(PLAYER) != "exit code 0":
            raise VerbError(f"the recording cannot be played: {_reason(nodes.last_lines(PLAYER))}")
    if not_sent:
        told = ", ".join(f"{count} on {name}" for name, count in not_sent.items())
        click.echo(f"not sent because they are no messages of their topic's type: {told}", err=True)
    return 0


def _reason(last_lines: str) -> str:
    """What the player said last, without its name."""
    *_, last = last_lines.strip().splitlines() or ["it said nothing"]
    return last.strip().removeprefix("player_node: ")


def _follow(
    nodes: NodeProcesses, pressed: Callable[[], str], show: Callable[[dict[str, Any]], None], told: str
) -> dict[str, int]:
    """Until the player ends; how many messages of which topics it could not send."""
    listens = False  # only a player that reports takes the signal, another one would end of it
    not_sent: dict[str, int] = {}
    while not nodes.ended(PLAYER):
        for report in nodes.reports():
            if told and not listens:
                click.echo(f"{told}; the space bar pauses and goes on, Ctrl-C ends", err=True)
            listens = True
            not_sent = report["not_sent"]
            show(report)
        if pressed().count(_PAUSE_KEY) % 2 and listens:
            nodes.send(PLAYER, signal.SIGUSR1)
    return not_sent


@contextmanager
def _progress(quiet: bool) -> Iterator[Callable[[dict[str, Any]], None]]:
    """A bar that follows the player's reports; none when quiet or when stderr is no terminal."""
    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield lambda _report: None
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.1f} of {task.total:.1f} s{task.fields[lap]}"),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("getting ready", total=0.0, lap="")

        def show(report: dict[str, Any]) -> None:
            bar.update(
                task,
                description="paused " if report["paused"] else "playing",
                completed=report["position_s"],
                total=report["duration_s"],
                lap=f", lap {report['lap'] + 1}" if report["lap"] else "",
            )

        yield show

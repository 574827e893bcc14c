# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc replay``: a recorded run published again by the player node, or its controller checked."""

import os
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.check import check as check_controller
from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.node_processes import PLAYER, NodeProcesses, Parameters, interruptible
from skydiver_utc.cli.ros_environment import node_environment, require_rclpy
from skydiver_utc.errors import STOPPED

_CHECK_EXIT_CODES = """\b
exit code of --check
    0  every command is the recorded one
    1  some are not
    2  the input is wrong: one sentence says why
"""
_POLL_S = 0.1


@click.command(epilog=_CHECK_EXIT_CODES, short_help="Play a recorded run again, or check its controller.")
@options.run_folder
@click.option(
    "--rate", type=options.number, metavar="X", help="Speed, in simulated seconds per second.  [default: 1]"
)
@click.option(
    "--start", type=options.number, metavar="S", help="Begin this many seconds after the first message."
)
@click.option("--loop", is_flag=True, help="Begin again at the end, until interrupted.")
@click.option(
    "--topics",
    metavar="NAME,...",
    help="Only these topics, and /clock; relative names are in the recorded namespace.",
)
@click.option("--check", is_flag=True, help="Compare the controller's commands with the recorded ones.")
@click.option(
    "--controller", metavar="SCENARIO", help="With --check: the controller of this scenario instead."
)
@options.settings
@click.option(
    "--figure",
    type=options.PATH,
    metavar="FILE.png",
    help="With --check: draw both commands into this PNG, SVG or PDF file.",
)
@options.as_json
@options.quiet
def replay(
    folder: Path,
    check: bool,
    controller: str | None,
    settings: Sequence[str],
    figure: Path | None,
    as_json: bool,
    **of_player: Any,
) -> int:
    """Play the recorded run RUN again over ROS 2, or check its controller.

    Publishes the recorded messages in order, byte for byte, with /clock, on ROS_DOMAIN_ID (0 unless set) of this
    machine.

    --check plays nothing and needs no ROS: it feeds the recorded states and reference to the controller of the
    recorded scenario and prints the first command that is not the recorded one, bit for bit. With --controller or
    --set it computes the commands of another controller at these states.
    """
    of_check = {"controller": controller, "set": settings, "figure": figure, "json": as_json}
    of_others = of_player if check else of_check
    if given := [name for name, value in of_others.items() if value not in (None, False, ())]:
        raise click.UsageError(f"--{given[0]} does not go {'with' if check else 'without'} --check")
    if check:
        options.report_compilation()
        return check_controller(folder, controller, settings, figure, as_json)
    return _play(folder, **of_player)


def _play(
    folder: Path, rate: float | None, start: float | None, loop: bool, topics: str | None, quiet: bool
) -> int:
    """Play the run to its end, or until Ctrl-C; returns the exit code."""
    from skydiver_utc.recording.reader import bag_files

    names = [] if topics is None else [name.strip() for name in topics.split(",")]
    if not all(names):
        raise CommandError(f"--topics {topics!r} has an empty name: write them as in state,command")
    require_rclpy()
    bag_files(folder)
    # Others subscribe to it: on the caller's domain, where `run` takes a free one.
    environment = node_environment(os.environ, domain="0")
    parameters: Parameters = {"run": str(folder.absolute()), "loop": loop}
    given = {"rate": rate, "start_s": start, "topics": names or None}
    parameters |= {name: value for name, value in given.items() if value is not None}
    with (
        interruptible(),
        tempfile.TemporaryDirectory(prefix="skydiver_utc_") as scratch,
        NodeProcesses(environment, Path(scratch)) as nodes,
    ):
        try:
            nodes.start(PLAYER, parameters)
            if not quiet:
                domain = environment["ROS_DOMAIN_ID"]
                click.echo(f"playing {folder} on ROS domain {domain}; Ctrl-C stops", err=True)
            while not nodes.ended(PLAYER):
                time.sleep(_POLL_S)
        except KeyboardInterrupt:
            click.echo("stopped", err=True)
            return STOPPED
        lines = [line.removeprefix("player_node: ") for line in nodes.last_lines(PLAYER)]
        if code := nodes.exit_code(PLAYER):
            reason = lines[-1] if lines else nodes.ending(PLAYER)
            raise CommandError(f"the recording cannot be played: {reason}", max(1, code))
        for line in lines:
            if "[WARN]" in line:
                click.echo(line, err=True)
    return 0

# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc replay``: a recorded run published again by the player node."""

import os
import tempfile
import time
from pathlib import Path

import click

from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.node_processes import PLAYER, NodeProcesses, Parameters, interruptible
from skydiver_utc.cli.ros_environment import node_environment, require_rclpy
from skydiver_utc.parameters.exit_codes import STOPPED
from skydiver_utc.recording.reader import bag_files

_POLL_S = 0.1


def replay(
    folder: Path, rate: float | None, start: float | None, loop: bool, topics: str | None, quiet: bool
) -> int:
    """Play the run to its end, or until Ctrl-C; returns the exit code."""
    names = [] if topics is None else [name.strip() for name in topics.split(",")]
    if not all(names):
        raise CommandError(f"--topics {topics!r} has an empty name: write them as in state,command")
    require_rclpy()
    bag_files(folder)
    # Others subscribe to it: on the caller's domain, where `run` takes a free one.
    environment = node_environment({**os.environ, "ROS_DOMAIN_ID": os.environ.get("ROS_DOMAIN_ID") or "0"})
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

# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc replay``: a recorded run published again by the player node."""

import os
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import click

from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.node_processes import PLAYER, NodeProcesses, Parameters, interruptible
from skydiver_utc.cli.ros_environment import node_environment, require_rclpy
from skydiver_utc.parameters.exit_codes import STOPPED
from skydiver_utc.recording.reader import read_bag

_POLL_S = 0.1


def replay(folder: Path, rate: float, start_s: float, loop: bool, topics: Sequence[str], quiet: bool) -> int:
    """Play the run to its end, or until Ctrl-C; returns the exit code."""
    require_rclpy()
    read_bag(folder)
    # Others subscribe to it: on the caller's domain, where `run` takes a free one.
    environment = node_environment({**os.environ, "ROS_DOMAIN_ID": os.environ.get("ROS_DOMAIN_ID") or "0"})
    parameters: Parameters = {"run": str(folder.absolute()), "rate": rate, "start_s": start_s, "loop": loop}
    if topics:
        parameters["topics"] = list(topics)
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

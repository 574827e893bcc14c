# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc view``: runs, or a flight as it goes on, in a browser."""

import os
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.ros_environment import node_environment, require_rclpy
from skydiver_utc.cli.settings import load

if TYPE_CHECKING:
    from skydiver_utc.view.live_page import Page


@click.command(
    cls=options.Computing, short_help="Show runs, or a flight that you change as it goes on, in a browser."
)
@click.argument("runs", metavar="[RUN...]", nargs=-1, type=options.PATH)
@click.option(
    "--live", metavar="SCENARIO", help="Fly this scenario in real time; its settings become sliders."
)
@click.option(
    "--ros",
    metavar="NAMESPACE",
    help="Show and change the flight over ROS in this namespace, such as skydiver.",
)
@options.settings
@click.option(
    "--port", default=8080, show_default=True, type=click.IntRange(1, 65535),
    help="Where the page is served; the next free one if it is taken.",
)  # fmt: skip
def view(runs: Sequence[Path], live: str | None, ros: str | None, settings: Sequence[str], port: int) -> None:
    """Show the run folders RUN side by side in a browser, or a flight as it goes on, here or over ROS.

    The page has the body in 3-D, the forces on its segments, the wind and its path, and charts of the signals. It is
    served to browsers of this machine only; its address is printed.
    """
    if bool(runs) + (live is not None) + (ros is not None) != 1:
        raise CommandError("give either run folders, or --live SCENARIO, or --ros NAMESPACE")
    if live is None and settings:
        raise CommandError("--set changes a scenario: it goes with --live only")
    with suppress(KeyboardInterrupt), ExitStack() as stack:
        page = _page(runs, live, settings, port) if ros is None else _page_over_ros(ros, port, stack)
        click.echo(f"the page is at {page.address}, Ctrl-C ends it", err=True)
        page.run()


def _page(runs: Sequence[Path], live: str | None, settings: Sequence[str], port: int) -> "Page":
    from skydiver_utc.analysis.recorded_run import read_run
    from skydiver_utc.view.live_controls import LivePage, RunsPage
    from skydiver_utc.view.live_flight import LiveFlight
    from skydiver_utc.view.recorded_flight import RecordedFlight

    if live is not None:
        return LivePage(LiveFlight(load(live, settings)), port)
    return RunsPage([RecordedFlight(read_run(path), path.absolute().name) for path in runs], port)


def _page_over_ros(namespace: str, port: int, stack: ExitStack) -> "Page":
    require_rclpy()
    # Started by others: on their domain, where `run` takes a free one and prints it.
    os.environ.update(node_environment(os.environ, domain="0"))
    from skydiver_utc.nodes.observed_run import ObservedRun
    from skydiver_utc.view.live_controls import LivePage
    from skydiver_utc.view.ros_flight import RosFlight

    click.echo(f"waiting for {namespace} on ROS domain {os.environ['ROS_DOMAIN_ID']}", err=True)
    node = ObservedRun(namespace)
    stack.callback(node.close)
    return LivePage(RosFlight(node), port)

# SPDX-License-Identifier: Apache-2.0
"""Two machines and a network between them that delays and loses, made of namespaces on one machine."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from machines import Conditions, Machine, ping, two_machines, why_not
from network import MULTICAST, STATIC_PEERS, TwoMachines, belly_to_earth, equals_simulation

from skydiver_utc.analysis.recorded_run import read_run

pytestmark = [
    pytest.mark.processes,
    pytest.mark.long,
    pytest.mark.skipif(bool(why_not()), reason=why_not() or "-"),
]

BAD = Conditions(delay_ms=5.0, jitter_ms=1.0, loss=0.02)
LOSSY = BAD._replace(loss=0.1)
LOCALHOST = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
PATIENCE_S = 300.0


@pytest.fixture
def conditions() -> Conditions:
    return BAD


@pytest.fixture
def machines(conditions: Conditions) -> Iterator[tuple[Machine, Machine]]:
    with two_machines(conditions) as both:
        yield both


def flown(run: TwoMachines) -> dict[str, object]:
    try:
        return run.outcome(PATIENCE_S)
    finally:
        run.end()


def test_the_link_delays_and_loses(machines: tuple[Machine, Machine]) -> None:
    """Of 400 datagrams there and back some 16 are lost: none, or 60, would be one in a million."""
    reported = ping(*machines, 400)
    assert reported["round_trip_ms_min"] >= 2 * (BAD.delay_ms - BAD.jitter_ms)
    assert 0 < reported["sent"] - reported["came_back"] < 60


@pytest.mark.parametrize(
    ("conditions", "discovery"),
    [(BAD, STATIC_PEERS), (LOSSY, MULTICAST)],
    ids=["static peers", "a tenth lost"],
)
def test_lockstep_over_a_bad_network_is_the_simulated_flight(
    machines: tuple[Machine, Machine], tmp_path: Path, discovery: dict[str, str]
) -> None:
    reported = flown(TwoMachines(machines, tmp_path, "lockstep", 1.0, discovery))
    assert reported["outcome"] == "completed"
    flight = read_run(tmp_path / "bag")
    assert len(flight.commands) == flight.scenario.steps
    assert equals_simulation(flight)


@pytest.mark.parametrize("conditions", [LOSSY], ids=["a tenth lost"])
def test_real_time_over_a_bad_network_stays_belly_to_earth(
    machines: tuple[Machine, Machine], tmp_path: Path
) -> None:
    """Every step is accounted for; the commands come back over the network."""
    run = TwoMachines(machines, tmp_path, "real_time", 3.0)
    reported = flown(run)
    account = reported["real_time"]
    assert isinstance(account, dict)
    flight = read_run(tmp_path / "bag")
    assert reported["states"] == account["steps"] + 1 == flight.scenario.steps + 1
    assert sum(account[kind] for kind in ("on_time", "late", "stale", "lost")) == account["steps"]
    # No answer can come within one step, the way there and back takes two: unless the machine held the plant up.
    assert account["on_time"] <= 2 + account["late_steps"]
    assert account["late"] > 0
    assert belly_to_earth(flight)


def test_nodes_confined_to_their_machine_do_not_find_each_other(
    machines: tuple[Machine, Machine], tmp_path: Path
) -> None:
    """The default: the plant on the one machine gives up, because the controller is on the other."""
    patience = {"startup_timeout_s": 8.0, "wait_for_recorder": False}
    reported = flown(TwoMachines(machines, tmp_path, "lockstep", 1.0, LOCALHOST, plant=patience))
    assert reported["outcome"] == "no_command"
    assert "command" in str(reported["reason"])

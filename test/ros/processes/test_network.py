# SPDX-License-Identifier: Apache-2.0
"""Two machines and a network between them that delays and loses, made of namespaces on one machine."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from machines import Conditions, Machine, ping, two_machines, why_not
from network import STATIC_PEERS, belly_to_earth, equals_simulation, fly_over

from skydiver_utc.analysis.recorded_run import read_run

pytestmark = [
    pytest.mark.processes,
    pytest.mark.long,
    pytest.mark.skipif(bool(why_not()), reason=why_not() or "-"),
]

CONDITIONS = Conditions(delay_ms=5.0, jitter_ms=1.0, loss=0.1)


@pytest.fixture
def machines() -> Iterator[tuple[Machine, Machine]]:
    with two_machines(CONDITIONS) as both:
        yield both


def test_the_link_delays_and_loses(machines: tuple[Machine, Machine]) -> None:
    """Of 400 datagrams there and back some 76 are lost, within five standard deviations."""
    reported = ping(*machines, 400)
    assert reported["round_trip_ms_min"] >= 2 * (CONDITIONS.delay_ms - CONDITIONS.jitter_ms)
    assert 36 < reported["sent"] - reported["came_back"] < 116


def test_lockstep_over_a_bad_network_with_static_peers_is_the_simulated_flight(
    machines: tuple[Machine, Machine], tmp_path: Path
) -> None:
    reported = fly_over(machines, tmp_path, "lockstep", 0.5, STATIC_PEERS)
    assert reported["outcome"] == "completed"
    flight = read_run(tmp_path / "bag")
    assert len(flight.commands) == flight.scenario.steps
    assert equals_simulation(flight)


def test_real_time_over_a_bad_network_stays_belly_to_earth(
    machines: tuple[Machine, Machine], tmp_path: Path
) -> None:
    """Found by multicast; every step is accounted for, and the commands come back over the network."""
    reported = fly_over(machines, tmp_path, "real_time", 3.0)
    account = reported["real_time"]
    flight = read_run(tmp_path / "bag")
    assert reported["states"] == account["steps"] + 1 == flight.scenario.steps + 1
    assert sum(account[kind] for kind in ("on_time", "late", "stale", "lost")) == account["steps"]
    # No answer can come within one step, the way there and back takes two: unless the machine held the plant up.
    assert account["on_time"] <= 2 + account["late_steps"]
    assert account["late"] > 0
    assert belly_to_earth(flight)

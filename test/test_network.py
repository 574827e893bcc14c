"""Two machines and a network between them that delays and loses, made of namespaces on one machine."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from machines import Conditions, Machine, ping, two_machines, why_not
from network import MULTICAST, STATIC_PEERS, Run, belly_to_earth, equals_simulation

from skydiver_utc.analysis.recorded_flight import read_flight

pytestmark = pytest.mark.skipif(bool(why_not()), reason=why_not() or "-")

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


def flown(run: Run) -> dict[str, object]:
    try:
        return run.outcome(PATIENCE_S)
    finally:
        run.end()


def test_the_link_delays_and_loses(machines: tuple[Machine, Machine]) -> None:
    """Of 400 datagrams there and back some 16 are lost: none, or 60, would be one in a million."""
    told = ping(*machines, 400)
    assert told["round_trip_ms_min"] >= 2 * (BAD.delay_ms - BAD.jitter_ms)
    assert 0 < told["sent"] - told["came_back"] < 60


@pytest.mark.parametrize(
    ("conditions", "discovery"),
    [(BAD, MULTICAST), (BAD, STATIC_PEERS), (LOSSY, MULTICAST)],
    ids=["multicast", "static peers", "a tenth lost"],
)
def test_lockstep_over_a_bad_network_is_the_simulated_flight(
    machines: tuple[Machine, Machine], tmp_path: Path, discovery: dict[str, str]
) -> None:
    told = flown(Run(machines, tmp_path, "lockstep", 1.0, discovery))
    assert told["outcome"] == "completed"
    flight = read_flight(tmp_path / "bag")
    assert len(flight.commands) == flight.scenario.steps
    assert equals_simulation(flight)


@pytest.mark.parametrize("conditions", [BAD, LOSSY], ids=["two in a hundred lost", "a tenth lost"])
def test_real_time_over_a_bad_network_stays_belly_to_earth(
    machines: tuple[Machine, Machine], tmp_path: Path
) -> None:
    """Every step is accounted for; the commands come back over the network."""
    run = Run(machines, tmp_path, "real_time", 3.0)
    told = flown(run)
    account = told["real_time"]
    assert isinstance(account, dict)
    flight = read_flight(tmp_path / "bag")
    assert told["states"] == account["steps"] + 1 == flight.scenario.steps + 1
    assert sum(account[kind] for kind in ("on_time", "late", "stale", "lost")) == account["steps"]
    # No answer can come within one step, the way there and back takes two: unless the machine held the plant up.
    assert account["on_time"] <= 2 + account["late_steps"]
    assert account["late"] > 0
    assert belly_to_earth(flight)


def test_nodes_that_stay_on_their_machine_do_not_hear_each_other(
    machines: tuple[Machine, Machine], tmp_path: Path
) -> None:
    """The default: the plant on the one machine gives up, because the controller is on the other."""
    patience = {"startup_timeout_s": 8.0, "wait_for_recorder": False}
    told = flown(Run(machines, tmp_path, "lockstep", 1.0, LOCALHOST, plant=patience))
    assert told["outcome"] == "no_command"
    assert "no publisher of command" in str(told["reason"])

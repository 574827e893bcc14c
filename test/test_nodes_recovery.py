"""A recorder that is killed at random moments of a flight: what is recovered, counted against what was sent.

``SKYDIVER_UTC_KILLS=20``, which is `make kills`, makes it twenty kills, tells each loss, and holds it to half a
second of the clock on the wall.
"""

import os
import signal
import time
from pathlib import Path

import msgspec
import numpy as np
import pytest
from ros_fixtures import Processes, Ros
from rosbags.rosbag2 import Reader
from test_nodes_flight import Bag, RecordedFlight

from skydiver_utc.analysis.recorded_flight import read_flight
from skydiver_utc.nodes import topics
from skydiver_utc.simulation.closed_loop import simulate
from skydiver_utc.simulation.outcome import Outcome
from skydiver_utc.verbs.recover import recover

pytest_plugins = ("ros_fixtures",)

KILLS = int(os.environ.get("SKYDIVER_UTC_KILLS", "2"))
LONG = "SKYDIVER_UTC_KILLS" in os.environ
LARGEST_LOSS_S = 0.5


@pytest.mark.parametrize("seed", range(KILLS))
def test_a_recorder_killed_at_any_moment_leaves_all_but_its_last_moments(
    ros: Ros, processes: Processes, tmp_path: Path, capsys: pytest.CaptureFixture[str], seed: int
) -> None:
    wait_s = float(np.random.default_rng(seed).uniform(0.0, 3.0))
    flight = RecordedFlight(ros, processes, tmp_path / "run", 600.0)
    flight.until_step(10)
    (file,) = (tmp_path / "run").glob("*.mcap")
    sent_at_s: dict[int, float] = {}

    def noted(condition: bool) -> bool:
        sent_at_s.setdefault(flight.plant.k, time.monotonic())
        return condition

    ros.spin_until(lambda: noted(file.stat().st_size > 10_000))
    kill_at_s = time.monotonic() + wait_s
    ros.spin_until(lambda: noted(time.monotonic() >= kill_at_s))
    flight.recorder.signal(signal.SIGKILL)
    killed_at_s, sent = time.monotonic(), flight.plant.k + 1
    assert flight.recorder.wait() == -signal.SIGKILL
    flight.until_step(sent + 100)
    assert not flight.plant.finished

    folder = tmp_path / "recovered"
    recover(tmp_path / "run", folder, as_json=False)
    told = capsys.readouterr().out
    steps = Bag(folder).steps(topics.STATE)
    assert steps == list(range(len(steps)))
    assert 0 < len(steps) <= sent
    with Reader(folder) as reader:
        assert sum(1 for _ in reader.messages()) == reader.message_count
        assert f"recovered {reader.message_count} messages" in told

    back = read_flight(folder)
    assert back.outcome is Outcome.ABORTED
    flown = len(back.commands)
    short = simulate(msgspec.structs.replace(back.scenario, duration_s=flown * back.scenario.dt_s))
    assert back.states.tobytes() == short.states[: flown + 1].tobytes()
    assert back.commands.tobytes() == short.commands[:flown].tobytes()

    # How long before the kill the first state was sent that is not there.
    loss_s = killed_at_s - sent_at_s[len(steps)] if len(steps) < sent else 0.0
    if LONG:
        with capsys.disabled():
            print(f"\nkill {seed}: {len(steps)} of {sent} states recovered, the last {loss_s:.3f} s lost")
        assert loss_s <= LARGEST_LOSS_S

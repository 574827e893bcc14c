"""What the nodes say about themselves once a second, and that it holds nothing up."""

import os
import re
import resource
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from ros_fixtures import Ros, overrides

from skydiver_utc.nodes import topics
from skydiver_utc.nodes.bag_recorder import RecorderNode
from skydiver_utc.nodes.diagnostics import Health, Level, ProcessUsage, Rate, diagnostic_message, memory_mb
from skydiver_utc.nodes.lockstep_controller import ControllerNode
from skydiver_utc.nodes.lockstep_plant import PlantNode
from skydiver_utc.nodes.messages import NamedValuesWriter
from skydiver_utc.nodes.preview_publisher import ReferenceNode
from skydiver_utc.nodes.stamps import StepGrid
from skydiver_utc.parameters import load_scenario
from skydiver_utc.plant.skydiver import CONTROL_NAMES

pytest_plugins = ("ros_fixtures",)


def values_of(message: Any) -> dict[str, str]:
    (status,) = message.status
    return {pair.key: pair.value for pair in status.values}


def newest(heard: list[Any]) -> dict[str, Any]:
    return {message.status[0].name: message for message in heard}


def test_a_message_has_the_stamp_of_its_step_and_every_value_as_text() -> None:
    scenario = load_scenario("fast_turn_unknown_dynamics")
    health = Health(Level.WARN, "so so", {"rate": 2.5, "count": 3})
    message = diagnostic_message(StepGrid(scenario), 7, "plant", "/skydiver", health)
    (status,) = message.status
    stamp = message.header.stamp
    assert stamp.sec * 10**9 + stamp.nanosec == scenario.stamp_ns(7)
    assert (status.level, status.name, status.message) == (DiagnosticStatus.WARN, "skydiver/plant", "so so")
    assert values_of(message) == {"rate": "2.5", "count": "3"}


def test_before_the_first_step_the_stamp_is_that_of_step_0() -> None:
    scenario = load_scenario("fast_turn_unknown_dynamics")
    message = diagnostic_message(StepGrid(scenario), -1, "plant", "/", Health(Level.OK, "", {}))
    assert message.header.stamp.sec == scenario.epoch_s


def test_usage_and_rate_are_those_since_the_last_reading() -> None:
    usage, rate = ProcessUsage(), Rate()
    before_s = resource.getrusage(resource.RUSAGE_SELF).ru_utime
    while resource.getrusage(resource.RUSAGE_SELF).ru_utime - before_s < 0.1:
        pass
    told = usage.read()
    assert 0.0 < float(str(told["cpu_percent"])) < 110.0
    assert float(str(told["cpu_s"])) >= 0.1
    assert float(rate.read(500)) > 0.0
    assert float(rate.read(500)) == 0.0
    assert float(rate.read(3)) == 0.0


def test_memory_is_what_the_system_says() -> None:
    kilobytes = next(
        int(line.split()[1]) for line in Path(f"/proc/{os.getpid()}/status").read_text().splitlines()
        if line.startswith("VmRSS")
    )  # fmt: skip
    assert memory_mb() == pytest.approx(kilobytes * 1024 / 1e6, rel=0.05)


def test_every_node_tells_how_it_is_and_the_bag_has_it(ros: Ros, tmp_path: Path) -> None:
    heard = ros.partner("watcher").hear(topics.DIAGNOSTICS)
    given = overrides(600.0, wait_for_recorder=True)
    recorder = RecorderNode(ros.context, overrides(600.0, bag_folder=str(tmp_path / "bag")))
    nodes = [
        ros.add(recorder),
        *(ros.add(kind(ros.context, given)) for kind in (PlantNode, ReferenceNode, ControllerNode)),
    ]
    plant = nodes[1]
    ros.spin_until(lambda: len(newest(heard)) == 4 and plant.k > 10)
    for node in nodes:
        node.publish_diagnostics()
    ros.spin_until(lambda: "step" in values_of(newest(heard)["skydiver/plant"]))
    ros.spin_until(lambda: int(values_of(newest(heard)["skydiver/controller"])["answered_step"]) > 5)
    told = newest(heard)
    assert {m.status[0].level for m in told.values()} == {DiagnosticStatus.OK}
    assert values_of(told["skydiver/plant"])["publishers_of_command"] == "1"
    assert "last_status" in values_of(told["skydiver/controller"])
    for message in told.values():
        assert set(values_of(message)) >= {"cpu_percent", "cpu_s", "memory_MB", "last_refusal"}
    plant.close()
    ros.spin_until(lambda: recorder.finished)
    ros.spin_for(0.2)
    recorder.drain()
    assert recorder._channels[topics.DIAGNOSTICS].count >= 4
    recorder.close()


def test_what_a_node_refused_is_told(ros: Ros) -> None:
    node = ros.add(PlantNode(ros.context, overrides()))
    heard = ros.partner("watcher").hear(topics.DIAGNOSTICS)
    node.k = 0
    bad = NamedValuesWriter(node.grid, CONTROL_NAMES).fill(0, np.array([np.nan, 0, 0, 0]))
    node.on_command(bad)
    node.on_command(bad)
    node.k = -1

    def told() -> dict[str, str]:
        return values_of(heard[-1]) if heard else {}

    ros.spin_until(lambda: told().get("refused_finite") == "2")
    assert "Cm_damp_yaw is nan" in told()["last_refusal"]


def test_a_flight_without_commands_is_an_error(ros: Ros) -> None:
    node = ros.add(PlantNode(ros.context, overrides(startup_timeout_s=0.1)))
    ros.spin_until(lambda: node.finished)
    health = node.health()
    assert health.level is Level.ERROR
    assert "no publisher of command" in health.sentence


def test_two_publishers_of_command_are_an_error(ros: Ros) -> None:
    node = ros.add(PlantNode(ros.context, overrides()))
    for name in ("first", "second"):
        ros.partner(name).sends(topics.COMMAND)
    ros.spin_until(lambda: node.health().level is Level.ERROR)
    assert "2 publishers of command" in node.health().sentence


def test_a_controller_that_hears_no_more_states_says_so(ros: Ros, monkeypatch: pytest.MonkeyPatch) -> None:
    node = ros.add(ControllerNode(ros.context, overrides()))
    assert node.health().level is Level.OK  # nothing to do yet
    node.answered = 5
    node._new_state_at -= 7.0
    node._preview.add(0, np.zeros(500))
    monkeypatch.setattr(node, "unmatched", list)
    health = node.health()
    assert health.level is Level.WARN
    assert re.search(r"no new state after step 5 for \d+\.\d s", health.sentence)
    node.answered = node.scenario.steps - 1
    assert node.health().level is Level.OK

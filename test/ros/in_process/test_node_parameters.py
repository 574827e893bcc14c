# SPDX-License-Identifier: Apache-2.0
"""The parameters of the nodes through their services: what `ros2 param dump` writes can be loaded again."""

from pathlib import Path
from typing import Any

import pytest
import yaml
from own_slots import cart_file
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from ros_fixtures import Ros

from skydiver_utc.loop.tuned_scenario import plain
from skydiver_utc.nodes.node import ScenarioNode

pytest_plugins = ("ros_fixtures",)


class Client:
    """The parameter services of one node."""

    def __init__(self, ros: Ros, node: ScenarioNode) -> None:
        self._ros = ros
        self._client = AsyncParameterClient(ros.partner("ros2_param"), f"/skydiver/{node.get_name()}")
        ros.spin_until(self._client.services_are_ready)

    def result(self, service: str, *arguments: Any) -> Any:
        future = getattr(self._client, service)(*arguments)
        self._ros.spin_until(future.done)
        return future.result()

    def dump(self) -> dict[str, Any]:
        """Name and value of each parameter, as they come back from YAML."""
        names = list(self.result("list_parameters").result.names)
        values = map(parameter_value_to_python, self.result("get_parameters", names).values)
        found = {name: plain(value) for name, value in zip(names, values, strict=True)}
        return dict(yaml.safe_load(yaml.safe_dump(found)))


@pytest.mark.parametrize("kind", ["plant", "reference", "controller", "recorder"])
def test_a_dump_makes_the_same_node_again(ros: Ros, tmp_path: Path, kind: str) -> None:
    given = {"scenario": cart_file(tmp_path), "duration_s": 0.5, "autostart": False}
    node = ros.node(kind, given)
    dumped = Client(ros, node).dump()
    assert dumped["duration_s"] == 0.5
    # `ros2 param load` reads each text as YAML once more.
    texts = [value for value in dumped.values() if isinstance(value, str) and value]
    assert [yaml.safe_load(text) for text in texts] == texts
    ros.remove(node)
    again = ros.node(kind, dumped)
    assert again.scenario == node.scenario
    assert again.settings == node.settings


def test_what_can_be_set_while_the_controller_runs_is_loaded(ros: Ros, tmp_path: Path) -> None:
    node = ros.node("controller", {"scenario": cart_file(tmp_path)})
    client = Client(ros, node)
    dumped = client.dump()
    live = {name: value for name, value in dumped.items() if name.startswith(node.LIVE)}
    assert live
    given = [Parameter(name, value=value) for name, value in {**live, "duration_s": 1.0}.items()]
    results = client.result("set_parameters", given).results
    assert [result.successful for result in results] == [True] * len(live) + [False]
    assert "duration_s" in results[-1].reason

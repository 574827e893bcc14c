# SPDX-License-Identifier: Apache-2.0
"""One node, for closed_loop.launch.xml.

An estimator ends at once where the scenario has none. A node that refuses to start ends the launch with a reason. A
plant that ends ends the other nodes of its namespace.
"""

from signal import SIGINT
from typing import Any

import yaml
from launch.actions import DeclareLaunchArgument, EmitEvent, OpaqueFunction, Shutdown
from launch.events.process import SignalProcess
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchDescription

_REFUSED = 2  # exit code of a node that cannot take part: a wrong setting, an existing folder, a second plant
_ARGUMENTS = {
    "node": ("plant", "plant, reference, estimator, controller or recorder"),
    "parameters": ("{}", "Parameters of the node, a mapping in YAML"),
    "params_file": ("", "ROS parameter file, which overrides the other parameters; empty: none"),
    "clock": ("/clock", "Topic of the clock"),
}


def _node(context: Any) -> list[Node]:
    given = {name: LaunchConfiguration(name).perform(context) for name in _ARGUMENTS}
    name, file, parameters = given["node"], given["params_file"], yaml.safe_load(given["parameters"])

    def on_exit(event: Any, _context: Any) -> list[Any]:
        if event.returncode == _REFUSED:
            return [Shutdown(reason=f"the {name} node refused to start, its last message says why")]
        if name == "plant":
            return [EmitEvent(event=SignalProcess(signal_number=SIGINT, process_matcher=is_with_it))]
        return []

    def is_with_it(action: Any) -> bool:
        return (
            isinstance(action, Node)
            and action is not node
            and action.expanded_node_namespace == node.expanded_node_namespace
        )

    node = Node(
        package="skydiver_utc",
        executable=f"{name}_node",
        output="screen",
        parameters=[parameters, *([file] if file else [])],
        remappings=[("/clock", given["clock"]), ("/tf", given["clock"].removesuffix("clock") + "tf")],
        on_exit=on_exit,
    )
    return [node]


def generate_launch_description() -> LaunchDescription:
    """The arguments and the node."""
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in _ARGUMENTS.items()
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=_node)])

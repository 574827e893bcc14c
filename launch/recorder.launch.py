"""The recorder of one skydiver: where it cannot begin nothing starts, where it ends later the flight goes on."""

from typing import Any

from launch.actions import DeclareLaunchArgument, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchDescription

_REFUSED = 2  # exit code of a node that does not take part, for example because its folder exists already
_PARAMETERS = {
    "scenario": "Name of a scenario, or path of its YAML file",
    "bag_folder": "Folder of the run, not existing yet; empty: bags/(UTC time)_(scenario)",
}


def end_where_refused(event: Any, _context: Any) -> list[Any]:
    """What follows when the recorder's process has ended."""
    return [Shutdown(reason="the recorder cannot record")] if event.returncode == _REFUSED else []


def generate_launch_description() -> LaunchDescription:
    """The arguments and the node."""
    arguments = [DeclareLaunchArgument(name, description=text) for name, text in _PARAMETERS.items()]
    given = {name: ParameterValue(LaunchConfiguration(name), value_type=str) for name in _PARAMETERS}
    recorder = Node(
        package="skydiver_utc",
        executable="recorder_node",
        output="screen",
        parameters=[given],
        on_exit=end_where_refused,
    )
    return LaunchDescription([*arguments, recorder])

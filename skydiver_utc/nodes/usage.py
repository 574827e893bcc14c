"""The help text of a node: its parameters, without rclpy."""

import textwrap

from skydiver_utc.nodes.node_parameters import OWN_PARAMETERS, resolve
from skydiver_utc.parameters import Leaf, scenario_names

_PURPOSES = {
    "plant": "The virtual skydiver: publishes its state, steps on the command that answers it.",
    "reference": "Publishes previews of the reference: a yaw rate, a pitch rate or the pattern angle alpha.",
    "controller": "The scenario's controller: answers each state with a command.",
    "recorder": "Records every topic into a rosbag2 folder until the flight's outcome, or until it is interrupted.",
}


def usage(kind: str) -> str:
    """What `<kind>_node --help` prints."""
    resolved = resolve(kind, {})
    own = len(OWN_PARAMETERS[kind])
    sections = [
        f"usage: {kind}_node [--ros-args -p NAME:=VALUE ... --params-file FILE ...]",
        _PURPOSES[kind],
        "parameters of this node:\n" + _table(resolved.parameters[:own]),
        f"parameters of the scenario {resolved.scenario.name}:\n" + _table(resolved.parameters[own:]),
        "scenarios:\n" + textwrap.indent(textwrap.fill(", ".join(scenario_names()), 100), "  "),
    ]
    return "\n\n".join(sections)


def _table(parameters: tuple[Leaf, ...]) -> str:
    width = max(len(leaf.name) for leaf in parameters)
    return "\n".join(f"  {leaf.name:{width}}  {_value(leaf)}  {leaf.description}" for leaf in parameters)


def _value(leaf: Leaf) -> str:
    value = list(leaf.value) if isinstance(leaf.value, tuple) else leaf.value
    unit = f" {leaf.unit}" if leaf.unit not in ("", "1") else ""
    return f"{str(value) or '(empty)'}{unit}"

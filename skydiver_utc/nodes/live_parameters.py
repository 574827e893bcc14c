"""Parameters of a running node: declared, described, and changed as a whole from some step on."""

import difflib
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from skydiver_utc.nodes.node_parameters import Resolved, fixed_because
from skydiver_utc.parameters import Leaf, ParameterError, Scenario, leaves, override

_LARGEST_INTEGER = 2**63 - 1
# What of a scenario makes a node's answers; the controller begins from the initial control.
_WORKS_WITH = {"controller": ("controller.", "plant.", "air.", "initial."), "reference": ("reference.",)}

Values = Mapping[str, object]


class Change(NamedTuple):
    """What was asked for and waits for its step: the whole scenario, what differs, and what was built from it."""

    scenario: Scenario
    values: Values
    part: Any


class LiveParameters:
    """The parameters of one node on its ROS interface.

    A request is checked as a whole against the newest values, as `load_scenario` would, and `build` makes what the
    node needs for them, or refuses with a `ParameterError`. The result waits in `coming` until the node, between
    two steps, takes it.
    """

    def __init__(
        self,
        node: Node,
        kind: str,
        resolved: Resolved,
        build: Callable[[Scenario], Any],
        asked: Callable[[], None],
    ) -> None:
        self.coming: Change | None = None
        self.changed: dict[str, object] = {}  # all that was changed since the start and is in force
        self._kind, self._scenario, self._build, self._asked = kind, resolved.scenario, build, asked
        self._proposed: Change | None = None
        self._exists = node.has_parameter
        self._types = {
            leaf.name: node.declare_parameter(
                leaf.name, _plain(leaf.value), _descriptor(leaf, kind), ignore_override=True
            ).type_
            for leaf in resolved.parameters
        }
        node.add_on_set_parameters_callback(self._propose)
        node.add_post_set_parameters_callback(self._accept)

    def refusal(self, parameters: Sequence[Parameter]) -> str:
        """Why these cannot be set after the start; empty where they can."""
        for parameter in parameters:
            if not self._exists(parameter.name):
                close = difflib.get_close_matches(parameter.name, self._types, 1)
                return f"there is no parameter {parameter.name}" + (
                    f": did you mean {close[0]}" if close else ""
                )
            if reason := fixed_because(self._kind, parameter.name):
                return f"{parameter.name} is read-only: {reason}"
            wanted = self._types.get(parameter.name, parameter.type_)
            if parameter.type_ != wanted:
                found = parameter.type_.name.lower()
                return f"{parameter.name} must be of type {wanted.name.lower()}, found {found}"
        return ""

    def take(self) -> Change:
        """The change that waits is in force from now on."""
        assert self.coming is not None
        change, self.coming = self.coming, None
        self._scenario = change.scenario
        self.changed.update(change.values)
        return change

    def _propose(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        newest = self.coming or Change(self._scenario, {}, None)
        known = {leaf.name: leaf.value for leaf in leaves(newest.scenario)}
        asked = {p.name: _plain(p.value) for p in parameters if p.name in known}
        values = {name: value for name, value in asked.items() if value != _plain(known[name])}
        self._proposed = None
        if not values:
            return SetParametersResult(successful=True)
        try:
            scenario = override(newest.scenario, values)
            self._proposed = Change(scenario, {**newest.values, **values}, self._build(scenario))
        except ParameterError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _accept(self, _: Sequence[Parameter]) -> None:
        if self._proposed is not None:
            self.coming, self._proposed = self._proposed, None
            self._asked()


def differences(kind: str, own: Scenario, plants: Scenario) -> dict[str, object]:
    """What a node of this kind works with and the plant's scenario has otherwise, by dotted name."""
    there = {leaf.name: leaf.value for leaf in leaves(plants)}
    return {
        leaf.name: _plain(leaf.value)
        for leaf in leaves(own)
        if leaf.name.startswith(_WORKS_WITH[kind]) and leaf.value != there.get(leaf.name)
    }


def _plain(value: Any) -> Any:
    """The value as YAML would have it."""
    return value if isinstance(value, str) or not hasattr(value, "__len__") else list(value)


def _descriptor(leaf: Leaf, kind: str) -> ParameterDescriptor:
    """Unit, meaning and range of a parameter, and why it cannot be set after the start where it cannot."""
    text = leaf.description if leaf.unit in ("", "1") else f"{leaf.description} [{leaf.unit}]"
    fixed = fixed_because(kind, leaf.name)
    choices = "one of " + ", ".join(leaf.choices) if leaf.choices else ""
    descriptor = ParameterDescriptor(
        description=text,
        read_only=bool(fixed),
        additional_constraints="; ".join(filter(None, (choices, fixed and f"read-only: {fixed}"))),
    )
    bounds = (leaf.minimum, leaf.maximum)
    if leaf.kind == "float" and bounds != (None, None):
        low, high = _closed(bounds, sys.float_info.max)
        descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    elif leaf.kind == "int" and bounds != (None, None):
        low, high = _closed(bounds, _LARGEST_INTEGER)
        descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high), step=1)]
    return descriptor


def _closed(bounds: tuple[float | None, float | None], largest: float) -> tuple[float, float]:
    low, high = bounds
    return (-largest if low is None else low, largest if high is None else high)

"""The parameters of each node: its own and, by dotted name, every scalar of its scenario. No rclpy here."""

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import msgspec

from skydiver_utc.parameters import Leaf, ParameterError, Scenario, leaves, load_scenario

_DEFAULT_SCENARIO = "fast_turn_unknown_dynamics"

# Names that rclpy declares or reads itself.
_OF_RCLPY = ("use_sim_time", "start_type_description_service", "qos_overrides")


def _own(
    name: str,
    value: float | int | bool | str,
    unit: str,
    description: str,
    at_least: float | None = None,
    choices: tuple[str, ...] = (),
) -> Leaf:
    kind = {bool: "bool", int: "int", float: "float", str: "str"}[type(value)]
    return Leaf(name, value, kind, at_least, None, choices, unit, description)  # type: ignore[arg-type]


_SCENARIO = _own("scenario", _DEFAULT_SCENARIO, "", "name of a scenario, or path of its YAML file")
_AUTOSTART = _own(
    "autostart",
    True,
    "",
    "configure and activate at the start, and end after the flight; false: wait for lifecycle transitions",
)
_WAIT_FOR_RECORDER = _own("wait_for_recorder", False, "", "begin only when the recorder hears everything")
_MODE = _own(
    "mode",
    "lockstep",
    "",
    "lockstep: each step waits for its command; real_time: steps by the clock, the newest state is answered",
    choices=("lockstep", "real_time"),
)

OWN_PARAMETERS: Mapping[str, tuple[Leaf, ...]] = {
    "plant": (
        _SCENARIO,
        _AUTOSTART,
        _WAIT_FOR_RECORDER,
        _MODE,
        _own(
            "startup_timeout_s", 120.0, "s", "longest wait for the other nodes, which may compile first", 0.0
        ),
        _own("command_timeout_s", 2.0, "s", "wait for a command before the state is sent again", 0.01),
        _own("command_retries", 5, "1", "how often a state is sent again before giving up", 0),
        _own(
            "neutral_after_s", 0.25, "s", "real time: silence after which the neutral posture is taken", 0.0
        ),
        _own(
            "neutral_rate_rad_s",
            0.5,
            "rad/s",
            "real time: rate of alpha on the way to the neutral posture",
            0.0,
        ),
        _own(
            "clock",
            "own",
            "",
            "own: publishes /clock; follow: takes each step when the /clock of another plant shows it",
            choices=("own", "follow"),
        ),
        _own("followers", 0, "1", "own clock: plants that follow it and are waited for before it begins", 0),
        _own("clock_patience_s", 10.0, "s", "longest silence of another plant under the same clock", 0.1),
        _own("progress", False, "", "print JSON lines on the flight's progress to stdout"),
    ),
    "reference": (
        _SCENARIO,
        _AUTOSTART,
        _WAIT_FOR_RECORDER,
        _own("chunk_steps", 80, "1", "steps from one preview message to the next", 1),
    ),
    "controller": (
        _SCENARIO,
        _AUTOSTART,
        _WAIT_FOR_RECORDER,
        _MODE,
        _own("delay_steps", 0, "1", "steps by which the state is predicted ahead before deciding", 0),
        _own(
            "rejoin_wait_s",
            5.0,
            "s",
            "longest wait for what the plant holds, when this node comes into a flight that goes on",
            0.0,
        ),
    ),
    "recorder": (
        _SCENARIO,
        _AUTOSTART,
        _own("bag_folder", "", "", "folder of the bag, not existing yet; empty: bags/<UTC time>_<scenario>"),
    ),
}

# What a running node takes: the beginnings of names. The controller's plant is the model that it predicts with.
_LIVE: Mapping[str, tuple[str, ...]] = {
    "plant": ("plant.", "air."),
    "controller": ("controller.", "plant.", "air."),
    "reference": ("reference.",),
    "recorder": (),
}
# Fixed all the same, and why.
_FIXED: Mapping[str, str] = {
    "plant.limits.alpha": "the postures are tabulated over this range at the start",
    "plant.pattern_nodes": "the postures are tabulated at the start",
    "plant.limbs.reaction": "it chooses the equations, which are compiled at the start",
    "reference.signal": "it chooses the topics' content, which all nodes agree on at the start",
}
_ELSEWHERE = {"plant": "plant", "air": "plant", "controller": "controller", "reference": "reference"}
_AT_THE_START = {
    "initial": "a flight begins from it",
    "seed": "random numbers are drawn from it from the start",
    "subject": "the body is built at the start",
    "posture": "the body is built at the start",
    "pattern": "the body is built at the start",
    "duration_s": "the steps of the flight are counted at the start",
    "dt_s": "all nodes share one grid of steps from the start",
    "epoch_s": "all nodes share one grid of steps from the start",
}


def fixed_because(kind: str, name: str) -> str:
    """Why a node of this kind does not take this parameter after its start; empty where it does."""
    block = name.partition(".")[0]
    if name in _FIXED:
        return _FIXED[name]
    if name.startswith(_LIVE[kind]) or block in _OF_RCLPY:
        return ""
    if block in _ELSEWHERE:
        return f"set it at the {_ELSEWHERE[block]} node"
    return _AT_THE_START.get(block, "it is read at the start; start the node again to change it")


@dataclass(frozen=True)
class Resolved:
    """A node's parameters with every override merged in and checked."""

    scenario: Scenario
    own: Mapping[str, Any]
    parameters: tuple[Leaf, ...]  # all of them with their effective values
    changes: tuple[str, ...]  # "name = value (scenario file: value)" where the scenario file says otherwise


def resolve(kind: str, overrides: Mapping[str, object]) -> Resolved:
    """The parameters of a node of this kind; an unknown name or a bad value raises `ParameterError`."""
    own = {leaf.name: leaf for leaf in OWN_PARAMETERS[kind]}
    given = {n: v for n, v in overrides.items() if n.partition(".")[0] not in _OF_RCLPY}
    effective = [
        leaf._replace(value=_checked(leaf, given.get(leaf.name, leaf.value))) for leaf in own.values()
    ]
    values = {leaf.name: leaf.value for leaf in effective}
    name = str(values["scenario"])
    base = load_scenario(name)
    of_scenario = {n: v for n, v in given.items() if n not in own}
    _refuse_unknown(of_scenario, [*own, *(leaf.name for leaf in leaves(base))])
    scenario = load_scenario(name, of_scenario)
    return Resolved(
        scenario=scenario,
        own=values,
        parameters=(*effective, *leaves(scenario)),
        changes=_changes(base, scenario),
    )


def _checked(leaf: Leaf, value: object) -> float | int | bool | str:
    """The value in the parameter's own type; an int will do for a float."""
    if leaf.kind == "float" and type(value) is int:
        value = float(value)
    if type(value) is not type(leaf.value):
        raise ParameterError(f"parameter {leaf.name} must be of type {leaf.kind}, found {value!r}")
    assert isinstance(value, float | int | bool | str)
    if leaf.choices and value not in leaf.choices:
        raise ParameterError(f"parameter {leaf.name} must be one of {', '.join(leaf.choices)}, found {value}")
    if leaf.minimum is not None and not (isinstance(value, float | int) and leaf.minimum <= value < 2**31):
        raise ParameterError(f"parameter {leaf.name} must be at least {leaf.minimum:g}, found {value}")
    return value


def _refuse_unknown(names: Mapping[str, object], known: Sequence[str]) -> None:
    """Refuse names whose first part is no field of a scenario; `load_scenario` checks the rest."""
    fields = {field.name for field in msgspec.structs.fields(Scenario)}
    for name in names:
        if name.partition(".")[0] not in fields:
            close = difflib.get_close_matches(name, known, 1)
            hint = f"did you mean {close[0]}" if close else "take it out, or see --help for the names"
            raise ParameterError(f"unknown parameter {name}: {hint}")


def _changes(base: Scenario, scenario: Scenario) -> tuple[str, ...]:
    before = {leaf.name: leaf.value for leaf in leaves(base)}
    return tuple(
        f"{leaf.name} = {leaf.value} (scenario file: {before.get(leaf.name, 'not there')})"
        for leaf in leaves(scenario)
        if leaf.value != before.get(leaf.name)
    )

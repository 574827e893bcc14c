# SPDX-License-Identifier: Apache-2.0
"""The settings of the nodes: a struct each; every scalar of the scenario is taken by dotted name, too."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, NamedTuple

from skydiver_utc.errors import ParameterError, hint
from skydiver_utc.parameters.conversion import checked
from skydiver_utc.parameters.fields import Parameters, quantity, text
from skydiver_utc.parameters.leaves import leaves
from skydiver_utc.parameters.loading import load_scenario
from skydiver_utc.parameters.scenario import Scenario
from skydiver_utc.parameters.yaml_io import refuse_unfit

# Names that rclpy declares or reads itself.
_OF_RCLPY = ("use_sim_time", "start_type_description_service", "qos_overrides")


class NodeSettings(Parameters):
    """Parameters of every node."""

    scenario: Annotated[str, text("name of a scenario, or path of its YAML file")] = (
        "fast_turn_unknown_dynamics"
    )
    autostart: Annotated[
        bool,
        text(
            "configure and activate at the start; plant and recorder end after the run, the others wait for the next;"
            " false: wait for transitions"
        ),
    ] = True


class _PartnerSettings(NodeSettings):
    """Parameters of plant, reference, estimator and controller."""

    mode: Annotated[
        Literal["lockstep", "real_time", "vehicle"],
        text(
            "lockstep: a step waits for its command; real_time: it is due by the clock, the newest state is answered;"
            " vehicle (reference and controller): the time is that of a real vehicle's states"
        ),
    ] = "lockstep"
    wait_for_recorder: Annotated[bool, text("begin only when all topics are recorded")] = False


_SimulatedMode = Annotated[
    Literal["lockstep", "real_time"],
    text("lockstep: a step waits for its command; real_time: it is due by the clock"),
]


class PlantNodeSettings(_PartnerSettings):
    """The plant: publishes its state, steps on the command that answers it."""

    mode: _SimulatedMode = "lockstep"
    startup_timeout_s: Annotated[
        float, quantity("s", "longest wait for the other nodes, which may compile first", ge=0)
    ] = 600.0
    command_timeout_s: Annotated[
        float, quantity("s", "lockstep: wait for a command before the state is retransmitted", ge=0.01)
    ] = 2.0
    command_retries: Annotated[
        int, quantity("1", "lockstep: retransmissions of a state before the run ends with no_command", ge=0)
    ] = 5
    neutral_after_s: Annotated[
        float, quantity("s", "real time: time without commands after which the control goes to neutral", ge=0)
    ] = 0.25
    neutral_time_s: Annotated[
        float, quantity("s", "real time: time from the last command to the initial control", ge=0)
    ] = 2.0
    markers: Annotated[bool, text("publish the body and its forces as markers, some 1 ms of CPU each")] = True
    progress: Annotated[bool, text("print JSON lines on the run's progress to stdout")] = False


class ReferenceNodeSettings(_PartnerSettings):
    """The reference: publishes previews of the reference of the plant's outputs."""

    chunk_steps: Annotated[
        int, quantity("1", "steps from one preview message to the next", ge=1, le=10000)
    ] = 80


class EstimatorNodeSettings(_PartnerSettings):
    """The estimator: estimates each state from measurements and commands, where the scenario has one."""

    mode: _SimulatedMode = "lockstep"


class ControllerNodeSettings(_PartnerSettings):
    """The controller: answers each state with a command."""

    delay_steps: Annotated[
        int, quantity("1", "steps by which the state is predicted ahead before deciding", ge=0, le=1000)
    ] = 0
    world_frame: Annotated[str, text("frame of the pose in the states")] = "world"
    body_frame: Annotated[str, text("frame of the twist in the states")] = "body"
    command_message: Annotated[
        Literal["joint_state", "float64_multi_array", "twist"], text("message that carries the command")
    ] = "joint_state"
    command_components: Annotated[
        tuple[str, ...], text("twist: the component of each control, such as linear.x")
    ] = ()
    publish_clock: Annotated[bool, text("vehicle: publish the stamps of the states on the clock")] = False


class RecorderNodeSettings(NodeSettings):
    """The recorder: writes every topic into a rosbag2 folder until the outcome or an interrupt."""

    out: Annotated[
        str, text("folder of the bag, a new or an empty one; empty text: bags/<UTC time>_<scenario>")
    ] = ""


class PlayerNodeSettings(Parameters):
    """The player: publishes a recorded run again."""

    run: Annotated[str, text("run folder, bag folder or .mcap file")]
    rate: Annotated[float, quantity("1", "recorded seconds per second", gt=0, le=1000)] = 1.0
    start_s: Annotated[float, quantity("s", "recorded time to start at", ge=0)] = 0.0
    loop: Annotated[bool, text("start again at the end")] = False
    topics: Annotated[
        tuple[str, ...], text("topics to publish; empty: all but logs and parameter events")
    ] = ()


SETTINGS: Mapping[str, type[Parameters]] = {
    "plant": PlantNodeSettings,
    "reference": ReferenceNodeSettings,
    "estimator": EstimatorNodeSettings,
    "controller": ControllerNodeSettings,
    "recorder": RecorderNodeSettings,
    "player": PlayerNodeSettings,
}


class Resolved(NamedTuple):
    """The settings of a node, its scenario, and the parameters that differ from the scenario's file."""

    settings: NodeSettings
    scenario: Scenario
    changes: dict[str, object]


def resolve(kind: str, given: Mapping[str, object]) -> Resolved:
    """Settings and scenario of a node from parameters by name; an unknown name raises `ParameterError`."""
    model = SETTINGS[kind]
    assert issubclass(model, NodeSettings)
    given = _not_of_rclpy(given)
    settings = checked(model, {name: value for name, value in given.items() if name in model.model_fields})
    changes = {name: value for name, value in given.items() if name not in model.model_fields}
    for name in changes:
        if name.partition(".")[0] not in Scenario.model_fields:  # `load_scenario` checks the rest
            known = [*model.model_fields, *Scenario.model_fields]
            advice = hint(name, known, "take it out, or see --help for the names")
            raise ParameterError(f"unknown parameter {name}: {advice}")
    return Resolved(settings, load_scenario(settings.scenario, changes), changes)


def resolve_player(given: Mapping[str, object]) -> PlayerNodeSettings:
    """Settings of a player, which has no scenario; raises `ParameterError`."""
    return checked(PlayerNodeSettings, _not_of_rclpy(given))


def _not_of_rclpy(given: Mapping[str, object]) -> dict[str, object]:
    ours = {name: value for name, value in given.items() if name.partition(".")[0] not in _OF_RCLPY}
    refuse_unfit(ours, "the parameters")
    return ours


def scalars(settings: NodeSettings, scenario: Scenario) -> dict[str, object]:
    """Every setting and every scalar of the scenario by dotted name; no prose and no tables."""
    own = {name: getattr(settings, name) for name in type(settings).model_fields}
    values = own | {leaf.name: leaf.value for leaf in leaves(scenario)}
    return {name: list(v) if isinstance(v, tuple) else v for name, v in values.items()}


def usage(kind: str) -> str:
    """The text of `<kind>_node --help`."""
    model = SETTINGS[kind]
    width = max(map(len, model.model_fields))
    lines = [
        f"usage: {kind}_node [--ros-args -p NAME:=VALUE ... --params-file FILE ...]\n",
        f"{(model.__doc__ or '').strip()}\n",
        "parameters:",
        *(
            f"  {name:{width}}  {_default(field)}  {field.description}"
            for name, field in model.model_fields.items()
        ),
    ]
    if "scenario" in model.model_fields:
        lines.append(
            "\nEvery scalar of the scenario can be given, too, by its dotted name, such as controller.horizon_steps."
        )
    return "\n".join(lines)


def _default(field: Any) -> str:
    if field.is_required():
        return "(needed)"
    value = list(field.default) if isinstance(field.default, tuple) else field.default
    unit = (field.json_schema_extra or {}).get("unit", "1")
    return f"{value if value != '' else '(empty)'}" + (f" {unit}" if unit != "1" else "")

# SPDX-License-Identifier: Apache-2.0
"""Bags written message by message, as the nodes would leave them."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore
from runs import run_of, skydiver

from skydiver_utc.loop.build import build_controller, build_reference
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters import Scenario, to_yaml
from skydiver_utc.recording.writer import BagWriter

STORE = get_typestore(Stores.ROS2_JAZZY)
TYPES = STORE.types
STRING, JOINTS = "std_msgs/msg/String", "sensor_msgs/msg/JointState"
ODOMETRY, TRAJECTORY = "nav_msgs/msg/Odometry", "trajectory_msgs/msg/JointTrajectory"
EMPTY = np.empty(0)

Message = tuple[str, str, int, Any]  # topic, type, step, message or its bytes
Edit = Callable[[list[Message]], list[Message]]


def header(scenario: Scenario, k: int, frame: str = "") -> Any:
    sec, nanosec = divmod(scenario.stamp_ns(k), 1_000_000_000)
    return TYPES["std_msgs/msg/Header"](TYPES["builtin_interfaces/msg/Time"](sec, nanosec), frame)


def vector(kind: str, values: Any) -> Any:
    return TYPES[f"geometry_msgs/msg/{kind}"](*(float(v) for v in values))


def odometry(scenario: Scenario, k: int, state: Any) -> Any:
    pose = TYPES["geometry_msgs/msg/Pose"](vector("Point", state[0:3]), vector("Quaternion", state[3:7]))
    twist = TYPES["geometry_msgs/msg/Twist"](vector("Vector3", state[7:10]), vector("Vector3", state[10:13]))
    return TYPES[ODOMETRY](
        header=header(scenario, k, "world"),
        child_frame_id="body",
        pose=TYPES["geometry_msgs/msg/PoseWithCovariance"](pose, np.zeros(36)),
        twist=TYPES["geometry_msgs/msg/TwistWithCovariance"](twist, np.zeros(36)),
    )


def named(scenario: Scenario, k: int, names: Sequence[str], values: Any) -> Any:
    """A JointState."""
    return TYPES[JOINTS](header(scenario, k), list(names), np.array(values, dtype=np.float64), EMPTY, EMPTY)


def preview(scenario: Scenario, k0: int, names: Sequence[str], values: Any) -> Any:
    """A JointTrajectory of values (count, l) from step k0 on."""
    points = [
        TYPES["trajectory_msgs/msg/JointTrajectoryPoint"](
            np.array(row, dtype=np.float64), EMPTY, EMPTY, EMPTY,
            TYPES["builtin_interfaces/msg/Duration"](*divmod(i * scenario.dt_ns, 1_000_000_000)),
        )
        for i, row in enumerate(values)
    ]  # fmt: skip
    return TYPES[TRAJECTORY](header(scenario, k0), list(names), points)


def text(content: str) -> Any:
    return TYPES[STRING](content)


def state(run: Run, k: int, values: Any) -> Message:
    """The state's message, of the type that the plant has."""
    if run.plant.state_message == "odometry":
        return "state", ODOMETRY, k, odometry(run.scenario, k, values)
    return "state", JOINTS, k, named(run.scenario, k, run.plant.state_names, values)


def command(run: Run, k: int, values: Any, names: Sequence[str] | None = None) -> Message:
    return "command", JOINTS, k, named(run.scenario, k, names or run.plant.control_names, values)


def outcome(run: Run, run_id: str = "", **more: Any) -> Message:
    content = {
        "run_id": run_id,
        "outcome": run.outcome.value,
        "reason": run.reason,
        "states": len(run.states),
    }
    content["wall_time_s"] = run.wall_time_s
    return "outcome", STRING, len(run.commands), text(json.dumps(content | more))


def change(step: int, node: str, control: Any = None, **parameters: Any) -> Message:
    content = {"node": node, "step": step, "control": control}
    content["parameters"] = {name.replace("__", "."): value for name, value in parameters.items()}
    return "changes", STRING, step, text(json.dumps(content))


def messages_of(run: Run, run_id: str = "") -> list[Message]:
    """What the nodes publish in this run, but for the previews."""
    scenario, controls = run.scenario, run.plant.control_names
    names = [*run.telemetry_names, "solve_time", "status"]
    yaml = f"# run_id: {run_id}\n{to_yaml(scenario)}" if run_id else to_yaml(scenario)
    found: list[Message] = [("scenario", STRING, 0, text(yaml))]
    for k in range(len(run.states)):
        found.append(state(run, k, run.states[k]))
        setpoint = named(scenario, k, run.tracked_names, run.reference[k])
        found.append(("reference/setpoint", JOINTS, k, setpoint))
        if run.disturbance_names:
            acting = named(scenario, k, run.disturbance_names, run.disturbance[k])
            found.append(("disturbance", JOINTS, k, acting))
    for k in range(len(run.commands)):
        values = [*run.telemetry[k], run.solve_time_s[k], run.status[k]]
        found.append(command(run, k, run.commands[k]))
        found.append(("applied_command", JOINTS, k, named(scenario, k, controls, run.applied[k])))
        found.append(("controller/telemetry", JOINTS, k, named(scenario, k, names, values)))
    return [*found, outcome(run, run_id)]


def write_run(
    folder: Path,
    run: Run,
    edit: Edit = list,
    namespaces: tuple[str, ...] = ("/skydiver",),
    run_id: str = "",
) -> Path:
    """A bag of the run's messages after `edit`, for each namespace."""
    with BagWriter(folder) as bag:
        channels: dict[str, int] = {}
        messages = edit(messages_of(run, run_id))
        for name, kind, k, message in [(f"{n}/{m[0]}", *m[1:]) for n in namespaces for m in messages]:
            if name not in channels:
                definition, type_hash = STORE.generate_msgdef(kind), STORE.hash_rihs01(kind)
                channels[name] = bag.add_topic(name, kind, definition[0], type_hash, "")
            time_ns = run.scenario.stamp_ns(k)
            cdr = message if isinstance(message, bytes) else bytes(STORE.serialize_cdr(message, kind))
            bag.write(channels[name], cdr, time_ns, time_ns)
    return folder


def without(topic: str, *steps: int) -> Edit:
    """Takes the messages of one topic out, at these steps or at all of them."""
    return lambda messages: [m for m in messages if m[0] != topic or (steps and m[2] not in steps)]


def since(step: int) -> Edit:
    """A recorder started during the run: the scenario, which is latched, and the messages from this step on."""
    return lambda messages: [m for m in messages if m[0] == "scenario" or m[2] >= step]


def added(*more: Message) -> Edit:
    """Further messages at the end."""
    return lambda messages: [*messages, *more]


def with_previews(run: Run, offset: float = 0.0) -> Edit:
    """Adds two previews that reach beyond the end; the second one is moved by `offset`."""
    reference = build_reference(run.scenario)
    ahead = build_controller(run.scenario, run.plant, reference).preview_steps
    values = reference.preview(0, 160 + ahead)
    return added(
        *(
            ("reference", TRAJECTORY, k, preview(run.scenario, k, reference.outputs, rows))
            for k, rows in ((0, values[: 80 + ahead]), (80, values[80:] + offset))
        )
    )


def bag_of_postures(folder: Path, postures: Any, names: Sequence[str], namespace: str = "/skydiver") -> Path:
    """Joint angles (n, m) [rad] every eighth step; a second message of the second posture comes later."""
    run = run_of(scenario=skydiver())
    rows = [*enumerate(postures), (1, np.ones(len(names)))]
    joints = (("joint_states", JOINTS, 8 * i, named(run.scenario, 8 * i, names, row)) for i, row in rows)
    return write_run(folder, run, added(*joints), namespaces=(namespace,))

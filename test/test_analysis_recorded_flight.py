"""Flights read back from bags that are written here message by message."""

import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore
from test_analysis_metrics import flight_of, scenario_of

from skydiver_utc.analysis.errors import AnalysisError
from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.analysis.recorded_flight import RecordedFlight, read_flight
from skydiver_utc.parameters import to_yaml
from skydiver_utc.recording.errors import RecordingError
from skydiver_utc.recording.writer import BagWriter
from skydiver_utc.simulation.flight import Flight
from skydiver_utc.simulation.outcome import Outcome

STORE = get_typestore(Stores.ROS2_JAZZY)
TYPES = STORE.types
CONTROLS = ["Cm_damp_yaw", "k_right", "k_left", "alpha"]
STREAMS = ("state", "command", "applied_command", "reference/setpoint", "controller/telemetry")

Message = tuple[str, str, int, Any]  # topic, type, step, message or its bytes
Edit = Callable[[list[Message]], list[Message]]


def flight_with_everything(steps: int = 80, **fields: Any) -> Flight:
    """A flight no two numbers of which are alike."""
    random = np.random.default_rng(1)
    flight = flight_of(
        random.normal(100.0, 1.0, steps + 1),
        random.normal(100.0, 1.0, steps + 1),
        steps=steps,
        commands=random.normal(size=(steps, 4)),
        applied=random.normal(size=(steps, 4)),
        telemetry=random.normal(size=(steps, 2)),
        telemetry_names=("innovation", "clipped"),
        solve_time_s=random.uniform(1e-5, 2e-5, steps),
        status=random.integers(0, 4, steps).astype(float),
        **fields,
    )
    flight.states[:] = random.normal(size=flight.states.shape)
    return flight


def header(k: int) -> Any:
    sec, nanosec = divmod(scenario_of().stamp_ns(k), 1_000_000_000)
    stamp = TYPES["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
    return TYPES["std_msgs/msg/Header"](stamp=stamp, frame_id="")


def vector(kind: str, values: Any) -> Any:
    return TYPES[f"geometry_msgs/msg/{kind}"](*(float(v) for v in values))


def odometry(k: int, state: Any) -> Any:
    pose = TYPES["geometry_msgs/msg/Pose"](vector("Point", state[0:3]), vector("Quaternion", state[3:7]))
    twist = TYPES["geometry_msgs/msg/Twist"](vector("Vector3", state[7:10]), vector("Vector3", state[10:13]))
    return TYPES["nav_msgs/msg/Odometry"](
        header=header(k),
        child_frame_id="body",
        pose=TYPES["geometry_msgs/msg/PoseWithCovariance"](pose, np.zeros(36)),
        twist=TYPES["geometry_msgs/msg/TwistWithCovariance"](twist, np.zeros(36)),
    )


def joint_state(k: int, names: Sequence[str], values: Any) -> Any:
    empty = np.empty(0)
    return TYPES["sensor_msgs/msg/JointState"](
        header(k), list(names), np.array(values, dtype=np.float64), empty, empty
    )


def setpoint(k: int, value: float) -> Any:
    twist = TYPES["geometry_msgs/msg/Twist"](
        vector("Vector3", (0, 0, 0)), vector("Vector3", (0, 0, float(value)))
    )
    return TYPES["geometry_msgs/msg/TwistStamped"](header(k), twist)


def preview(k0: int, values: Any) -> Any:
    duration = TYPES["builtin_interfaces/msg/Duration"](0, 0)
    empty = np.empty(0)
    points = [
        TYPES["trajectory_msgs/msg/JointTrajectoryPoint"](
            positions=empty,
            velocities=np.array([v]),
            accelerations=empty,
            effort=empty,
            time_from_start=duration,
        )
        for v in values
    ]
    return TYPES["trajectory_msgs/msg/JointTrajectory"](header(k0), ["yaw_rate"], points)


def text(content: str) -> Any:
    return TYPES["std_msgs/msg/String"](content)


def messages_of(flight: Flight) -> list[Message]:
    """What the nodes publish in this flight."""
    ending = {"outcome": flight.outcome.value, "reason": flight.reason, "wall_time_s": flight.wall_time_s}
    names = [*flight.telemetry_names, "solve_time", "status"]
    joints, string = "sensor_msgs/msg/JointState", "std_msgs/msg/String"
    found: list[Message] = [("scenario", string, 0, text(to_yaml(flight.scenario)))]
    for k in range(len(flight.states)):
        found.append(("state", "nav_msgs/msg/Odometry", k, odometry(k, flight.states[k])))
        found.append(
            ("reference/setpoint", "geometry_msgs/msg/TwistStamped", k, setpoint(k, flight.reference[k]))
        )
    for k in range(len(flight.commands)):
        values = [*flight.telemetry[k], flight.solve_time_s[k], flight.status[k]]
        found.append(("command", joints, k, joint_state(k, CONTROLS, flight.commands[k])))
        found.append(("applied_command", joints, k, joint_state(k, CONTROLS, flight.applied[k])))
        found.append(("controller/telemetry", joints, k, joint_state(k, names, values)))
    found.append(("outcome", string, len(flight.commands), text(json.dumps(ending))))
    return found


def write_bag(
    folder: Path, flight: Flight, edit: Edit = list, namespaces: tuple[str, ...] = ("/skydiver",)
) -> Path:
    """A bag of the flight's messages, after `edit` has been at them, for each namespace."""
    with BagWriter(folder) as bag:
        channels: dict[str, int] = {}
        messages = edit(messages_of(flight))
        for name, kind, k, message in [(f"{n}/{m[0]}", *m[1:]) for n in namespaces for m in messages]:
            if name not in channels:
                definition, type_hash = STORE.generate_msgdef(kind), STORE.hash_rihs01(kind)
                channels[name] = bag.add_topic(name, kind, definition[0], type_hash, "")
            time_ns = flight.scenario.stamp_ns(k)
            cdr = message if isinstance(message, bytes) else bytes(STORE.serialize_cdr(message, kind))
            bag.write(channels[name], cdr, time_ns, time_ns)
    return folder


def without(topic: str, *steps: int) -> Edit:
    """Takes the messages of one topic out, at these steps or at all of them."""
    return lambda messages: [m for m in messages if m[0] != topic or (steps and m[2] not in steps)]


def test_a_flight_comes_back_bit_for_bit(tmp_path: Path) -> None:
    flight = flight_with_everything()
    back = read_flight(write_bag(tmp_path / "bag", flight))
    for name in ("states", "commands", "applied", "reference", "telemetry", "solve_time_s", "status"):
        assert np.array_equal(getattr(back, name), getattr(flight, name)), name
    for name in ("scenario", "telemetry_names", "outcome", "reason", "wall_time_s"):
        assert getattr(back, name) == getattr(flight, name), name
    assert metrics(back) == metrics(flight)


def test_a_skydiver_of_any_name_comes_back(tmp_path: Path) -> None:
    flight = flight_with_everything()
    folder = write_bag(tmp_path / "bag", flight, namespaces=("/jump/anna",))
    assert np.array_equal(read_flight(folder).states, flight.states)


def test_a_bag_of_several_skydivers_is_refused(tmp_path: Path) -> None:
    folder = write_bag(tmp_path / "bag", flight_with_everything(), namespaces=("/a", "/b"))
    with pytest.raises(RecordingError, match=r"several skydivers \(/a, /b\)"):
        read_flight(folder)


def test_a_bare_mcap_file_is_a_recording_too(tmp_path: Path) -> None:
    flight = flight_with_everything()
    folder = write_bag(tmp_path / "bag", flight)
    (folder / "metadata.yaml").unlink()
    assert np.array_equal(read_flight(folder / "bag_0.mcap").states, flight.states)


def test_of_a_state_sent_again_the_first_counts(tmp_path: Path) -> None:
    flight = flight_with_everything()
    again: Message = ("state", "nav_msgs/msg/Odometry", 7, odometry(7, np.ones(13)))
    back = read_flight(write_bag(tmp_path / "bag", flight, lambda messages: [*messages, again]))
    assert np.array_equal(back.states, flight.states)


def test_messages_out_of_order_find_their_steps(tmp_path: Path) -> None:
    flight = flight_with_everything()
    back = read_flight(write_bag(tmp_path / "bag", flight, lambda messages: messages[::-1]))
    assert np.array_equal(back.states, flight.states)
    assert np.array_equal(back.commands, flight.commands)


@pytest.mark.parametrize(("topic", "count"), [("state", 81), ("command", 80), ("applied_command", 80)])
def test_missing_steps_are_counted(tmp_path: Path, topic: str, count: int) -> None:
    folder = write_bag(tmp_path / "bag", flight_with_everything(), without(topic, 17, 30))
    with pytest.raises(AnalysisError, match=f"lacks 2 of {count} steps, the first is step 17"):
        read_flight(folder)


def test_the_last_step_of_a_completed_flight_may_not_be_missing(tmp_path: Path) -> None:
    folder = write_bag(tmp_path / "bag", flight_with_everything(), without("state", 80))
    with pytest.raises(AnalysisError, match="lacks 1 of 81 steps, the first is step 80"):
        read_flight(folder)


def started_at(step: int) -> Edit:
    """What a recorder hears that is started in flight: what is latched, and what is sent from this step on."""
    return lambda messages: [m for m in messages if m[0] == "scenario" or m[2] >= step]


def test_a_recorder_that_was_started_in_flight_gives_the_steps_from_there_on(tmp_path: Path) -> None:
    flight = flight_with_everything()
    back = read_flight(write_bag(tmp_path / "bag", flight, started_at(30)))
    assert (back.first_step, len(back.states), len(back.commands)) == (30, 51, 50)
    for name in ("states", "commands", "applied", "reference", "telemetry", "solve_time_s", "status"):
        assert np.array_equal(getattr(back, name), getattr(flight, name)[30:]), name
    assert back.time_s.tolist() == flight.time_s[30:].tolist()
    assert back.outcome is Outcome.COMPLETED


def test_the_first_step_is_the_first_that_every_topic_has(tmp_path: Path) -> None:
    """The recorder heard the topics one after the other."""
    flight = flight_with_everything()
    heard = {"state": 10, "reference/setpoint": 12, "command": 14, "applied_command": 11}

    def edit(messages: list[Message]) -> list[Message]:
        return [m for m in messages if m[2] >= heard.get(m[0], 0)]

    back = read_flight(write_bag(tmp_path / "bag", flight, edit))
    assert back.first_step == 14
    assert np.array_equal(back.commands, flight.commands[14:])


def test_a_recording_of_the_middle_of_a_flight(tmp_path: Path) -> None:
    flight = flight_with_everything()

    def cut(messages: list[Message]) -> list[Message]:
        return without("outcome")([m for m in started_at(30)(messages) if m[2] <= 50])

    back = read_flight(write_bag(tmp_path / "bag", flight, cut))
    assert (back.first_step, len(back.states)) == (30, 21)
    assert back.reason == "the recording has no outcome, it ends after 50 of 80 steps"


def test_a_gap_after_the_first_step_is_refused_by_its_place(tmp_path: Path) -> None:
    def edit(messages: list[Message]) -> list[Message]:
        return without("command", 40)(started_at(30)(messages))

    folder = write_bag(tmp_path / "bag", flight_with_everything(), edit)
    with pytest.raises(AnalysisError, match=r"command in .* lacks 1 of 50 steps, the first is step 40"):
        read_flight(folder)


def test_a_recording_without_any_state_is_refused(tmp_path: Path) -> None:
    for number, ending in enumerate(({}, {"outcome": Outcome.ABORTED})):
        folder = write_bag(tmp_path / str(number), flight_with_everything(**ending), without("state"))
        with pytest.raises(AnalysisError, match=r"skydiver/state .* lacks"):
            read_flight(folder)


def test_a_setpoint_that_is_missing_is_in_the_preview(tmp_path: Path) -> None:
    flight = flight_with_everything()
    kind = "trajectory_msgs/msg/JointTrajectory"

    def with_preview(messages: list[Message]) -> list[Message]:
        chunk: Message = ("reference", kind, 10, preview(10, np.append(flight.reference[10:], [9.0] * 5)))
        return [*without("reference/setpoint", 17, 80)(messages), chunk]

    back = read_flight(write_bag(tmp_path / "bag", flight, with_preview))
    assert np.array_equal(back.reference, flight.reference)


def change_of_reference(step: int, **parameters: float) -> Message:
    told = {"node": "reference", "step": step, "control": None}
    told["parameters"] = {f"reference.{name}": value for name, value in parameters.items()}
    return "changes", "std_msgs/msg/String", step, text(json.dumps(told))


@pytest.mark.parametrize("steps", [(), (17, 30), tuple(range(30, 81))], ids=["all", "a hole", "the end"])
def test_a_reference_that_nothing_tells_is_that_of_the_recorded_scenario(
    tmp_path: Path, steps: tuple[int, ...]
) -> None:
    """Also where it was changed in flight; what is recorded stays, though the scenario has something else."""
    flight = flight_with_everything()
    changed = change_of_reference(40, yaw_rate_deg_s=20.0)

    def edit(messages: list[Message]) -> list[Message]:
        return [*without("reference/setpoint", *steps)(messages), changed]

    recording = RecordedFlight(write_bag(tmp_path / "bag", flight, edit))
    own = np.where(np.arange(81) < 40, np.deg2rad(flight.scenario.reference.yaw_rate_deg_s), np.deg2rad(20.0))
    missing = np.isin(np.arange(81), steps or range(81))
    back = recording.flight()
    assert recording.reference_added == missing.sum()
    assert np.array_equal(back.reference, np.where(missing, own, flight.reference))
    assert np.array_equal(back.states, flight.states)


def test_a_reference_that_is_recorded_is_not_added_to(tmp_path: Path) -> None:
    recording = RecordedFlight(write_bag(tmp_path / "bag", flight_with_everything()))
    recording.flight()
    assert recording.reference_added == 0


def test_a_cut_recording_ends_with_the_last_step_that_all_topics_have(tmp_path: Path) -> None:
    flight = flight_with_everything()
    heard = {"state": 52, "command": 51, "applied_command": 47, "reference/setpoint": 30, "outcome": -1}

    def cut(messages: list[Message]) -> list[Message]:
        return [m for m in messages if m[2] <= heard.get(m[0], 99)]

    recording = RecordedFlight(write_bag(tmp_path / "bag", flight, cut))
    back = recording.flight()
    assert back.reason == (
        "the recording has no outcome, it ends after 48 of 80 steps, the last that all topics have (state to step"
        " 52, command to step 51)"
    )
    assert np.array_equal(back.states, flight.states[:49])
    assert np.array_equal(back.applied, flight.applied[:48])
    assert (recording.reference_added, len(back.reference)) == (18, 49)


def test_a_bag_without_an_outcome_is_an_aborted_flight(tmp_path: Path) -> None:
    flight = flight_with_everything()

    def cut(messages: list[Message]) -> list[Message]:
        early = [m for m in messages if m[2] <= 50]
        return without("applied_command", 50)(without("outcome")(early))

    back = read_flight(write_bag(tmp_path / "bag", flight, cut))
    assert back.outcome is Outcome.ABORTED
    assert back.reason == "the recording has no outcome, it ends after 50 of 80 steps"
    assert (back.states.shape, back.commands.shape, back.reference.shape) == ((51, 13), (50, 4), (51,))
    result = metrics(back)
    assert (result["wall_time_s"], result["simulated_time_s"]) == (None, 2.5)


def test_a_flight_without_any_command_has_one_state(tmp_path: Path) -> None:
    flight = flight_with_everything(steps=0, outcome=Outcome.NO_COMMAND, reason="no usable command came")
    back = read_flight(write_bag(tmp_path / "bag", flight))
    assert (back.outcome, len(back.states), len(back.commands)) == (Outcome.NO_COMMAND, 1, 0)
    assert metrics(back)["rmse_deg_s"] is None


def test_the_answer_to_the_last_state_of_a_flight_that_ended_is_left_out(tmp_path: Path) -> None:
    flight = flight_with_everything(steps=20, outcome=Outcome.DIVERGED, reason="the state left the model")
    late: Message = ("command", "sensor_msgs/msg/JointState", 20, joint_state(20, CONTROLS, np.zeros(4)))
    back = read_flight(write_bag(tmp_path / "bag", flight, lambda messages: [*messages, late]))
    assert np.array_equal(back.commands, flight.commands)


def test_telemetry_is_not_asked_for(tmp_path: Path) -> None:
    flight = flight_with_everything()
    bare = read_flight(write_bag(tmp_path / "bare", flight, without("controller/telemetry")))
    assert (bare.telemetry_names, bare.telemetry.shape) == ((), (80, 0))
    assert metrics(bare)["solve_time_us"] == {"median": None, "p99": None}
    holed = read_flight(write_bag(tmp_path / "holed", flight, without("controller/telemetry", 5)))
    assert math.isnan(holed.solve_time_s[5])
    assert np.isnan(holed.telemetry[5]).all()
    assert np.array_equal(np.delete(holed.telemetry, 5, 0), np.delete(flight.telemetry, 5, 0))


def command(k: int, values: Any, names: Sequence[str] = CONTROLS) -> Message:
    return "command", "sensor_msgs/msg/JointState", k, joint_state(k, names, values)


@pytest.mark.parametrize("nanoseconds", [1, 10**9, -(10**9), 3 * 10**17])
def test_a_stamp_off_the_grid_or_outside_of_the_flight_is_left_out_and_counted(
    tmp_path: Path, nanoseconds: int
) -> None:
    flight = flight_with_everything()
    strays = [command(3, np.zeros(4)), ("state", "nav_msgs/msg/Odometry", 3, odometry(3, np.ones(13)))]
    for *_, message in strays:
        ns = scenario_of().stamp_ns(0 if nanoseconds < 0 else 80) + nanoseconds
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(ns, 10**9)
    recording = RecordedFlight(write_bag(tmp_path / "bag", flight, lambda messages: [*strays, *messages]))
    back = recording.flight()
    assert np.array_equal(back.states, flight.states)
    assert np.array_equal(back.commands, flight.commands)
    assert recording.ignored == {"state": 1, "command": 1}


@pytest.mark.parametrize(
    "stray", [command(0, np.zeros(4), CONTROLS[::-1]), command(0, np.zeros(3)), command(0, [])]
)
def test_what_does_not_hold_the_controls_is_left_out_and_counted(tmp_path: Path, stray: Message) -> None:
    flight = flight_with_everything()
    recording = RecordedFlight(write_bag(tmp_path / "bag", flight, lambda messages: [stray, *messages]))
    assert np.array_equal(recording.flight().commands, flight.commands)
    assert recording.ignored == {"command": 1}


@pytest.mark.parametrize("sent_at", [0, 38])
@pytest.mark.parametrize("topic", ["state", "command", "applied_command", "controller/telemetry"])
def test_a_message_sent_before_its_time_does_not_stand_for_the_flights_own(
    tmp_path: Path, topic: str, sent_at: int
) -> None:
    """A stranger's with the stamp of step 40; the first of two sent in time counts."""
    flight = flight_with_everything()

    def edit(messages: list[Message]) -> list[Message]:
        kind, copy = next((m[1], m[3]) for m in messages if m[0] == topic)
        other = {"state": odometry(40, np.ones(13))}.get(topic)
        other = other or joint_state(40, copy.name, np.ones(len(copy.position)))
        late = [(m[0], m[1], m[2] + 1, m[3]) if m[0] == "applied_command" else m for m in messages]
        return [(topic, kind, sent_at, other), *late, (topic, kind, 60, other)]

    back = read_flight(write_bag(tmp_path / "bag", flight, edit))
    for name in ("states", "commands", "applied", "telemetry"):
        assert np.array_equal(getattr(back, name), getattr(flight, name))


@pytest.mark.parametrize("topic", ["outcome", "scenario", "changes"])
@pytest.mark.parametrize(
    "content",
    [
        *("hello", "", "[]", "{}", "\x00", '{"node": 1, "step": 1e999}'),
        *("[" * 20_000, "a: 2001-99-99", "a: !!timestamp x", "a: &a [*a]", "a: " + "1" * 5000),
        '{"node": "controller", "step": 3, "parameters": {"controller.nothing": 1}, "control": null}',
        '{"node": "controller", "step": 3, "parameters": {"delay_steps": 1.5}, "control": null}',
        '{"node": "controller", "step": 3, "parameters": {"delay_steps": -1}, "control": null}',
        '{"node": "controller", "step": 3, "parameters": {}, "control": [1.0]}',
    ],
    ids=lambda text: text[:12],
)
def test_a_text_of_a_stranger_is_left_out(tmp_path: Path, topic: str, content: str) -> None:
    flight = flight_with_everything()
    kind = "std_msgs/msg/String"
    for place, name in ((0, "before"), (80, "after")):
        stray: Message = (topic, kind, place, text(content))

        def edit(messages: list[Message], stray: Message = stray) -> list[Message]:
            return [messages[0], stray, *messages[1:], stray]

        back = read_flight(write_bag(tmp_path / name, flight, edit))
        assert (back.outcome, back.reason, back.changes) == (flight.outcome, flight.reason, ())
        assert back.scenario == flight.scenario


def test_a_bag_of_something_else_is_refused(tmp_path: Path) -> None:
    folder = write_bag(tmp_path / "bag", flight_with_everything(), without("scenario"))
    with pytest.raises(AnalysisError, match="no recording of a flight"):
        read_flight(folder)


@pytest.mark.parametrize(
    "ending", ["{}", "nonsense", '{"outcome": "landed", "reason": "", "wall_time_s": 1}']
)
def test_a_flight_with_nothing_but_a_stranger_s_outcome_has_none(tmp_path: Path, ending: str) -> None:
    strange: Message = ("outcome", "std_msgs/msg/String", 80, text(ending))
    bag = write_bag(tmp_path / "bag", flight_with_everything(), lambda m: [*without("outcome")(m), strange])
    recording = RecordedFlight(bag)
    assert recording.flight().outcome is Outcome.ABORTED
    assert recording.ignored == {"outcome": 1}


def test_what_is_no_bag_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="does not exist"):
        read_flight(tmp_path / "nothing")
    with pytest.raises(RecordingError, match="not a bag"):
        read_flight(tmp_path)

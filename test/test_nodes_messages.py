"""Arrays to messages and back, and every check at the border. No ROS context is needed."""

import array
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message, serialize_message
from ros_fixtures import SCENARIO
from sensor_msgs.msg import JointState

from skydiver_utc.nodes.border import BorderError, Refusals
from skydiver_utc.nodes.messages import (
    ClockWriter,
    NamedValuesWriter,
    SetpointWriter,
    StateWriter,
    read_named_values,
    read_state,
)
from skydiver_utc.nodes.preview import PreviewStore, PreviewWriter, read_preview
from skydiver_utc.nodes.stamps import StepGrid
from skydiver_utc.nodes.topics import RECORDED, STATE, TOPICS, rosbag2_qos
from skydiver_utc.parameters import load_scenario
from skydiver_utc.plant.skydiver import CONTROL_NAMES

GRID = StepGrid(load_scenario(SCENARIO))
NAMES = CONTROL_NAMES

finite = st.floats(allow_nan=False, allow_infinity=False)
# What neither a state nor a reference may be refused for: three such rates are still below 200 rad/s.
possible = st.floats(-100.0, 100.0)
steps = st.integers(min_value=0, max_value=10_000_000)


def over_the_wire(message: Any) -> Any:
    return deserialize_message(serialize_message(message), type(message))


def state_of(values: NDArray[np.float64]) -> NDArray[np.float64]:
    state = values.copy()
    state[3:7] = (0.5, -0.5, 0.5, 0.5)
    return state


def state_message(k: int = 3) -> Any:
    return over_the_wire(StateWriter(GRID).fill(k, state_of(np.arange(13.0))))


def command_message(k: int = 3) -> Any:
    return over_the_wire(NamedValuesWriter(GRID, NAMES).fill(k, np.arange(4.0)))


def preview_message(k: int = 3) -> Any:
    return over_the_wire(PreviewWriter(GRID, "yaw_rate", 5).fill(k, np.arange(5.0)))


@given(k=steps)
def test_a_stamp_is_an_integer_step_to_the_nanosecond(k: int) -> None:
    stamp = Time()
    GRID.set_stamp(stamp, k)
    assert stamp.sec * 1_000_000_000 + stamp.nanosec == load_scenario_stamp(k)
    assert GRID.step_of(stamp) == k


def load_scenario_stamp(k: int) -> int:
    return GRID.epoch_ns + k * 4_200_000


@given(k=steps, off=st.integers(min_value=1, max_value=4_199_999))
def test_a_stamp_off_the_grid_is_refused(k: int, off: int) -> None:
    sec, nanosec = divmod(load_scenario_stamp(k) + off, 1_000_000_000)
    with pytest.raises(
        BorderError, match=r"not on the grid of 4200000 ns.*give every node the same scenario"
    ):
        GRID.step_of(Time(sec=sec, nanosec=nanosec))


@pytest.mark.parametrize(("sec", "nanosec"), [(0, 0), (-5, 0), (1, 999_999_999)])
def test_a_stamp_before_the_epoch_is_refused(sec: int, nanosec: int) -> None:
    with pytest.raises(BorderError, match="stamp") as caught:
        GRID.step_of(Time(sec=sec, nanosec=nanosec))
    assert caught.value.kind == "stamp"


@given(k=steps, values=st.lists(possible, min_size=13, max_size=13))
def test_a_state_comes_back_bit_for_bit(k: int, values: list[float]) -> None:
    state = state_of(np.array(values))
    message = over_the_wire(StateWriter(GRID).fill(k, state))
    assert GRID.step_of(message.header.stamp) == k
    assert read_state(message).tobytes() == state.tobytes()
    assert (message.header.frame_id, message.child_frame_id) == ("world", "body")


def test_a_writer_uses_one_message_and_leaves_nothing_behind() -> None:
    writer = StateWriter(GRID)
    first = writer.fill(0, state_of(np.arange(13.0)))
    second = writer.fill(1, state_of(-np.arange(13.0)))
    assert first is second
    assert second.twist.twist.angular.z == -12.0


@given(k=steps, values=st.lists(finite, min_size=4, max_size=4))
def test_a_command_comes_back_bit_for_bit(k: int, values: list[float]) -> None:
    message = over_the_wire(NamedValuesWriter(GRID, NAMES).fill(k, np.array(values)))
    assert list(message.name) == list(NAMES)
    assert read_named_values(message, NAMES).tobytes() == np.array(values).tobytes()
    assert GRID.step_of(message.header.stamp) == k


@pytest.mark.parametrize("values", [np.arange(4), np.arange(4, dtype=np.float32)])
def test_numbers_of_other_types_arrive_as_themselves(values: Any) -> None:
    """Unchecked, rclpy would send an int 1 as 5e-324."""
    message = over_the_wire(NamedValuesWriter(GRID, NAMES).fill(0, values))
    assert read_named_values(message, NAMES).tolist() == [0.0, 1.0, 2.0, 3.0]
    setpoint = over_the_wire(SetpointWriter(GRID, "yaw_rate").fill(0, values[1]))
    assert setpoint.twist.angular.z == 1.0


def test_a_setpoint_and_the_clock_carry_the_time_of_their_step() -> None:
    setpoint = over_the_wire(SetpointWriter(GRID, "yaw_rate").fill(7, 2.5))
    assert (GRID.step_of(setpoint.header.stamp), setpoint.header.frame_id) == (7, "body")
    assert (setpoint.twist.angular.z, setpoint.twist.linear.x) == (2.5, 0.0)
    assert GRID.step_of(over_the_wire(ClockWriter(GRID).fill(7)).clock) == 7


def test_values_and_names_must_be_equally_many() -> None:
    with pytest.raises(ValueError, match="3 values for 4 names"):
        NamedValuesWriter(GRID, NAMES).fill(0, np.zeros(3))


STATE_FAULTS = [
    ("frame", "header.frame_id", "odom", "frames"),
    ("frame", "child_frame_id", "", "'body'"),
    ("finite", "pose.pose.position.x", float("nan"), "x is nan"),
    ("finite", "pose.pose.orientation.w", float("inf"), "qw is inf"),
    ("finite", "twist.twist.angular.z", float("-inf"), "wz is -inf"),
    ("quaternion", "pose.pose.orientation.w", 0.0, "length 1"),
]


@pytest.mark.parametrize(("kind", "field", "value", "words"), STATE_FAULTS)
def test_a_state_that_cannot_be_used_is_refused(kind: str, field: str, value: object, words: str) -> None:
    message = state_message()
    *path, last = field.split(".")
    place = message
    for name in path:
        place = getattr(place, name)
    setattr(place, last, value)
    with pytest.raises(BorderError, match=words) as caught:
        read_state(message)
    assert caught.value.kind == kind


COMMAND_FAULTS = [
    ("names", [*NAMES[:3], "beta"], [0.0] * 4),
    ("names", [NAMES[1], NAMES[0], *NAMES[2:]], [0.0] * 4),
    ("names", list(NAMES[:3]), [0.0] * 3),
    ("names", [], []),
    ("names", [*NAMES, "more"], [0.0] * 5),
    ("size", list(NAMES), [0.0] * 3),
    ("size", list(NAMES), [0.0] * 5),
    ("size", list(NAMES), []),
    ("finite", list(NAMES), [0.0, float("nan"), 0.0, 0.0]),
    ("finite", list(NAMES), [0.0, 0.0, 0.0, float("inf")]),
]


@pytest.mark.parametrize(("kind", "names", "values"), COMMAND_FAULTS)
def test_a_command_that_cannot_be_used_is_refused(kind: str, names: list[str], values: list[float]) -> None:
    message = over_the_wire(JointState(name=names, position=array.array("d", values)))
    with pytest.raises(BorderError, match=r"^its? \w+") as caught:
        read_named_values(message, NAMES)
    assert caught.value.kind == kind


@given(k=steps, values=st.lists(possible, min_size=1, max_size=40))
def test_a_preview_comes_back_bit_for_bit(k: int, values: list[float]) -> None:
    message = over_the_wire(PreviewWriter(GRID, "yaw_rate", len(values)).fill(k, np.array(values)))
    k0, received = read_preview(message, GRID, "yaw_rate")
    assert (k0, received.tobytes()) == (k, np.array(values).tobytes())
    assert list(message.joint_names) == ["yaw_rate"]


def edited(edit: str) -> Any:
    message = preview_message()
    match edit:
        case "other joint":
            message.joint_names = ["roll_rate"]
        case "no joint":
            message.joint_names = []
        case "two joints":
            message.joint_names = ["yaw_rate", "yaw_rate"]
        case "no points":
            message.points = []
        case "two velocities":
            message.points[1].velocities = array.array("d", [1.0, 2.0])
        case "no velocity":
            message.points[4].velocities = array.array("d")
        case "late point":
            message.points[2].time_from_start.nanosec += 1
        case "points in another order":
            message.points = message.points[::-1]
        case "not a number":
            message.points[3].velocities[0] = float("nan")
        case "off the grid":
            message.header.stamp.nanosec += 1
    return message


@pytest.mark.parametrize(
    ("kind", "edit"),
    [
        ("names", "other joint"),
        ("names", "no joint"),
        ("names", "two joints"),
        ("size", "no points"),
        ("size", "two velocities"),
        ("size", "no velocity"),
        ("stamp", "late point"),
        ("stamp", "points in another order"),
        ("finite", "not a number"),
        ("stamp", "off the grid"),
    ],
)
def test_a_preview_that_cannot_be_used_is_refused(kind: str, edit: str) -> None:
    with pytest.raises(BorderError) as caught:
        read_preview(edited(edit), GRID, "yaw_rate")
    assert caught.value.kind == kind


@given(
    chunks=st.lists(st.tuples(st.integers(0, 60), st.integers(1, 30)), min_size=1, max_size=12),
    k=st.integers(0, 90),
    count=st.integers(1, 30),
)
def test_the_store_gives_what_was_received_and_nothing_else(
    chunks: list[tuple[int, int]], k: int, count: int
) -> None:
    store = PreviewStore()
    received: set[int] = set()
    for k0, size in chunks:
        store.add(k0, np.arange(k0, k0 + size, dtype=np.float64))
        received |= set(range(k0, k0 + size))
    window = store.window(k, count)
    if window is not None:
        assert window.tolist() == list(range(k, k + count))
        assert set(range(k, k + count)) <= received
    k0, size = chunks[-1]
    newest = store.window(k0, size)
    assert newest is not None


@given(chunks=st.lists(st.tuples(st.integers(0, 60), st.integers(1, 30)), min_size=1, max_size=12))
def test_of_a_step_that_several_chunks_tell_the_newest_is_kept(chunks: list[tuple[int, int]]) -> None:
    store = PreviewStore()
    told: dict[int, float] = {}
    for number, (k0, size) in enumerate(chunks):
        store.add(k0, np.full(size, float(number)))
        told |= dict.fromkeys(range(k0, k0 + size), float(number))
    for k in range(91):
        window = store.window(k, 1)
        if window is not None:
            assert window[0] == told[k]


def test_the_newest_chunk_wins_and_chunks_join() -> None:
    store = PreviewStore()
    assert store.covered() == "nothing"
    assert store.window(0, 1) is None
    store.add(0, np.zeros(10))
    store.add(5, np.ones(10))
    joined = store.window(0, 15)
    assert joined is not None
    assert joined.tolist() == [0.0] * 5 + [1.0] * 10
    assert (store.covered(), store.count) == ("steps 0 to 14", 15)
    store.add(3, np.full(2, 2.0))
    kept = store.window(0, 15)
    assert kept is not None
    assert kept.tolist() == [0.0] * 3 + [2.0] * 2 + [1.0] * 10
    store.add(100, np.ones(3))
    assert store.covered() == "steps 100 to 102"
    store.add(0, np.ones(3))
    assert store.covered() == "steps 0 to 2"


def test_a_store_does_not_grow_without_end() -> None:
    store = PreviewStore()
    for k0 in [*range(0, 5000, 5), *range(5000, 0, -5)]:
        store.add(k0, np.zeros(10))
        assert store.count <= 30


def test_a_window_cannot_be_changed_from_outside() -> None:
    store = PreviewStore()
    store.add(0, np.zeros(4))
    window = store.window(0, 4)
    assert window is not None
    window[:] = 9.0
    again = store.window(0, 4)
    assert again is not None
    assert not again.any()
    assert again.flags.c_contiguous
    assert again.flags.aligned


def test_refusals_are_counted_and_the_first_of_a_kind_is_told() -> None:
    told: list[str] = []
    refusals = Refusals(told.append)
    for _ in range(3):
        refusals.add("command", BorderError("stamp", "its stamp is wrong"))
    refusals.add("command", BorderError("finite", "its alpha is nan"))
    assert refusals.counts == {"stamp": 3, "finite": 1}
    assert refusals.summary() == "finite 1, stamp 3"
    assert len(told) == 2
    assert "command: its stamp is wrong" in told[0]


def test_the_table_of_topics_is_consistent() -> None:
    names = [topic.name for topic in TOPICS]
    assert len(set(names)) == len(names)
    assert STATE.type_name == "nav_msgs/msg/Odometry"
    assert {topic.name for topic in RECORDED} == set(names) - {
        "recorder/ready",
        "roll_call",
        "/clock/source",
        "/clock/awaited",
    }
    assert [topic.name for topic in TOPICS if topic.latched] == [
        "scenario",
        "reference",
        "outcome",
        "recorder/ready",
        "roll_call",
        "/clock/source",
        "/clock/awaited",
    ]


@pytest.mark.parametrize("topic", RECORDED, ids=lambda topic: topic.name)
def test_profiles_are_told_in_the_words_of_rosbag2(topic: Any) -> None:
    profile = rosbag2_qos(topic.qos)
    assert (profile["history"], profile["reliability"]) == ("keep_last", "reliable")
    assert profile["durability"] == ("transient_local" if topic.latched else "volatile")

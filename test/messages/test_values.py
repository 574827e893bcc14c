# SPDX-License-Identifier: Apache-2.0
"""Values by name or in fields, and states: there and back bit for bit, and what is refused."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plain_messages import joint_state, odometry, put, twist

from skydiver_utc.messages import (
    TWIST_COMPONENTS,
    MessageError,
    Refusals,
    fill_fields,
    fill_named,
    fill_state,
    read_fields,
    read_named,
    read_state,
)

NAMES = ("a", "b", "c")
FIELDS = tuple(f"linear_acceleration.{axis}" for axis in "xyz")
STATE = np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3, math.sqrt(0.86), 4.0, 5.0, 6.0, 7.0, 8.0, 9.0])
finite = st.floats(allow_nan=False, allow_infinity=False)


@given(st.lists(finite, min_size=3, max_size=3), st.permutations(NAMES))
def test_values_come_back_bit_for_bit_from_names_in_any_order(values: list[float], order: list[str]) -> None:
    wanted = np.array(values)
    sent = wanted[[NAMES.index(name) for name in order]]
    assert read_named(fill_named(joint_state(tuple(order)), sent), NAMES).tobytes() == wanted.tobytes()


def test_values_are_sent_as_doubles_whatever_array_they_come_in() -> None:
    message = fill_named(joint_state(NAMES), np.array([1.0, 2.0, 3.0]))
    assert message.position.typecode == "d"
    with pytest.raises(ValueError, match="2 values for 3 names"):
        fill_named(joint_state(NAMES), np.zeros(2))


@pytest.mark.parametrize(
    ("kind", "names", "values"),
    [
        ("names", ("a", "b"), [1.0, 2.0]),
        ("names", ("a", "b", "b"), [1.0, 2.0, 3.0]),
        ("names", ("a", "b", "c", "d"), [1.0, 2.0, 3.0, 4.0]),
        ("size", NAMES, [1.0, 2.0]),
        ("size", NAMES, []),
        ("finite", NAMES, [1.0, math.nan, 3.0]),
        ("finite", ("c", "b", "a"), [1.0, 2.0, math.inf]),
    ],
)
def test_values_that_cannot_be_used_are_refused(
    kind: str, names: tuple[str, ...], values: list[float]
) -> None:
    with pytest.raises(MessageError) as refused:
        read_named(joint_state(names, values), NAMES)
    assert refused.value.kind == kind


def test_a_state_comes_back_bit_for_bit() -> None:
    assert read_state(fill_state(odometry(), STATE), (), ("world", "body")).tobytes() == STATE.tobytes()


@pytest.mark.parametrize(("error", "normalised"), [(1e-9, False), (9e-4, True)])
def test_a_rounded_quaternion_is_normalised_and_an_integrated_one_is_kept(
    error: float, normalised: bool
) -> None:
    state = STATE.copy()
    state[3:7] *= 1.0 + error
    found = read_state(fill_state(odometry(), state))
    assert (found.tobytes() == state.tobytes()) is not normalised
    if normalised:
        np.testing.assert_allclose(found, STATE, rtol=1e-12)


@pytest.mark.parametrize(
    ("kind", "place", "value"),
    [
        ("frame", "header.frame_id", "map"),
        ("frame", "child_frame_id", "base_link"),
        ("quaternion", "pose.pose.orientation.w", 0.92),
        ("finite", "twist.twist.angular.z", math.nan),
    ],
)
def test_a_state_that_cannot_be_used_is_refused(kind: str, place: str, value: object) -> None:
    message = fill_state(odometry(), STATE)
    put(message, place, value)
    with pytest.raises(MessageError) as refused:
        read_state(message, (), ("world", "body"))
    assert refused.value.kind == kind


def test_the_state_of_a_body_is_none_of_a_plant_with_other_states() -> None:
    with pytest.raises(MessageError) as refused:
        read_state(fill_state(odometry(), STATE), NAMES)
    assert refused.value.kind == "size"


def test_a_twist_holds_each_value_in_its_component() -> None:
    values = np.arange(1.0, 7.0)
    message = fill_fields(twist(), values, TWIST_COMPONENTS)
    assert (message.linear.y, message.angular.z) == (2.0, 6.0)
    assert read_fields(message, ("angular.z", "linear.x")).tolist() == [6.0, 1.0]
    for value in (math.inf, math.nan):
        message.linear.x = value
        with pytest.raises(MessageError, match=r"linear\.x"):
            read_fields(message, ("angular.z", "linear.x"))


def imu() -> SimpleNamespace:
    parts = ("angular_velocity", "linear_acceleration")
    covariances = {f"{part}_covariance": np.zeros(9) for part in ("orientation", *parts)}
    return SimpleNamespace(**{part: SimpleNamespace(x=0.0, y=0.0, z=0.0) for part in parts}, **covariances)


def test_a_measurement_comes_back_with_its_bits_and_an_imu_says_what_it_does_not_measure() -> None:
    values = np.array([0.1, -2.0, 1.0 / 3.0])
    message = fill_fields(imu(), values, FIELDS)
    np.testing.assert_array_equal(read_fields(message, FIELDS, "xyz"), values)
    assert message.orientation_covariance[0] == message.angular_velocity_covariance[0] == -1.0
    assert message.linear_acceleration_covariance[0] == 0.0
    by_name = fill_fields(joint_state(("angle",), ()), values[:1], ())
    np.testing.assert_array_equal(read_fields(by_name, (), ("angle",)), values[:1])


def test_refusals_are_counted_and_the_first_of_a_kind_is_logged() -> None:
    logged: list[str] = []
    refusals = Refusals(logged.append)
    for _ in range(3):
        refusals.add("state", MessageError("finite", "its x is nan"))
    refusals.add("command", MessageError("finite", "its alpha is nan"))
    refusals.add("state", MessageError("stamp", "it is off the grid"))
    assert refusals.counts == {"finite": 4, "stamp": 1}
    assert refusals.summary() == "finite 4, stamp 1"
    assert len(logged) == 3
    assert "off the grid" in refusals.last

# SPDX-License-Identifier: Apache-2.0
"""A real vehicle as the plant: its own stamps and frames, and the command in the message that it takes."""

import time
from pathlib import Path
from typing import Any

import pytest
from own_slots import CART, cart_file
from ros_fixtures import JOINT_STATE, Ros

from skydiver_utc.nodes import topics
from skydiver_utc.parameters.nanoseconds import stamp_ns

pytest_plugins = ("ros_fixtures",)

BODY = CART.replace("own_slots:Cart", "own_slots:Body")


class Vehicle:
    """Publishes its state at its own times until it has to stop; takes commands of a type."""

    def __init__(self, ros: Ros, state: topics.Topic, command: str) -> None:
        self.sent: list[Any] = []
        self._partner = ros.partner("vehicle")
        self._states = self._partner.publisher(state)
        self._type = state.type
        self.commands = self._partner.receive(topics.COMMAND.of_type(topics.COMMAND_TYPES[command]))
        self._partner.create_timer(1.0 / 130.0, self._publish)

    def _publish(self) -> None:
        message = self._type()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(time.time_ns(), 10**9)
        if hasattr(message, "pose"):
            message.header.frame_id, message.child_frame_id = "map", "base_link"
            message.pose.pose.orientation.w = 1.0005  # rounded
            message.pose.pose.position.x = 0.1
        else:
            message.name, message.position = ["speed", "position"], [0.0, 0.1]
        self.sent.append(message)
        self._states.publish(message)


def fly(ros: Ros, path: str, state: topics.Topic, **settings: object) -> tuple[Vehicle, Any]:
    given = {"scenario": path, "mode": "vehicle"}
    vehicle = Vehicle(ros, state, str(settings.get("command_message", "joint_state")))
    ros.node("reference", given)
    controller = ros.node("controller", given | settings)
    ros.spin_until(lambda: len(vehicle.commands) > 20)
    return vehicle, controller


@pytest.mark.parametrize(
    ("text", "state", "frames"),
    [(CART, JOINT_STATE, {}), (BODY, topics.STATE, {"world_frame": "map", "body_frame": "base_link"})],
    ids=["names in any order", "other frames and a rounded quaternion"],
)
def test_states_are_answered_with_their_own_stamps(
    ros: Ros, tmp_path: Path, text: str, state: topics.Topic, frames: dict[str, str]
) -> None:
    clock = ros.partner("clock")
    vehicle, controller = fly(ros, cart_file(tmp_path, text), state, **frames)
    sent = {stamp_ns(message.header.stamp) for message in vehicle.sent}
    answered = [stamp_ns(message.header.stamp) for message in vehicle.commands]
    assert set(answered) <= sent
    assert answered == sorted(answered)
    assert not controller.refusals.counts.keys() - {"repeated"}
    assert clock.count_publishers("/clock") == 0
    # The steps are those of the vehicle's time.
    elapsed_s = (answered[-1] - answered[0]) * 1e-9
    assert controller.answered == pytest.approx(elapsed_s / 0.01, abs=15)


@pytest.mark.parametrize("command_message", ["float64_multi_array", "twist"])
def test_the_command_comes_in_the_message_that_the_vehicle_takes_and_the_clock_where_asked_for(
    ros: Ros, tmp_path: Path, command_message: str
) -> None:
    clocks = ros.partner("clock").receive(topics.CLOCK)
    settings: dict[str, Any] = {"command_message": command_message, "publish_clock": True}
    if command_message == "twist":
        settings["command_components"] = ["linear.x", "angular.z"]
    vehicle, _ = fly(ros, cart_file(tmp_path), JOINT_STATE, **settings)
    ros.spin_until(lambda: clocks)
    assert stamp_ns(clocks[0].clock) in {stamp_ns(message.header.stamp) for message in vehicle.sent}
    last = vehicle.commands[-1]
    brake = last.data[1] if command_message == "float64_multi_array" else last.angular.z
    assert brake == pytest.approx(0.25, abs=1e-3)

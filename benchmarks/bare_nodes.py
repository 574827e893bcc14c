# SPDX-License-Identifier: Apache-2.0
"""Bare rclpy nodes that ours are measured against: plain callbacks on a plain executor, our messages, no work.

``ping`` and ``pong`` are the pair beside the real-time mode: ping sends an Odometry at each deadline of the steady
clock and prints how often it was late, pong answers. ``plant``, ``controller``,
``reference`` and ``recorder`` are the loop beside lockstep: topics, types, sizes and qualities of service as ours,
each step on the command's callback; plant prints when it sent each state.
"""

import json
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple

import rclpy
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from skydiver_utc.nodes import topics


class Loop(NamedTuple):
    """What the four bare nodes need to know to send messages of the sizes of ours."""

    steps: int
    dt_ns: int
    control_names: list[str]
    joint_names: list[str]
    telemetry_names: list[str]
    joint_states_every: int
    chunk_steps: int
    preview_points: int


def ping(duration_s: float, dt_s: float) -> None:
    """Send at each deadline, and count how many were late."""
    node = _node("ping")
    sent = 0
    message = Odometry()
    publisher = node.create_publisher(Odometry, "ping", 1000)
    subscription = node.create_subscription(JointState, "pong", lambda _: None, 1000)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while not (publisher.get_subscription_count() and subscription.get_publisher_count()):
        executor.spin_once(timeout_sec=0.05)
    began, lateness = time.monotonic(), []
    count = int(duration_s / dt_s)
    while sent < count:
        due = began + (sent + 1) * dt_s
        while (left := due - time.monotonic()) > 0.0:
            executor.spin_once(timeout_sec=left)
        executor.spin_once(timeout_sec=0.0)
        lateness.append(time.monotonic() - due)
        message.header.stamp.sec = sent
        publisher.publish(message)
        sent += 1
    late = sum(seconds > dt_s for seconds in lateness)
    print(json.dumps({"count": count, "late": late}))
    rclpy.try_shutdown()


def pong() -> None:
    """Answer."""
    node = _node("pong")
    answer = JointState(name=["a", "b", "c", "d"], position=[0.0] * 4)
    publisher = node.create_publisher(JointState, "pong", 1000)

    def on_ping(message: Any) -> None:
        answer.header.stamp = message.header.stamp
        publisher.publish(answer)

    node.create_subscription(Odometry, "ping", on_ping, 1000)
    _spin(node)


def plant(loop: Loop) -> None:
    """Send state and clock, and what was applied, whenever the command for the state sent last is there."""
    node = _node(topics.PLANT)
    state, clock = Odometry(), Clock()
    applied, joints = _joint_state(loop.control_names), _joint_state(loop.joint_names)
    publish = {t: _publisher(node, t) for t in (topics.STATE, topics.CLOCK, topics.APPLIED_COMMAND)}
    joint_states = _publisher(node, topics.JOINT_STATES)
    sent_at_ns: list[int] = []

    def send_state() -> None:
        k = len(sent_at_ns)
        clock.clock.sec, clock.clock.nanosec = divmod(k * loop.dt_ns, 10**9)
        state.header.stamp = clock.clock
        sent_at_ns.append(time.time_ns())
        publish[topics.STATE].publish(state)
        publish[topics.CLOCK].publish(clock)

    def on_command(message: Any) -> None:
        if message.header.stamp != state.header.stamp or len(sent_at_ns) > loop.steps:
            return
        applied.header.stamp = message.header.stamp
        k = len(sent_at_ns) - 1
        send_state()
        publish[topics.APPLIED_COMMAND].publish(applied)
        if k % loop.joint_states_every == 0:
            joints.header.stamp = applied.header.stamp
            joint_states.publish(joints)

    def repeat() -> None:
        """The first states may be sent before the controller is connected in both directions."""
        if len(sent_at_ns) == 1:
            publish[topics.STATE].publish(state)

    node.create_subscription(topics.COMMAND.type, topics.COMMAND.name, on_command, topics.COMMAND.qos)
    listeners = {**publish, topics.JOINT_STATES: joint_states}
    while any(p.get_subscription_count() < 1 + len(t.subscribers) for t, p in listeners.items()):
        time.sleep(0.05)
    node.create_timer(1.0, repeat)
    send_state()
    _spin(node, until=lambda: len(sent_at_ns) > loop.steps)
    print(json.dumps(sent_at_ns))


def controller(loop: Loop) -> None:
    """Answer each state with a command and telemetry; receive the reference."""
    node = _node(topics.CONTROLLER)
    command, telemetry = _joint_state(loop.control_names), _joint_state(loop.telemetry_names)
    commands, telemetries = _publisher(node, topics.COMMAND), _publisher(node, topics.TELEMETRY)

    def on_state(message: Any) -> None:
        command.header.stamp = telemetry.header.stamp = message.header.stamp
        commands.publish(command)
        telemetries.publish(telemetry)

    _subscribe(node, topics.STATE, on_state)
    _subscribe(node, topics.REFERENCE_PREVIEW, lambda _: None)
    _spin(node)


def reference(loop: Loop) -> None:
    """A setpoint for each clock message, a preview every so often."""
    node = _node(topics.REFERENCE)
    setpoint = JointState(name=["yaw_rate"], position=[0.0])
    points = [JointTrajectoryPoint(positions=[0.0]) for _ in range(loop.preview_points)]
    preview = JointTrajectory(joint_names=["yaw_rate"], points=points)
    setpoints, previews = _publisher(node, topics.SETPOINT), _publisher(node, topics.REFERENCE_PREVIEW)
    received = 0

    def on_clock(message: Any) -> None:
        nonlocal received
        if received % loop.chunk_steps == 0:
            preview.header.stamp = message.clock
            previews.publish(preview)
        setpoint.header.stamp = message.clock
        setpoints.publish(setpoint)
        received += 1

    _subscribe(node, topics.CLOCK, on_clock)
    _spin(node)


def recorder() -> None:
    """Take the bytes of every message of every topic, by callbacks."""
    node = _node(topics.RECORDER)
    for topic in topics.RECORDED:
        node.create_subscription(topic.type, topic.name, lambda _: None, topic.qos, raw=True)
    _spin(node)


def _node(name: str) -> Any:
    rclpy.init()
    return rclpy.create_node(name, namespace=topics.NAMESPACE)


def _publisher(node: Any, topic: Any) -> Any:
    return node.create_publisher(topic.type, topic.name, topic.qos)


def _subscribe(node: Any, topic: Any, callback: Callable[[Any], None]) -> None:
    node.create_subscription(topic.type, topic.name, callback, topic.qos)


def _joint_state(names: list[str]) -> Any:
    return JointState(name=names, position=[0.0] * len(names))


def _spin(node: Any, until: Callable[[], bool] = lambda: False) -> None:
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        while node.context.ok() and not until():
            executor.spin_once()
    rclpy.try_shutdown()


def main(role: str, arguments: list[str]) -> None:
    """One node, until it is ended or done."""
    if role == "ping":
        ping(float(arguments[0]), float(arguments[1]))
    elif role == "pong":
        pong()
    elif role == "recorder":
        recorder()
    else:
        nodes = {"plant": plant, "controller": controller, "reference": reference}
        nodes[role](Loop(*json.loads(arguments[0])))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])

# SPDX-License-Identifier: Apache-2.0
"""A plant of your own: publishes state and clock, steps on the command that carries the state's stamp.

ros2 run skydiver_utc reference_node & ros2 run skydiver_utc controller_node & python examples/own_node/plant.py 400
kill %1 %2    # ends the other two, which wait for another run

After 400 steps the reference is 5.987 rad/s. The controller predicts a skydiver, not this plant: an error is left.
"""

import sys

import rclpy
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

EPOCH_NS, DT_NS = 1_767_225_600_000_000_000, 4_200_000  # epoch_s and dt_s of the scenario
rclpy.init()
node = rclpy.create_node("own_plant", namespace="skydiver")
states, clocks = node.create_publisher(Odometry, "state", 10), node.create_publisher(Clock, "/clock", 10)
applied = node.create_publisher(JointState, "applied_command", 10)
state, k = Odometry(child_frame_id="body"), 0
state.header.frame_id, state.twist.twist.linear.z = "world", -55.0  # falls on its belly at 55 m/s


def publish() -> None:
    state.header.stamp.sec, state.header.stamp.nanosec = divmod(EPOCH_NS + k * DT_NS, 10**9)
    states.publish(state)
    clocks.publish(Clock(clock=state.header.stamp))


def on_command(command: JointState) -> None:
    global k
    if command.header.stamp == state.header.stamp:
        applied.publish(command)
        rate, u = state.twist.twist.angular, dict(zip(command.name, command.position, strict=True))
        rate.z, k = rate.z + DT_NS * 1e-9 * (7.5 * u["alpha"] - 3.8 * u["Cm_damp_yaw"] * rate.z), k + 1
        publish()


node.create_subscription(JointState, "command", on_command, 10)
while states.get_subscription_count() == 0 or node.count_publishers("command") == 0:
    rclpy.spin_once(node, timeout_sec=0.1)
publish()
while k < int(sys.argv[1]):
    rclpy.spin_once(node)
print(f"{k} steps, yaw rate {state.twist.twist.angular.z:.3f} rad/s")

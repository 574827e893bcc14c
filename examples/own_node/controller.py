# SPDX-License-Identifier: Apache-2.0
"""A controller of your own: answers each state with a command that carries the state's stamp.

python examples/own_node/controller.py    # each in a terminal; the plant ends by itself, the others by control-C
ros2 run skydiver_utc reference_node
ros2 run skydiver_utc plant_node
"""

import rclpy
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState

CONTROLS = ["Cm_damp_yaw", "k_right", "k_left", "alpha"]
GAIN = 0.05  # rad of alpha per rad/s of error


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("own_controller", namespace="skydiver")
    commands = node.create_publisher(JointState, "command", 10)
    wanted_yaw_rate = 0.0

    def on_setpoint(message: JointState) -> None:
        nonlocal wanted_yaw_rate
        wanted_yaw_rate = message.position[message.name.index("yaw_rate")]

    def on_state(message: Odometry) -> None:
        error = wanted_yaw_rate - message.twist.twist.angular.z
        command = JointState(name=CONTROLS, position=[0.5, 0.0, 0.0, GAIN * error])
        command.header.stamp = message.header.stamp
        commands.publish(command)

    node.create_subscription(JointState, "reference/setpoint", on_setpoint, 10)
    node.create_subscription(Odometry, "state", on_state, 10)
    rclpy.spin(node)


if __name__ == "__main__":
    main()

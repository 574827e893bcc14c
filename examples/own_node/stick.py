# SPDX-License-Identifier: Apache-2.0
"""A reference of your own: a stick that sends the yaw rate wanted; the reference node makes the previews.

python examples/own_node/stick.py 2.0
ros2 run skydiver_utc reference_node --ros-args -p scenario:=examples/own_node/stick.yaml
ros2 run skydiver_utc controller_node --ros-args -p scenario:=examples/own_node/stick.yaml
ros2 run skydiver_utc plant_node --ros-args -p scenario:=examples/own_node/stick.yaml
"""

import sys

import rclpy
from geometry_msgs.msg import TwistStamped


def main() -> None:
    yaw_rate = float(sys.argv[1])  # rad/s, positive to the left
    rclpy.init()
    node = rclpy.create_node("stick", namespace="skydiver")
    publisher = node.create_publisher(TwistStamped, "stick", 10)

    def send() -> None:
        message = TwistStamped()
        message.header.stamp = node.get_clock().now().to_msg()
        message.twist.angular.z = yaw_rate
        publisher.publish(message)

    node.create_timer(0.1, send)
    rclpy.spin(node)


if __name__ == "__main__":
    main()

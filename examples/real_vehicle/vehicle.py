# SPDX-License-Identifier: Apache-2.0
"""A vehicle that knows nothing of this package: a flyer in a wind tunnel with its own clock, frames and messages.

It publishes `odom` (nav_msgs/Odometry, frames `tunnel` and `flyer`) a hundred times a second and obeys `cmd_vel`
(geometry_msgs/Twist): angular.z turns it. Without commands for half a second it turns no more.
"""

import math
import random
import time
from contextlib import suppress

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

PERIOD_S = 0.01
WIND_M_S = 55.0


class Vehicle(Node):
    """Integrates its yaw and publishes it."""

    def __init__(self) -> None:
        super().__init__("vehicle")
        self.yaw = self.yaw_rate = self.turn = 0.0
        self.commanded_at = -math.inf
        self.noise = random.Random(1)
        self.odometry = self.create_publisher(Odometry, "odom", 10)
        self.create_subscription(Twist, "cmd_vel", self.on_command, 10)
        self.create_timer(PERIOD_S, self.update)

    def on_command(self, command: Twist) -> None:
        self.turn, self.commanded_at = command.angular.z, time.monotonic()

    def update(self) -> None:
        turn = self.turn if time.monotonic() - self.commanded_at < 0.5 else 0.0
        self.yaw_rate += PERIOD_S * (50.0 * turn - 2.0 * self.yaw_rate)
        self.yaw += PERIOD_S * self.yaw_rate
        message = Odometry(child_frame_id="flyer")
        message.header.frame_id = "tunnel"
        message.header.stamp = self.get_clock().now().to_msg()
        message.pose.pose.orientation.z = round(math.sin(self.yaw / 2.0), 4)
        message.pose.pose.orientation.w = round(math.cos(self.yaw / 2.0), 4)
        message.twist.twist.linear.z = -WIND_M_S
        message.twist.twist.angular.z = self.yaw_rate + self.noise.gauss(0.0, 0.002)
        self.odometry.publish(message)


def main() -> None:
    rclpy.init()
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Vehicle())


if __name__ == "__main__":
    main()

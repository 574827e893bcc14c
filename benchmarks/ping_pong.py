"""The bare pair of rclpy processes that the real-time mode is measured against: no work, one message each way.

``ping`` sends an Odometry at each deadline of the steady clock and prints how late it was and how many answers
were not there a step later; ``pong`` answers each with a JointState from a plain callback until it is ended.
"""

import json
import sys
import time
from collections.abc import Callable
from typing import Any


def paced_lateness(duration_s: float, dt_s: float, work: Callable[[], object]) -> list[float]:
    """Call `work` at each multiple of dt_s; by how much each wake-up was late [s]."""
    lateness = []
    began = time.monotonic()
    for k in range(1, int(duration_s / dt_s) + 1):
        due = began + k * dt_s
        time.sleep(max(0.0, due - time.monotonic()))
        lateness.append(time.monotonic() - due)
        work()
    return lateness


def ping(duration_s: float, dt_s: float) -> None:
    """Send, and count what comes back in time."""
    import rclpy
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import JointState

    rclpy.init()
    node = rclpy.create_node("ping")
    answered = -1
    sent = 0
    unanswered = 0
    message = Odometry()
    publisher = node.create_publisher(Odometry, "ping", 1000)

    def on_pong(pong: Any) -> None:
        nonlocal answered
        answered = pong.header.stamp.sec

    subscription = node.create_subscription(JointState, "pong", on_pong, 1000)
    executor = rclpy.executors.SingleThreadedExecutor()
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
        unanswered += answered < sent - 1
        message.header.stamp.sec = sent
        publisher.publish(message)
        sent += 1
    late = sum(seconds > dt_s for seconds in lateness)
    print(json.dumps({"count": count, "late": late, "unanswered": unanswered}))
    rclpy.try_shutdown()


def pong() -> None:
    """Answer."""
    import rclpy
    from nav_msgs.msg import Odometry
    from rclpy.executors import ExternalShutdownException
    from sensor_msgs.msg import JointState

    rclpy.init()
    node = rclpy.create_node("pong")
    answer = JointState(name=["a", "b", "c", "d"], position=[0.0] * 4)
    publisher = node.create_publisher(JointState, "pong", 1000)

    def on_ping(message: Any) -> None:
        answer.header.stamp = message.header.stamp
        publisher.publish(answer)

    node.create_subscription(Odometry, "ping", on_ping, 1000)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    if sys.argv[1] == "ping":
        ping(float(sys.argv[2]), float(sys.argv[3]))
    else:
        pong()

"""The loop of a node process: the callbacks that an executor would call, each once and in order."""

from collections.abc import Iterator

import pytest
from rcl_interfaces.srv import GetParameters
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from ros_fixtures import Ros
from std_msgs.msg import String

from skydiver_utc.nodes.direct_loop import DirectLoop
from skydiver_utc.nodes.polled import Polled, take_all

pytest_plugins = ("ros_fixtures",)

COUNT = 200


class Looped:
    """A node that is spun by a `DirectLoop`, a partner that is spun by the executor."""

    def __init__(self, ros: Ros) -> None:
        self.ros = ros
        self.node = Node("looped", context=ros.context)
        self.loop = DirectLoop(self.node)
        self.partner = ros.add(Node("partner", context=ros.context))
        self.sender = self.partner.create_publisher(String, "words", COUNT)

    def send(self, count: int = COUNT) -> None:
        self.ros.spin_until(self.sender.get_subscription_count)
        for i in range(count):
            self.sender.publish(String(data=str(i)))

    def spin_until(self, condition: object) -> None:
        def done() -> bool:
            self.loop.spin_once()
            return bool(condition())  # type: ignore[operator]

        self.ros.spin_until(done)


@pytest.fixture
def looped(ros: Ros) -> Iterator[Looped]:
    instance = Looped(ros)
    yield instance
    instance.loop.shutdown()
    instance.node.destroy_node()


def test_messages_come_once_and_in_order_whoever_takes_them(looped: Looped) -> None:
    """The executor takes some of them: it is asked every 50 ms, and a wait may last as long."""
    heard: list[str] = []
    looped.node.create_subscription(String, "words", lambda message: heard.append(message.data), COUNT)
    looped.send()
    looped.spin_until(lambda: len(heard) == COUNT)
    assert heard == [str(i) for i in range(COUNT)]


def test_a_polled_subscription_keeps_its_messages(looped: Looped) -> None:
    called: list[str] = []
    ticks: list[int] = []
    polled = looped.node.create_subscription(
        String, "words", lambda message: called.append(message.data), COUNT, callback_group=Polled()
    )
    looped.node.create_timer(0.01, lambda: ticks.append(1))
    looped.send()
    looped.spin_until(lambda: len(ticks) > 20)
    assert called == []
    assert [message.data for message in take_all(polled)] == [str(i) for i in range(COUNT)]


def test_services_are_answered_while_messages_pour_in(looped: Looped) -> None:
    looped.node.declare_parameter("answer", 42)
    looped.node.create_subscription(
        String, "words", lambda _: looped.sender.publish(String(data="again")), 10
    )
    client = looped.partner.create_client(GetParameters, "looped/get_parameters")
    looped.ros.spin_until(client.service_is_ready)
    looped.send(10)
    future = client.call_async(GetParameters.Request(names=["answer"]))
    looped.spin_until(future.done)
    assert future.result().values[0].integer_value == 42


def test_a_timer_that_a_callback_has_destroyed_is_not_called(looped: Looped) -> None:
    called: list[str] = []

    def one(name: str, other: str) -> None:
        called.append(name)
        looped.node.destroy_timer(timers[other])

    timers = {
        "a": looped.node.create_timer(0.02, lambda: one("a", "b")),
        "b": looped.node.create_timer(0.02, lambda: one("b", "a")),
    }
    looped.spin_until(lambda: len(called) > 5)
    assert len(set(called)) == 1


def test_it_ends_with_its_context(ros: Ros) -> None:
    node = Node("looped", context=ros.context)
    node.create_timer(10.0, lambda: None)
    loop = DirectLoop(node)
    loop.spin_once()
    ros.context.shutdown()
    with pytest.raises(ExternalShutdownException):
        loop.spin_once()
    node.destroy_node()

"""The loop of a node that has a process to itself: messages and timers at a fraction of the executor's cost.

For each callback rclpy's executor builds a wait set of everything that the node has, services and events included,
wraps the callback into a task, and wakes itself up once more. Here one wait set holds subscriptions and timers, and
what is ready is called at once. Services and events are left to the executor, which is asked now and then. The
callbacks are the same, so that nodes of one process can share an executor as well.
"""

import time
from collections.abc import Iterable
from typing import Any

from rclpy.exceptions import InvalidHandle
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.subscription import Subscription
from rclpy.timer import Timer

_EXECUTOR_PERIOD_S = 0.05


class DirectLoop:
    """Spins one node, which has at least one timer."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self._executor_due = time.monotonic()
        self._wait_set: Any = None
        self._size = (0, 0)

    def spin_once(self) -> None:
        """Call what is ready, after a wait of at most 50 ms; raises `ExternalShutdownException`."""
        timers, subscriptions = self._wait()
        for timer in timers:
            _call(timer)
        for subscription in subscriptions:
            _take(subscription)
        if time.monotonic() >= self._executor_due:
            self._executor.spin_once(timeout_sec=0.0)
            self._executor_due = time.monotonic() + _EXECUTOR_PERIOD_S

    def shutdown(self) -> None:
        """End the executor."""
        self._executor.shutdown()

    def _wait(self) -> tuple[list[Timer], list[Subscription]]:
        """The timers and the subscriptions that are ready."""
        timers = list(self._node.timers)
        subscriptions = [s for s in self._node.subscriptions if s.callback_group.can_execute(s)]
        wait_set = self._empty_wait_set(len(subscriptions), len(timers))
        for timer in timers:
            wait_set.add_timer(timer.handle)
        for subscription in subscriptions:
            wait_set.add_subscription(subscription.handle)
        wait_set.wait(max(0, int((self._executor_due - time.monotonic()) * 1e9)))
        if not self._node.context.ok():
            raise ExternalShutdownException
        return (
            _ready(timers, wait_set.get_ready_entities("timer")),
            _ready(subscriptions, wait_set.get_ready_entities("subscription")),
        )

    def _empty_wait_set(self, subscriptions: int, timers: int) -> Any:
        if (subscriptions, timers) != self._size:
            self._size = (subscriptions, timers)
            context = self._node.context.handle
            with context:
                self._wait_set = rclpy_implementation.WaitSet(subscriptions, 0, timers, 0, 0, 0, context)
        self._wait_set.clear_entities()
        return self._wait_set


def _ready(entities: Iterable[Any], pointers: Iterable[int]) -> list[Any]:
    return [entity for entity in entities if entity.handle.pointer in pointers]


def _call(timer: Timer) -> None:
    try:
        with timer.handle:
            if not timer.handle.is_timer_ready():
                return
            timer.handle.call_timer()
    except InvalidHandle:  # a callback before this one has destroyed it
        return
    timer.callback()


def _take(subscription: Subscription) -> None:
    try:
        with subscription.handle:
            taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
    except InvalidHandle:
        return
    if taken is not None:
        subscription.callback(taken[0])

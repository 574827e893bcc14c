"""Subscriptions that are drained in bulk instead of by callbacks: at a fraction of the executor's cost."""

from collections.abc import Iterator
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.subscription import Subscription


class Polled(CallbackGroup):
    """Keeps its subscriptions out of the executor."""

    def can_execute(self, entity: object) -> bool:
        """Never: `take_all` takes their messages."""
        return False

    def beginning_execution(self, entity: object) -> bool:
        """Never."""
        return False

    def ending_execution(self, entity: object) -> None:
        """Nothing to do."""


def take_all(subscription: Subscription) -> Iterator[Any]:
    """The messages that wait in a subscription, oldest first."""
    handle = subscription.handle
    with handle:
        while (taken := handle.take_message(subscription.msg_type, False)) is not None:
            yield taken[0]

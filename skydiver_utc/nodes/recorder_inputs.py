# SPDX-License-Identifier: Apache-2.0
"""The subscriptions of a recorder, one for each topic of the table.

They are polled for serialized messages: a callback for each message costs a recorder twice as much CPU (1.3 s instead
of 0.65 s for 24 000 messages), and rclpy's EventsExecutor cannot hand serialized messages and their send times to a
callback: it raises SystemError.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.type_support import check_is_valid_msg_type

from skydiver_utc.nodes.topics import EACH_STEP, Topic

_DEPTH = 2 * EACH_STEP.depth  # the whole history of a publisher at once, and the messages during that
_UNKNOWN_NODE = "_NODE_NAME_UNKNOWN_"  # of a publisher whose node is not discovered yet


class RawMessage(NamedTuple):
    """A serialized message and the time at which it was sent [ns, Unix time of the sender]."""

    cdr: bytes
    sent_at_ns: int


class RecorderInput:
    """A topic of the table; subscribed at once, or, where several types are possible, with its first publisher.

    No executor waits for the subscription.
    """

    def __init__(self, node: Node, topic: Topic) -> None:
        self.topic = topic
        self.name = node.resolve_topic_name(topic.name)
        self.channel_id = 0  # in the bag, 0 while there is none
        self.count = 0  # messages written
        self._node = node
        self._handle: Any = None
        self._types = {topic.of_type(each).type_name: each for each in topic.types or (topic.type,)}
        self._reported: set[str] = set()
        self.subscribe()

    @property
    def subscribed(self) -> bool:
        """True once its type is known."""
        return self._handle is not None

    def subscribe(self) -> bool:
        """Subscribe if that is possible; True when it has just been done."""
        if self.subscribed:
            return False
        types = list(self._types)
        if len(types) > 1:
            publishers = self._node.get_publishers_info_by_topic(self.name)
            types = [each.topic_type for each in publishers if each.topic_type in self._types]
        if not types:
            return False
        self.topic = self.topic.of_type(self._types[types[0]])
        self._types = {types[0]: self.topic.type}
        check_is_valid_msg_type(self.topic.type)  # loads its type support
        qos = self.topic.qos
        profile = QoSProfile(depth=_DEPTH, reliability=qos.reliability, durability=qos.durability)
        with self._node.handle:
            self._handle = rclpy_implementation.Subscription(
                self._node.handle, self.topic.type, self.topic.name, profile.get_c_qos_profile()
            )
        return True

    @property
    def matched(self) -> bool:
        """True when there is a publisher."""
        if not self.subscribed:
            return False
        with self._handle:
            return int(self._handle.get_publisher_count()) > 0

    def take_all(self) -> Iterator[RawMessage]:
        """The messages since the last call, oldest first."""
        if not self.subscribed:
            return
        with self._handle:
            while (taken := self._handle.take_message(self.topic.type, True)) is not None:
                cdr, info = taken
                yield RawMessage(cdr, info["source_timestamp"])

    def wrong_types(self) -> Iterator[str]:
        """One sentence for each type of publisher that cannot be recorded; each only once, with the node's name."""
        for publisher in self._node.get_publishers_info_by_topic(self.name):
            type_name = publisher.topic_type
            known = type_name in self._types or type_name in self._reported
            if known or publisher.node_name == _UNKNOWN_NODE:
                continue
            self._reported.add(type_name)
            yield (
                f"the node {publisher.node_name} publishes {self.topic.name} as {type_name}, not as"
                f" {' or '.join(self._types)}: its messages are not recorded"
            )

    def destroy(self) -> None:
        """Unsubscribe."""
        if self.subscribed:
            self._handle.destroy_when_not_in_use()
            self._handle = None

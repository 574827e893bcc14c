# SPDX-License-Identifier: Apache-2.0
"""The subscriptions of a recorder, one for each topic of the table."""

from collections import deque
from collections.abc import Iterator

from rclpy.node import Node
from rclpy.qos import QoSProfile

from skydiver_utc.nodes import topics
from skydiver_utc.nodes.raw_subscription import RawMessage, RawSubscription
from skydiver_utc.nodes.topics import EACH_STEP, Topic

_DEPTH = 2 * EACH_STEP.depth  # the whole history of a publisher at once, and the messages during that
_UNKNOWN_NODE = "_NODE_NAME_UNKNOWN_"  # of a publisher whose node is not discovered yet

# Topics whose type depends on the plant and the settings; all others have the type of the table.
_TYPES = {
    topics.STATE: tuple(topics.STATE_TYPES.values()),
    topics.COMMAND: tuple(topics.COMMAND_TYPES.values()),
}


class RecorderInput:
    """A topic of the table; subscribed at once, or, where several types are possible, with its first publisher."""

    def __init__(self, node: Node, topic: Topic) -> None:
        self.topic = topic
        self.subscription: RawSubscription | None = None
        self.channel_id = 0  # in the bag, 0 while there is none
        self.count = 0  # messages written
        # While nothing is recorded: the messages that a late subscriber would still get.
        self.latched: deque[RawMessage] = deque(maxlen=topic.qos.depth if topic.latched else 0)
        self._node = node
        self._name = node.resolve_topic_name(topic.name)
        self._types = {topic.of_type(each).type_name: each for each in _TYPES.get(topic, (topic.type,))}
        self._reported: set[str] = set()
        self.subscribe()

    def subscribe(self) -> bool:
        """Subscribe if that is possible; True when it has just been done."""
        if self.subscription is not None:
            return False
        types = list(self._types)
        if len(types) > 1:
            publishers = self._node.get_publishers_info_by_topic(self._name)
            types = [each.topic_type for each in publishers if each.topic_type in self._types]
        if not types:
            return False
        self.topic = self.topic.of_type(self._types[types[0]])
        self._types = {types[0]: self.topic.type}
        qos = self.topic.qos
        profile = QoSProfile(depth=_DEPTH, reliability=qos.reliability, durability=qos.durability)
        self.subscription = RawSubscription(self._node, self.topic.type, self.topic.name, profile)
        return True

    @property
    def matched(self) -> bool:
        """True when there is a publisher."""
        return self.subscription is not None and self.subscription.publisher_count() > 0

    def take_all(self) -> Iterator[RawMessage]:
        """The messages since the last call."""
        return iter(()) if self.subscription is None else self.subscription.take_all()

    def wrong_types(self) -> Iterator[str]:
        """One sentence for each type of publisher that cannot be recorded; each only once, with the node's name."""
        for publisher in self._node.get_publishers_info_by_topic(self._name):
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
        if self.subscription is not None:
            self.subscription.destroy()
            self.subscription = None

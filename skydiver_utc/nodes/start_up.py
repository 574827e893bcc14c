"""What a plant waits for before step 0, in words."""

from collections.abc import Callable

from rclpy.publisher import Publisher
from rclpy.subscription import Subscription

from skydiver_utc.nodes.scenario_node import ScenarioNode


class StartUp:
    """Looks for those who take part in a plant's flight; `missing_of_clock` tells what its clock waits for."""

    def __init__(
        self,
        node: ScenarioNode,
        commands: Subscription,
        states: Publisher,
        missing_of_clock: Callable[[], list[str]],
    ) -> None:
        self.recorder_ready = not node.own["wait_for_recorder"]
        self._node, self._commands, self._states = node, commands, states
        self._missing_of_clock = missing_of_clock

    def missing(self) -> list[str]:
        """What the flight still waits for; asks the dearer questions last."""
        missing = []
        if not self.recorder_ready:
            missing.append("no recorder that hears every topic")
        if self._commands.get_publisher_count() == 0:
            missing.append("no publisher of command")
        if unmatched := self._node.unmatched():
            missing.append(f"no listener, or too few, on {', '.join(unmatched)}")
        if not missing and not self._controller_listens():
            missing.append("no controller that listens to state")
        return missing + self._missing_of_clock()

    def phrase(self) -> str:
        """What is missing, in one phrase; where all are there it is the clock that has not begun."""
        return " and ".join(self.missing() or ["no step 0 of the clock"])

    def say_what_is_missing(self) -> None:
        """Warn of it."""
        self._node.get_logger().warning(f"waiting: there is {self.phrase()}")

    def _controller_listens(self) -> bool:
        """True when some node that publishes commands listens to the state, not only some spectator."""
        commanders = self._node.get_publishers_info_by_topic(self._commands.topic_name)
        names = {(node.node_namespace, node.node_name) for node in commanders}
        listeners = self._node.get_subscriptions_info_by_topic(self._states.topic_name)
        return any((node.node_namespace, node.node_name) in names for node in listeners)

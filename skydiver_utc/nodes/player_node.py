# SPDX-License-Identifier: Apache-2.0
"""The player as a node: publishes a recording again, byte for byte and in order, at any rate, with `/clock`."""

import importlib
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSDurabilityPolicy, QoSProfile, QoSReliabilityPolicy
from rosgraph_msgs.msg import Clock as ClockMessage

from skydiver_utc.nodes.lifecycle import RefusedError, destroyed_on_error
from skydiver_utc.nodes.node import given_parameters, wait_for_subscribers
from skydiver_utc.nodes.topics import EACH_STEP
from skydiver_utc.parameters import ParameterError
from skydiver_utc.parameters.nanoseconds import NANOSECONDS
from skydiver_utc.parameters.nodes import PlayerNodeSettings, resolve_player
from skydiver_utc.recording.metadata import recorded_qos_profiles
from skydiver_utc.recording.playback import CLOCK_TYPE, Item, Playback, chosen, in_order
from skydiver_utc.recording.reader import RecordedTopic, read_bag
from skydiver_utc.recording.schemas import type_hash

_CLOCK = "/clock"
_TICK_S = 0.002
_BATCH = 200  # messages in one tick, so that a signal is answered while it catches up
_SHORTEST_DISCOVERY_S, _NOBODY_S, _LONGEST_DISCOVERY_S = 1.0, 5.0, 10.0
_ACKNOWLEDGEMENT_S = 5.0
_DEPTH = 1000


class PlayerNode(Node):
    """Plays the bag of its parameter `run`; `finished` when all is sent and it does not loop.

    `/clock` is published if the bag has no clock. A clock that another node publishes already is an error.
    """

    def __init__(
        self,
        context: Context | None = None,
        overrides: Mapping[str, object] | None = None,
        look_s: float = 0.0,
    ) -> None:
        super().__init__("player", context=context)
        with destroyed_on_error(self):
            self._open(resolve_player(given_parameters(self) | dict(overrides or {})), look_s)

    def _open(self, settings: PlayerNodeSettings, look_s: float) -> None:
        self.finished, self.refused = False, ""
        folder = Path(settings.run)
        topics = chosen(read_bag(folder), settings.topics)
        self.items = in_order(topics)
        times = np.array([item.log_time_ns for item in self.items])
        self._playback = Playback(times, settings.rate, settings.start_s, settings.loop)
        clocks = [name for name, topic in topics.items() if topic.type_name == CLOCK_TYPE] or [_CLOCK]
        self._refuse_other_clock(clocks, look_s)
        self._publishers_by_topic = {
            name: self.create_publisher(_message_class(topic), name, _quality(topic))
            for name, topic in topics.items()
        }
        recorded_clock = clocks[0] in topics
        self._clock = None if recorded_clock else self.create_publisher(ClockMessage, _CLOCK, EACH_STEP)
        self._clock_ns = -1
        self.not_sent: Counter[str] = Counter()  # by topic: messages that the middleware rejects
        self._publish_latched()
        self._opened_at_s = time.monotonic()
        self._begun = False
        self.create_timer(_TICK_S, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.get_logger().info(f"{len(self.items)} messages of {folder}, {self._playback.duration_s:.3f} s")

    def close(self) -> int:
        """Wait until the subscribers have acknowledged everything; returns the exit code."""
        wait_for_subscribers(self, self._publishers_by_topic.values(), _ACKNOWLEDGEMENT_S)
        for name, count in self.not_sent.items():
            self.get_logger().warning(
                f"{count} messages of {name} were not sent: their bytes are not of its type"
            )
        return 0

    def _tick(self) -> None:
        self._begun = self._begun or self._discovered()
        if not self._begun:
            return
        for place in self._playback.due(time.monotonic(), _BATCH):
            item = self.items[place]
            if self._clock is not None and item.log_time_ns != self._clock_ns:
                self._clock_ns = item.log_time_ns
                message = ClockMessage()
                message.clock.sec, message.clock.nanosec = divmod(item.log_time_ns, NANOSECONDS)
                self._clock.publish(message)
            self._publish(item)
        self.finished = self._playback.finished

    def _publish(self, item: Item) -> None:
        """Publish the recorded bytes; the middleware rejects bytes too long for a type of fixed length."""
        try:
            self._publishers_by_topic[item.topic].publish(item.cdr)
        except rclpy_implementation.RCLError:
            self.not_sent[item.topic] += 1

    def _publish_latched(self) -> None:
        """Publish the latched messages from before the start."""
        earlier = self.items[: self._playback.first]
        for name, publisher in self._publishers_by_topic.items():
            profile = publisher.qos_profile
            if profile.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL:
                for item in [item for item in earlier if item.topic == name][-profile.depth :]:
                    self._publish(item)

    def _discovered(self) -> bool:
        """True when all subscribers are matched; after five seconds without any, after ten in any case."""
        waited_s = time.monotonic() - self._opened_at_s
        pairs = [
            (publisher.get_subscription_count(), self.count_subscribers(name))
            for name, publisher in self._publishers_by_topic.items()
        ]
        matched = all(count >= known for count, known in pairs)
        shortest_s = _SHORTEST_DISCOVERY_S if any(count for count, _ in pairs) else _NOBODY_S
        return waited_s > _LONGEST_DISCOVERY_S or (waited_s > shortest_s and matched)

    def _refuse_other_clock(self, clocks: Sequence[str], look_s: float) -> None:
        deadline = time.monotonic() + look_s
        while not (taken := [name for name in clocks if self.count_publishers(name)]):
            if time.monotonic() >= deadline:
                return
            time.sleep(0.02)
        raise RefusedError(
            f"{taken[0]} has a publisher already, a run or another replay: end it, or set another ROS_DOMAIN_ID"
        )


def _message_class(topic: RecordedTopic) -> Any:
    """The installed class of the recorded type, unless that was recorded with another definition than ROS 2 Jazzy's."""
    package, _, name = topic.type_name.partition("/msg/")
    try:
        found = getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError) as error:
        raise ParameterError(
            f"{topic.name} has the type {topic.type_name}, which is not installed: install it or leave it out"
        ) from error
    if topic.type_hash and type_hash(topic.type_name) not in ("", topic.type_hash):
        raise ParameterError(
            f"{topic.name} was recorded with another definition of {topic.type_name} than ROS 2 Jazzy's: play"
            " it where it was recorded, or choose other topics"
        )
    return found


def _quality(topic: RecordedTopic) -> QoSProfile:
    """The offered quality of service; reliable, volatile and deep where the bag has none that can be used."""
    profile = next(iter(recorded_qos_profiles(topic.qos_profiles_yaml)), {})
    depth = profile.get("depth")
    latched = profile.get("durability") == "transient_local"
    best_effort = profile.get("reliability") == "best_effort"
    return QoSProfile(
        depth=depth if isinstance(depth, int) and 0 < depth <= _DEPTH else _DEPTH,
        durability=QoSDurabilityPolicy.TRANSIENT_LOCAL if latched else QoSDurabilityPolicy.VOLATILE,
        reliability=QoSReliabilityPolicy.BEST_EFFORT if best_effort else QoSReliabilityPolicy.RELIABLE,
    )

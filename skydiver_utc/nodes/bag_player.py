"""A recording sent again as a node: the recorded bytes, in order, at any rate, with `/clock`."""

import importlib
import json
import signal
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSDurabilityPolicy, QoSProfile, QoSReliabilityPolicy
from rosgraph_msgs.msg import Clock as ClockMessage
from std_srvs.srv import SetBool

from skydiver_utc.nodes.topics import EACH_STEP
from skydiver_utc.parameters import ParameterError
from skydiver_utc.recording.errors import RecordingError
from skydiver_utc.recording.metadata import parse_qos_profiles
from skydiver_utc.recording.namespace import namespace_of
from skydiver_utc.recording.playback import Item, Playback, in_order
from skydiver_utc.recording.reader import RecordedTopic, read_bag
from skydiver_utc.recording.schemas import message_schema

_CLOCK = "/clock"
_TICK_S = 0.002
_BATCH = 200  # messages in one tick, so that a service call is heard while it catches up
_REPORT_S = 0.2
_DISCOVERY_S = 4.0  # those who listen already announce themselves every 3 s
_LONGEST_DISCOVERY_S = 10.0
_LAST_ACKNOWLEDGEMENT_S = 5.0
_DEPTH = 1000


class PlayerNode(Node):
    """Plays the bag of its parameter `run`; the service `~/pause` (std_srvs/SetBool) halts it and lets it go on.

    It has finished when all is sent and it does not loop. With `attended` it prints where it is as JSON lines and
    takes the signal SIGUSR1 for the other way round of pausing.
    """

    def __init__(self, context: Context | None = None, overrides: Mapping[str, object] | None = None) -> None:
        given = [Parameter(name, value=value) for name, value in (overrides or {}).items()]
        super().__init__("player", context=context, parameter_overrides=given)
        try:
            self._open()
        except (ParameterError, RecordingError):
            self.destroy_node()
            raise

    def _open(self) -> None:
        self.finished = False
        self.refused = ""  # what makes it end with a sentence
        run = Path(self._parameter("run", ""))
        topics = _chosen(read_bag(run), [name for name in self._parameter("topics", [""]) if name])
        self.items = in_order(topics)
        times = np.array([item.log_time_ns for item in self.items])
        rate, start_s = self._parameter("rate", 1.0), self._parameter("start_s", 0.0)
        self._loop = self._parameter("loop", False)
        self.playback = Playback(times, rate, start_s, self._loop)
        self._waits = self._parameter("paused", False)
        self._discovery_s = self._parameter("discovery_s", _DISCOVERY_S)
        self._publishers_by_topic = {name: self._advertise(topic) for name, topic in topics.items()}
        self._clock_made = (
            None if _CLOCK in topics else self.create_publisher(ClockMessage, _CLOCK, EACH_STEP)
        )
        self._clock_told_ns = -1
        self.not_sent: Counter[str] = Counter()  # by topic, messages that the middleware does not take
        self._send_latched()
        self.create_service(SetBool, "~/pause", self.on_pause)
        self._began_at = time.monotonic()
        self._begun = False
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(_TICK_S, self._tick, clock=steady)
        self._attended = self._parameter("attended", False)
        if self._attended:
            self.create_timer(_REPORT_S, self._report, clock=steady)
            signal.signal(signal.SIGUSR1, lambda *_: self.pause(not self.paused))
        self.get_logger().info(f"{len(self.items)} messages of {run}, {self.playback.duration_s:.3f} s")

    @property
    def paused(self) -> bool:
        """True while it stands still because somebody wants it to."""
        return self.playback.paused if self._begun else self._waits

    def pause(self, wanted: bool) -> None:
        """Stand still, or go on; before the first message only what is wanted is noted."""
        if not self._begun:
            self._waits = wanted
        elif wanted:
            self.playback.pause(time.monotonic())
        else:
            self.playback.resume(time.monotonic())

    def on_pause(self, request: Any, response: Any) -> Any:
        """The service: true pauses, false goes on."""
        self.pause(request.data)
        response.success = True
        response.message = f"{'paused' if request.data else 'playing'} at {self._position_s():.3f} s"
        return response

    def close(self) -> int:
        """Wait until the listeners have everything; returns the exit code."""
        deadline = time.monotonic() + _LAST_ACKNOWLEDGEMENT_S
        for name, publisher in self._publishers_by_topic.items():
            left_s = max(0.0, deadline - time.monotonic())
            if not publisher.wait_for_all_acked(Duration(seconds=left_s)):
                self.get_logger().warning(f"a listener of {name} did not acknowledge everything")
        for name, count in self.not_sent.items():
            self.get_logger().warning(f"{count} messages of {name} cannot be sent, they are none of its type")
        if self._attended:
            self._report()
        return 0

    def _tick(self) -> None:
        if not self._begun:
            if self._waits or not self._discovered():
                return
            if self.count_publishers(_CLOCK) > 1:
                self.refused = (
                    f"{_CLOCK} has another publisher, a flight or a replay goes on: end it, or play on another"
                    " ROS_DOMAIN_ID"
                )
                self.finished = True
                return
            self._begun = True
            self.pause(False)
        for place in self.playback.due(time.monotonic(), _BATCH):
            self._send(self.items[place])
        self.finished = self.playback.finished and not self._loop

    def _send(self, item: Item) -> None:
        if self._clock_made is not None and item.log_time_ns != self._clock_told_ns:
            self._clock_told_ns = item.log_time_ns
            message = ClockMessage()
            message.clock.sec, message.clock.nanosec = divmod(item.log_time_ns, 1_000_000_000)
            self._clock_made.publish(message)
        self._publish(item)

    def _publish(self, item: Item) -> None:
        """Bytes that are no message are sent like others, but for those too long for a type of fixed length."""
        try:
            self._publishers_by_topic[item.topic].publish(item.cdr)
        except rclpy_implementation.RCLError:
            self.not_sent[item.topic] += 1

    def _send_latched(self) -> None:
        """What a late listener would have found when the part that is played begins."""
        earlier = self.items[: self.playback.first]
        for name, publisher in self._publishers_by_topic.items():
            profile = publisher.qos_profile
            if profile.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL:
                for item in [item for item in earlier if item.topic == name][-profile.depth :]:
                    self._publish(item)

    def _discovered(self) -> bool:
        """True when those who listen are connected, and for certain after some seconds."""
        waited_s = time.monotonic() - self._began_at
        connected = all(
            publisher.get_subscription_count() >= self.count_subscribers(name)
            for name, publisher in self._publishers_by_topic.items()
        )
        return waited_s > _LONGEST_DISCOVERY_S or (waited_s > self._discovery_s and connected)

    def _advertise(self, topic: RecordedTopic) -> Publisher:
        return self.create_publisher(_message_class(topic), topic.name, _quality(topic))

    def _parameter(self, name: str, default: Any) -> Any:
        """Declare a parameter; what was given for it, or its default."""
        return self.declare_parameter(name, default).value

    def _position_s(self) -> float:
        return self.playback.position_s(time.monotonic())

    def _report(self) -> None:
        line = {
            "position_s": self._position_s(),
            "duration_s": self.playback.duration_s,
            "paused": self.paused,
            "lap": self.playback.lap,
            "not_sent": self.not_sent,
        }
        with suppress(BrokenPipeError):
            print(json.dumps(line), flush=True)


def _chosen(recorded: Mapping[str, RecordedTopic], names: Sequence[str]) -> dict[str, RecordedTopic]:
    """The topics asked for, all without names; `/clock` always, since time is what others go by."""
    relative = [name for name in names if not name.startswith("/")]
    namespace = namespace_of(recorded) if relative else ""
    wanted = {f"{namespace}/{name}" if name in relative else name for name in names} or set(recorded)
    for name in sorted(wanted - recorded.keys()):
        raise ParameterError(
            f"the recording has no topic {name}: choose some of {', '.join(sorted(recorded))}"
        )
    return {name: topic for name, topic in recorded.items() if name in wanted or name == _CLOCK}


def _message_class(topic: RecordedTopic) -> Any:
    """The installed class of the recorded type, if its definition is still the same."""
    package, _, name = topic.type_name.partition("/msg/")
    try:
        found = getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError) as error:
        raise ParameterError(
            f"{topic.name} is of type {topic.type_name}, which is not installed: install it, or choose other topics"
        ) from error
    if topic.type_hash and message_schema(topic.type_name).type_hash != topic.type_hash:
        raise ParameterError(
            f"{topic.name} was recorded with another definition of {topic.type_name} than the installed one: play"
            " it where it was recorded, or choose other topics"
        )
    return found


def _quality(topic: RecordedTopic) -> QoSProfile:
    """As it was offered; reliable, volatile and deep where the bag does not tell."""
    profile = next(iter(parse_qos_profiles(topic.qos_profiles_yaml)), {})
    latched = profile.get("durability") == "transient_local"
    best_effort = profile.get("reliability") == "best_effort"
    return QoSProfile(
        depth=int(profile.get("depth") or _DEPTH),
        durability=QoSDurabilityPolicy.TRANSIENT_LOCAL if latched else QoSDurabilityPolicy.VOLATILE,
        reliability=QoSReliabilityPolicy.BEST_EFFORT if best_effort else QoSReliabilityPolicy.RELIABLE,
    )

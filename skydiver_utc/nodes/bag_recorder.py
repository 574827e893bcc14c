"""The recorder as a node: every topic, byte for byte, into a rosbag2 folder at simulated time."""

import json
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import NamedTuple

import yaml
from rclpy.callback_groups import CallbackGroup
from rclpy.context import Context
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from std_msgs.msg import String

from skydiver_utc.nodes import topics
from skydiver_utc.nodes.border import BorderError
from skydiver_utc.nodes.diagnostics import Health, Level
from skydiver_utc.nodes.end_of_flight import EndOfFlight
from skydiver_utc.nodes.messages import SETPOINT_AXES
from skydiver_utc.nodes.polled import Polled
from skydiver_utc.nodes.scenario_node import ScenarioNode
from skydiver_utc.nodes.topics import EACH_STEP, RECORDED, Topic, rosbag2_qos
from skydiver_utc.nodes.versions import versions
from skydiver_utc.parameters import to_yaml
from skydiver_utc.recording.errors import RecordingError
from skydiver_utc.recording.schemas import message_schema
from skydiver_utc.recording.stamps import leading_stamp_ns
from skydiver_utc.recording.writer import BagWriter

_POLL_S = 0.02
_DEPTH = 2 * EACH_STEP.depth  # a sender's whole history at once, and what comes meanwhile
_FLUSH_INTERVAL_S = 0.25  # a killed recorder loses this, the poll and the writing: well below half a second
_PATIENCE_S = 5.0
_QUIET_S = 0.1
_OUTCOME_S = 1.0  # the outcome of a flight that is being stopped together with its recorder
_SLOW_DISK_S = 2.0
_MOST_WAITING_BYTES = (
    256 * 1024**2
)  # some minutes of flight; beyond that a disk that stands still costs messages
_REPAIR_S = 10.0  # lost messages: the sender offers them again every three seconds


@dataclass
class _Channel:
    """One recorded topic: where its messages come from, where they go, how many there were."""

    topic: Topic
    subscription: Subscription
    id: int
    latched: deque[
        "_Message"
    ]  # what a late listener would still get, of those that came while nothing is recorded
    count: int = 0


class _Message(NamedTuple):
    log_time_ns: int
    channel_id: int
    data: bytes
    publish_time_ns: int


class RecorderNode(ScenarioNode):
    """Polls its subscriptions, writes what came, and tells the plant when it hears every topic.

    It has finished when it has heard the outcome of its flight (`EndOfFlight`). A recording that cannot go on, on a
    full disk, never stops a flight: `failure` says why, the messages are dropped, and the exit code is 1.

    Configured it has an open bag; active it records; inactive it counts in `not_recorded` what it lets pass.
    """

    def __init__(self, context: Context | None = None, overrides: Mapping[str, object] | None = None) -> None:
        super().__init__("recorder", context, overrides)
        self.folder = Path()
        self.failure = ""
        self.not_recorded = 0
        self._bag: BagWriter | None = None
        self._now_ns = self._first_ns = self.scenario.stamp_ns(0)
        self._channels: dict[Topic, _Channel] = {}
        self._wrong_types: set[tuple[str, str]] = set()
        self._ready = self.advertise(topics.RECORDER_READY)
        self._told_ready = True  # nothing is to be told before the recording begins
        self.every(_POLL_S, self._drain_each_poll)
        self.every(_PATIENCE_S, self._say_what_is_missing)
        self.start_unless_managed()

    def configure(self) -> None:
        """Open a new bag with every topic."""
        super().configure()
        self.folder = Path(str(self.own["bag_folder"]) or self._default_folder())
        self._started_at_ns = time.time_ns()
        self._end = EndOfFlight(_REPAIR_S, lambda error: self.refusals.add(topics.OUTCOME.name, error))
        self._now_ns = self._first_ns
        self._last_ns = self.scenario.stamp_ns(self.scenario.steps)
        self.failure, self.not_recorded, self.done = "", 0, False
        self._disk_is_slow = False
        self._bag = BagWriter(self.folder, _FLUSH_INTERVAL_S, _MOST_WAITING_BYTES)
        try:
            self._write_beside("scenario.yaml", to_yaml(self.scenario))
            self._write_beside("versions.json", json.dumps(versions(), indent=2) + "\n")
        except RecordingError:
            self._bag.close()
            self._bag = None
            raise
        group = Polled()
        self._channels = {topic: self._open_channel(self._bag, topic, group) for topic in RECORDED}
        self.get_logger().info(f"recording into {self.folder}")

    def activate(self) -> None:
        """Record from now on, first what is latched; tell so when every topic is heard."""
        if self.not_recorded:
            self.get_logger().warning(f"{self.not_recorded} messages were sent while this node was inactive")
        for channel in self._channels.values():
            self._record(list(channel.latched))
            channel.latched.clear()
        self._told_ready = False

    def deactivate(self) -> None:
        """Record what was sent up to now, then let pass what comes."""
        self.drain()
        self._told_ready = True

    def cleanup(self) -> None:
        """End the bag, and be ready for another one."""
        self._end_bag()

    def shutdown(self) -> None:
        """End the bag, of a whole flight with all of its messages."""
        self._end_recording()

    def newest_step(self) -> int:
        """The newest that the plant has told."""
        return (self._now_ns - self._first_ns) // self.grid.dt_ns

    def health(self) -> Health:
        """Where the recording goes and what is not in it."""
        written = sum(channel.count for channel in self._channels.values())
        values = {"folder": self.folder, "recorded": written, "not_recorded": self.not_recorded}
        return Health(Level.ERROR if self.failure else Level.OK, self.failure or "recording", values)

    def drain(self) -> int:
        """Write everything that came since the last call; returns how many messages that was."""
        messages = [message for channel in self._channels.values() for message in self._take_all(channel)]
        messages.sort(key=lambda message: message.log_time_ns)
        self._record(messages)
        self.done = self._end.is_certain()
        return len(messages)

    def close(self) -> int:
        """Write what is still on its way, of a whole flight all of it, and end the bag."""
        self._end_recording()
        return super().close() or (1 if self.failure else 0)

    def _end_recording(self) -> None:
        try:
            if self.active:
                self._drain_the_rest()
        finally:
            self._end_bag()

    def _end_bag(self) -> None:
        """Close the bag, say what it lacks, and listen no more; nothing where there is none."""
        if self._bag is None:
            return
        bag, self._bag = self._bag, None
        try:
            bag.close()
        except RecordingError as error:
            self._fail(error)
        for sentence in self.missing():
            self.get_logger().warning(sentence)
        if self.not_recorded:
            self.get_logger().warning(f"{self.not_recorded} messages were sent while this node was inactive")
        if bag.dropped:
            self.get_logger().error(f"the disk was too slow: {bag.dropped} messages are not in the bag")
        if self.failure:
            self.get_logger().error(self.failure)
        else:
            written = sum(channel.count for channel in self._channels.values())
            self.get_logger().info(f"recorded {written} messages into {self.folder}")
        for channel in self._channels.values():
            self.destroy_subscription(channel.subscription)
        self._channels = {}

    def _let_pass(self) -> None:
        """Take what has come and do not record it."""
        for channel in self._channels.values():
            messages = self._take_all(channel)
            channel.latched.extend(messages)
            self.not_recorded += 0 if channel.topic.latched else len(messages)

    def _record(self, messages: list[_Message]) -> None:
        if not self.failure:
            try:
                self._write(messages)
            except RecordingError as error:
                self._fail(error)

    def _write(self, messages: list[_Message]) -> None:
        assert self._bag is not None
        by_id = {channel.id: channel for channel in self._channels.values()}
        for message in messages:
            channel_id, data = message.channel_id, message.data
            if self._bag.write(channel_id, data, message.log_time_ns, message.publish_time_ns):
                by_id[channel_id].count += 1

    def _fail(self, error: RecordingError) -> None:
        """Go on without a recording; told once."""
        self.failure = str(error)
        self.get_logger().error(f"{self.failure} The flight goes on without a recording.")

    def _drain_the_rest(self) -> None:
        began = time.monotonic()
        while True:
            time.sleep(_QUIET_S)
            quiet = self.drain() == 0
            in_flight = self._end.states is None and self._channels[topics.STATE].count > 0
            patience_s = _OUTCOME_S if in_flight else _REPAIR_S
            complete = self.failure or (not in_flight and not self.missing())
            if (quiet and complete) or time.monotonic() - began > patience_s:
                return

    def missing(self) -> list[str]:
        """What the bag lacks of a flight that has ended, a sentence for each topic."""
        if self._end.states is None:
            return []
        expected = {
            topic: self._end.states - topic.fewer_than_states
            for topic in self._channels
            if topic.fewer_than_states is not None
            and (topic is not topics.SETPOINT or self.scenario.reference.signal in SETPOINT_AXES)
        }
        counts = {topic: channel.count for topic, channel in self._channels.items()}
        return [
            f"only {counts[topic]} of {number} messages of {topic.name} were recorded"
            for topic, number in expected.items()
            if counts[topic] < number
        ]

    def _drain_each_poll(self) -> None:
        if self._bag is None:
            return
        if not self.active:
            self._let_pass()
            return
        self.drain()
        if not self._told_ready:
            self._tell_when_ready()
        slow = self._bag.behind_s > _SLOW_DISK_S and not self.failure
        if slow and not self._disk_is_slow:
            size = self._bag.waiting_bytes / 1024**2
            self.get_logger().warning(
                f"the disk is slow: it has taken nothing for {self._bag.behind_s:.1f} s and {size:.1f} MB wait;"
                " the flight goes on"
            )
        elif self._disk_is_slow and self._bag.behind_s == 0.0:
            self.get_logger().info("the disk has caught up")
        self._disk_is_slow = slow or (self._disk_is_slow and self._bag.behind_s > 0.0)

    def _take_all(self, channel: _Channel) -> list[_Message]:
        handle = channel.subscription.handle
        messages: list[_Message] = []
        with handle:
            while (taken := handle.take_message(channel.topic.type, True)) is not None:
                data, info = taken
                sent_at_ns = info["source_timestamp"]
                message = _Message(self._log_time_ns(channel, data), channel.id, data, sent_at_ns)
                if self._belongs_to_the_flight(channel, message):
                    messages.append(message)
        return messages

    def _belongs_to_the_flight(self, channel: _Channel, message: _Message) -> bool:
        """Note states and outcomes; False for an outcome still latched from an earlier flight."""
        sent_at_ns = message.publish_time_ns
        if channel.topic is topics.STATE:
            step, rest = divmod(message.log_time_ns - self.grid.epoch_ns, self.grid.dt_ns)
            if not rest:
                self._end.hear_state(step, sent_at_ns)
        elif channel.topic is topics.OUTCOME:
            if sent_at_ns < self._started_at_ns:
                self.refusals.add(
                    channel.topic.name, BorderError("earlier", "it was sent before this recorder began")
                )
                return False
            self._hear_outcome(message)
        return True

    def _hear_outcome(self, message: _Message) -> None:
        try:
            text = deserialize_message(message.data, String).data
        except rclpy_implementation.RMWError:
            self.refusals.add(topics.OUTCOME.name, BorderError("outcome", "its bytes are no text"))
            return
        self._end.hear_outcome(text, message.publish_time_ns)

    def _log_time_ns(self, channel: _Channel, data: bytes) -> int:
        """A message's own stamp; without one in the flight's time, the newest that the plant has told."""
        if channel.topic.type is String:
            return self._now_ns
        try:
            stamp_ns = leading_stamp_ns(data)
        except RecordingError as error:
            return self._refuse_stamp(channel, str(error))
        if not self._first_ns <= stamp_ns <= self._last_ns:
            sentence = "its stamp is outside of the flight, it is recorded at the newest simulated time"
            return self._refuse_stamp(channel, sentence)
        if channel.topic in (topics.CLOCK, topics.STATE):
            self._now_ns = max(self._now_ns, stamp_ns)
        return stamp_ns

    def _refuse_stamp(self, channel: _Channel, sentence: str) -> int:
        self.refusals.add(channel.topic.name, BorderError("stamp", sentence))
        return self._now_ns

    def _open_channel(self, bag: BagWriter, topic: Topic, group: CallbackGroup) -> _Channel:
        qos = QoSProfile(depth=_DEPTH, reliability=topic.qos.reliability, durability=topic.qos.durability)
        subscription = self.create_subscription(
            topic.type, topic.name, lambda _: None, qos, callback_group=group, raw=True
        )
        schema = message_schema(topic.type_name)
        offered = yaml.safe_dump([rosbag2_qos(topic.qos)], sort_keys=False)
        name = subscription.topic_name
        channel_id = bag.add_topic(name, topic.type_name, schema.text, schema.type_hash, offered)
        return _Channel(
            topic, subscription, channel_id, deque(maxlen=topic.qos.depth if topic.latched else 0)
        )

    def _tell_when_ready(self) -> None:
        if not self._unheard():
            self._told_ready = True
            self._ready.publish(String(data=str(self.folder)))
            self.get_logger().info("ready")

    def _say_what_is_missing(self) -> None:
        if self.active and not self._told_ready and (unheard := self._unheard()):
            self.get_logger().warning(f"waiting for publishers of {', '.join(unheard)}")
        for topic, channel in self._channels.items():
            for publisher in self.get_publishers_info_by_topic(channel.subscription.topic_name):
                self._note_type(topic, publisher.topic_type, publisher.node_name)

    def _note_type(self, topic: Topic, type_name: str, node: str) -> None:
        """Say once for each topic and wrong type that its messages cannot be recorded."""
        if type_name != topic.type_name and (topic.name, type_name) not in self._wrong_types:
            self._wrong_types.add((topic.name, type_name))
            self.get_logger().error(
                f"the node {node} publishes {topic.name} as {type_name}, not as {topic.type_name}: its messages are"
                " not recorded"
            )

    def _unheard(self) -> list[str]:
        channels = self._channels.items()
        return [topic.name for topic, channel in channels if channel.subscription.get_publisher_count() == 0]

    def _default_folder(self) -> Path:
        now = datetime.now(timezone.utc)
        return Path("bags") / f"{now:%Y%m%dT%H%M%SZ}_{self.scenario.name}"

    def _write_beside(self, name: str, text: str) -> None:
        try:
            (self.folder / name).write_text(text, encoding="utf-8")
        except OSError as error:
            reason = f"({error.strerror}): make room"
            raise RecordingError(f"{self.folder / name} cannot be written {reason}") from error

# SPDX-License-Identifier: Apache-2.0
"""The recorder as a node: every topic, byte for byte, into a rosbag2 folder at simulated time."""

import json
import time
from pathlib import Path

from std_msgs.msg import String

from skydiver_utc.errors import FAILED, RecordingError
from skydiver_utc.messages import MessageError
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.diagnostics import Health, Level
from skydiver_utc.nodes.node import ScenarioNode
from skydiver_utc.nodes.recorder_inputs import RawMessage, RecorderInput
from skydiver_utc.nodes.run_monitor import RunMonitor
from skydiver_utc.nodes.topics import RECORDED
from skydiver_utc.nodes.versions import versions
from skydiver_utc.parameters import to_yaml
from skydiver_utc.parameters.run_folder import SCENARIO_FILE, VERSIONS_FILE, new_run_folder
from skydiver_utc.recording.metadata import offered_qos
from skydiver_utc.recording.schemas import message_schema
from skydiver_utc.recording.writer import BagWriter

_POLL_S = 0.02
_FLUSH_INTERVAL_S = 0.25  # a killed recorder loses this, the poll and the write: less than half a second
_CHECK_S = 1.0  # of the publishers' types
_QUIET_S = 0.1
_STOPPED_S = 1.0  # longest wait for the outcome, or for lost messages of a run that was stopped
_RETRANSMISSION_S = 10.0  # longest wait for lost messages: DDS offers them again every three seconds
_SLOW_DISK_S = 2.0
_QUEUE_LIMIT_BYTES = 256 * 1024**2  # some minutes of a run
_MOST_WAITING_MESSAGES = 10_000


_OF_ANY_NODE = {topic.name for topic in (topics.DIAGNOSTICS, topics.LOGS, topics.PARAMETER_EVENTS)}


class RecorderNode(ScenarioNode):
    """Polls its subscriptions, writes the messages, and publishes `recorder/ready` when all needed topics have one.

    It is `done` with the outcome of its run. A recording that fails, on a full disk, does not stop the run: the
    messages are dropped, `failure` is the reason, and the exit code is 1.

    Configured it has an open bag and is subscribed; active or at its end it records, also what has come while it was
    inactive: the newest 10 000 messages of each topic, none older.
    """

    KIND = topics.RECORDER

    def build(self) -> None:
        self.failure, self.folder = "", Path()
        self._bag: BagWriter | None = None
        self._inputs: list[RecorderInput] = []
        self._run = self._new_run()
        self._ready = self.advertise(topics.RECORDER_READY)
        self._announced = True  # `recorder/ready`
        self.every(_POLL_S, self._poll)
        self.every(_CHECK_S, self._check_types)

    def configure(self) -> None:
        """Open a new bag, subscribe to every topic."""
        self.folder = Path(self.settings.out or new_run_folder(Path("bags"), self.scenario.name))
        self._run = self._new_run()
        self._waiting: list[tuple[RecorderInput, RawMessage]] = []  # until the time of the run is known
        self.failure, self.done, self._disk_is_slow = "", False, False
        beside = {
            SCENARIO_FILE: to_yaml(self.scenario),
            VERSIONS_FILE: json.dumps(versions(), indent=2) + "\n",
        }
        self._bag = BagWriter(self.folder, _FLUSH_INTERVAL_S, _QUEUE_LIMIT_BYTES, beside)
        names = getattr(self.scenario.estimator, "sensors", None) or ()
        sensors = [topics.sensor_topic(name) for name in names]
        self._inputs = [RecorderInput(self, topic) for topic in (*sensors, *RECORDED)]
        for each in self._inputs:
            self._add_to_bag(each)
        self.get_logger().info(f"recording into {self.folder}")

    def activate(self) -> None:
        """Record, and announce it when all needed topics have a publisher."""
        self._announced = False

    def deactivate(self) -> None:
        """Record the messages up to now; later ones wait."""
        self.drain()
        self._announced = True

    def cleanup(self) -> None:
        """Record the messages still on their way and close the bag."""
        try:
            if self._bag is not None:
                self._drain_the_rest()
        finally:
            self._close_bag()

    def shutdown(self) -> None:
        self.cleanup()

    def newest_step(self) -> int:
        """The step of the newest clock or state."""
        newest_ns = self._run.newest_ns
        return -1 if newest_ns is None else (newest_ns - self.grid.epoch_ns) // self.grid.dt_ns

    def health(self) -> Health:
        values = {"folder": self.folder, "recorded": self._count()}
        return Health(Level.ERROR if self.failure else Level.OK, self.failure or "recording", values)

    def drain(self) -> int:
        """Record every message since the last call; returns how many are of a run, not of any node."""
        # Taken in reverse, so that causes come with their effects; kept in the order of the table.
        taken = [(each, list(each.take_all())) for each in reversed(self._inputs)]
        received = [(each, message) for each, messages in reversed(taken) for message in messages]
        self._waiting.extend(pair for pair in received if self._is_of_run(*pair))
        if self._run.newest_ns is None:  # they wait for the time of the first clock or state
            del self._waiting[:-_MOST_WAITING_MESSAGES]
        else:
            self._write_waiting()
        self.done = self._run.ended
        return sum(each.topic.name not in _OF_ANY_NODE for each, _ in received)

    def close(self) -> int:
        self.cleanup()
        return super().close() or (FAILED if self.failure else 0)

    def missing(self) -> str:
        """The needed topics that nobody publishes."""
        names = [] if self._announced else self._without_publisher()
        return f"waiting for publishers of {', '.join(names)}" if names else ""

    def not_in_bag(self) -> list[str]:
        """A sentence for each topic of which the bag lacks messages of a run that has ended."""
        if not self._run.ended:
            return []
        states = self._run.expected_states(self.grid.dt_ns)
        expected = [
            (each, states - each.topic.fewer_than_states)
            for each in self._inputs
            if each.topic.fewer_than_states is not None and (each.topic.needed or each.count)
        ]
        return [
            f"only {each.count} of {count} messages of {each.topic.name} were recorded"
            for each, count in expected
            if each.count < count
        ]

    def _new_run(self) -> RunMonitor:
        length_ns = self.scenario.steps * self.scenario.dt_ns
        return RunMonitor(self.scenario.stamp_ns(0), length_ns, self.refusals)

    def _poll(self) -> None:
        if self._bag is None:
            return
        for each in self._inputs:
            if each.subscribe():
                self._add_to_bag(each)
        if not self.active:
            return
        self.drain()
        if not self._announced and not self._without_publisher():
            self._announced = True
            self._ready.publish(String(data=str(self.folder)))
            self.get_logger().info("ready")
        self._log_slow_disk(self._bag)

    def _is_of_run(self, of: RecorderInput, message: RawMessage) -> bool:
        """False for an outcome from before this recording; other refused messages are recorded."""
        try:
            self._run.receive(of.topic, message)
        except MessageError as error:
            self.refusals.add(of.topic.name, error)
            return error.kind != "earlier"
        return True

    def _write_waiting(self) -> None:
        """Write the messages that wait, in the order of time."""
        dated = [
            (self._run.log_time(each.topic, message.cdr), each, message) for each, message in self._waiting
        ]
        self._waiting.clear()
        if self.failure or self._bag is None:
            return
        try:
            for log_time_ns, each, message in sorted(dated, key=lambda one: one[0]):
                if self._bag.write(each.channel_id, message.cdr, log_time_ns, message.sent_at_ns):
                    each.count += 1
        except RecordingError as error:
            self._fail(error)

    def _drain_the_rest(self) -> None:
        """Record the remaining messages: all of a run that has ended, else the outcome if it comes within a second."""
        began = time.monotonic()
        while True:
            time.sleep(_QUIET_S)
            quiet = self.drain() == 0
            complete = self.failure or (not self._run.running and not self.not_in_bag())
            stopped = self._run.running or self._run.aborted
            longest_s = _STOPPED_S if stopped else _RETRANSMISSION_S
            if (quiet and complete) or time.monotonic() - began > longest_s:
                return

    def _close_bag(self) -> None:
        """Close the bag, log the missing messages, unsubscribe."""
        if self._bag is None:
            return
        self._write_waiting()
        bag, self._bag = self._bag, None
        try:
            bag.close()
        except RecordingError as error:
            self._fail(error)
        for sentence in self.not_in_bag():
            self.get_logger().warning(sentence)
        if bag.dropped:
            self.get_logger().error(f"the disk was too slow: {bag.dropped} messages are not in the bag")
        if self.failure:
            self.get_logger().error(self.failure)
        else:
            self.get_logger().info(f"recorded {self._count()} messages into {self.folder}")
        for each in self._inputs:
            each.destroy()
        self._inputs = []

    def _fail(self, error: RecordingError) -> None:
        """Log the failure once; the run continues."""
        if not self.failure:
            self.failure = str(error)
            self.get_logger().error(f"{self.failure} The run continues without a recording.")

    def _count(self) -> int:
        return sum(each.count for each in self._inputs)

    def _log_slow_disk(self, bag: BagWriter) -> None:
        slow = bag.behind_s > _SLOW_DISK_S and not self.failure
        if slow and not self._disk_is_slow:
            size = bag.waiting_bytes / 1024**2
            self.get_logger().warning(
                f"the disk is slow: no write for {bag.behind_s:.1f} s, {size:.1f} MB wait; the run continues"
            )
        elif self._disk_is_slow and bag.behind_s == 0.0:
            self.get_logger().info("the disk has caught up")
        self._disk_is_slow = slow or (self._disk_is_slow and bag.behind_s > 0.0)

    def _add_to_bag(self, of: RecorderInput) -> None:
        if not of.subscribed or self._bag is None or self.failure:
            return
        schema = message_schema(of.topic.type_name)
        qos = of.topic.qos
        offered = offered_qos(qos.depth, qos.reliability.name, qos.durability.name)
        try:
            of.channel_id = self._bag.add_topic(of.name, *schema, offered)
        except RecordingError as error:
            self._fail(error)

    def _without_publisher(self) -> list[str]:
        """Names of the needed topics that nobody publishes."""
        return [each.topic.name for each in self._inputs if each.topic.needed and not each.matched]

    def _check_types(self) -> None:
        for each in self._inputs:
            for sentence in each.wrong_types():
                self.get_logger().error(sentence)

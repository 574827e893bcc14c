"""Messages into an open MCAP file, with the statistics that `metadata.yaml` needs."""

import time
from collections import deque
from dataclasses import dataclass
from typing import Any, NamedTuple

from mcap.writer import LIBRARY_IDENTIFIER, Writer

from skydiver_utc.recording.metadata import TopicSummary

_SEQUENCE_MASK = 2**32 - 1


class QueuedMessage(NamedTuple):
    """A message that waits to be written; times in ns."""

    channel_id: int
    cdr: bytes
    log_time_ns: int
    publish_time_ns: int


@dataclass
class StoredTopic:
    """A topic of the bag, and what the file knows it by."""

    name: str
    type_name: str
    schema_text: str
    type_hash: str
    qos_profiles_yaml: str
    qos_profiles: list[dict[str, Any]]
    mcap_channel: int = 0
    message_count: int = 0


class MessageStore:
    """The part that only the recording thread touches: the MCAP file and the statistics of what is in it."""

    def __init__(self, mcap: Writer, topics: list[StoredTopic]) -> None:
        self._mcap = mcap
        self._topics = topics
        self._registered = 0
        self._schemas: dict[tuple[str, str], int] = {}
        self.log_span_ns: tuple[int, int] | None = None
        self.taken_bytes = 0
        self.flushed_at_s = time.monotonic()

    def start(self) -> None:
        """Write the header."""
        self._mcap.start(profile="ros2", library=f"skydiver_utc {LIBRARY_IDENTIFIER}")
        self._mcap.flush()

    def take(self, pending: deque[QueuedMessage]) -> None:
        """Move everything that is queued into the file, down to the operating system."""
        count = len(pending)
        # All that are known, so that also a silent topic is in what a killed recorder leaves.
        self._register(len(self._topics))
        taken_bytes = 0
        for _ in range(count):
            message = pending.popleft()
            taken_bytes += len(message.cdr)
            self._add(self._topics[message.channel_id - 1], message)
        self._mcap.flush()
        self.taken_bytes += taken_bytes
        self.flushed_at_s = time.monotonic()

    def finish(self) -> None:
        """Write the index and the footer."""
        self._register(len(self._topics))
        self._mcap.finish()

    def summaries(self) -> list[TopicSummary]:
        """The topics as metadata lists them."""
        return [
            TopicSummary(each.name, each.type_name, each.type_hash, each.qos_profiles, each.message_count)
            for each in self._topics
        ]

    def _add(self, topic: StoredTopic, message: QueuedMessage) -> None:
        log_time = message.log_time_ns
        self._mcap.add_message(
            topic.mcap_channel,
            log_time=log_time,
            data=message.cdr,
            publish_time=message.publish_time_ns,
            sequence=topic.message_count & _SEQUENCE_MASK,
        )
        topic.message_count += 1
        first, last = self.log_span_ns or (log_time, log_time)
        self.log_span_ns = (min(first, log_time), max(last, log_time))

    def _register(self, count: int) -> None:
        """Make sure that the first `count` topics have their channels in the file."""
        while self._registered < count:
            topic = self._topics[self._registered]
            key = (topic.type_name, topic.schema_text)
            if key not in self._schemas:
                text = topic.schema_text.encode()
                self._schemas[key] = self._mcap.register_schema(topic.type_name, "ros2msg", text)
            topic.mcap_channel = self._mcap.register_channel(
                topic.name,
                "cdr",
                self._schemas[key],
                {"offered_qos_profiles": topic.qos_profiles_yaml, "topic_type_hash": topic.type_hash},
            )
            self._registered += 1

"""Writes serialized ROS 2 messages into a rosbag2 bag folder: `metadata.yaml` and one MCAP file."""

import atexit
import math
import operator
import os
import sys
import threading
import time
from collections import deque
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from mcap.writer import CompressionType, Writer

from skydiver_utc.recording.errors import RecordingError
from skydiver_utc.recording.message_store import MessageStore, QueuedMessage, StoredTopic
from skydiver_utc.recording.metadata import (
    METADATA_FILE,
    metadata_yaml,
    parse_qos_profiles,
    write_whole,
)

_LATEST_NS = 2**63 - 1  # times are signed 64-bit in rosbag2
# LZ4 makes a flight four times smaller for 0.2 ms of the 1.6 ms that a flush takes every half second, and the
# readers of MCAP bring it; zstd takes 1 ms for another sixth.
_COMPRESSION = CompressionType.LZ4


class BagWriter:
    """A bag that is being recorded; not to be shared between threads.

    `write` only queues: a thread of its own puts the messages into the file and flushes it every
    `flush_interval_s` seconds, so that a killed process loses about as much at most. The thread is also why
    Ctrl-C, which Python delivers to the main thread between any two instructions, never leaves half a record
    in the file, and why a stall of the disk does not hold up the caller.

    `metadata.yaml` appears at `close`, whole; as in rosbag2, a folder without it is a recording that did not
    end. The MCAP file alone holds everything that is needed to write it later. A process that ends without
    `close`, but not by a kill, closes the bag on its way out.
    """

    def __init__(
        self, folder: Path, flush_interval_s: float = 0.5, most_waiting_bytes: int | None = None
    ) -> None:
        """Create the folder, and its parents where missing; a folder that exists raises `RecordingError`.

        While more than `most_waiting_bytes` wait for a disk that is slow, further messages are dropped and counted
        in `dropped`; without that number none ever is.
        """
        if not flush_interval_s > 0.0:
            raise RecordingError(f"A flush interval of {flush_interval_s} s cannot be: give one above 0 s.")
        self.folder = Path(folder)
        self.mcap_path = self.folder / f"{self.folder.name}_0.mcap"
        self.dropped = 0
        self._flush_interval_s = flush_interval_s
        self._most_waiting_bytes = math.inf if most_waiting_bytes is None else most_waiting_bytes
        self._queued_bytes = 0
        self._file = _create_bag(self.folder, self.mcap_path)
        self._topics: list[StoredTopic] = []
        self._store = MessageStore(Writer(self._file, compression=_COMPRESSION), self._topics)
        self._pending: deque[QueuedMessage] = deque()
        self._failure: Exception | None = None
        self._failure_told = False
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._record, name="bag writer", daemon=True)
        self._thread.start()
        atexit.register(self.close)

    def add_topic(
        self, topic: str, type_name: str, schema_text: str, type_hash: str, qos_profiles_yaml: str
    ) -> int:
        """Announce a topic and return its channel id, for `write`.

        `schema_text` is the ros2msg definition with its dependencies and `type_hash` the RIHS01 hash, both of
        `schemas.message_schema`; `qos_profiles_yaml` is a YAML list of offered profiles as rosbag2 has it.
        """
        self._check_open()
        if any(known.name == topic for known in self._topics):
            raise RecordingError(f"The topic {topic} is in the bag already: add each topic once.")
        profiles = parse_qos_profiles(qos_profiles_yaml)
        self._topics.append(
            StoredTopic(topic, type_name, schema_text, type_hash, qos_profiles_yaml, profiles)
        )
        return len(self._topics)

    def write(self, channel_id: int, cdr: bytes, log_time_ns: int, publish_time_ns: int) -> bool:
        """Queue a serialized message and its times in ns; sequence numbers count from 0 on each channel.

        False when it was dropped.
        """
        self._check_open()
        if not 1 <= channel_id <= len(self._topics):
            raise RecordingError(f"There is no channel {channel_id}: use the number that add_topic returned.")
        log_time_ns, publish_time_ns = operator.index(log_time_ns), operator.index(publish_time_ns)
        if not (0 <= log_time_ns <= _LATEST_NS and 0 <= publish_time_ns <= _LATEST_NS):
            raise RecordingError(
                f"The times {log_time_ns} and {publish_time_ns} cannot be stored: give ns, 0 to {_LATEST_NS}."
            )
        if self.waiting_bytes + len(cdr) > self._most_waiting_bytes:
            self.dropped += 1
            return False
        self._queued_bytes += len(cdr)
        self._pending.append(QueuedMessage(channel_id, bytes(cdr), log_time_ns, publish_time_ns))
        return True

    @property
    def waiting_bytes(self) -> int:
        """Bytes of the messages that are queued and not yet handed to the operating system."""
        return self._queued_bytes - self._store.taken_bytes

    @property
    def behind_s(self) -> float:
        """How long ago the disk took something last, beyond the flush interval; 0 while nothing waits."""
        late_s = time.monotonic() - self._store.flushed_at_s - self._flush_interval_s
        return max(0.0, late_s) if self.waiting_bytes else 0.0

    def close(self) -> None:
        """Write what is queued, the index and `metadata.yaml`; a second call does nothing."""
        self._closing.set()
        self._thread.join()
        atexit.unregister(self.close)
        if not self._failure_told:
            self._tell_failure()

    def __enter__(self) -> "BagWriter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _check_open(self) -> None:
        self._tell_failure()
        if self._closing.is_set():
            raise RecordingError(f"The bag {self.folder} is closed: open another one.")

    def _tell_failure(self) -> None:
        if self._failure is None:
            return
        self._failure_told = True
        reason = getattr(self._failure, "strerror", None) or repr(self._failure)
        raise RecordingError(
            f"The recording stopped, {self.folder} cannot be written to ({reason}): make room or choose"
            f" another folder; `skydiver-utc recover {self.folder}` saves what is there."
        ) from self._failure

    def _record(self) -> None:
        """The recording thread, from the first message to the end of the bag."""
        _leave_real_time_priority()
        try:
            with self._file:
                self._store.start()
                while not self._closing.wait(self._flush_interval_s):
                    self._store.take(self._pending)
                self._store.take(self._pending)
                self._store.finish()
                self._file.flush()
                os.fsync(self._file.fileno())
            text = metadata_yaml(self.mcap_path.name, self._store.summaries(), self._store.log_span_ns)
            write_whole(self.folder / METADATA_FILE, text)
        except Exception as error:  # kept for the caller, who would not see how a thread ends
            self._failure = error


def _leave_real_time_priority() -> None:
    """Let this thread compress and write like any other, where the process has real-time priority.

    Threads of one such priority do not take turns: the plant would wait for a flush that takes longer than a step.
    """
    if sys.platform == "linux" and os.sched_getscheduler(0) in (os.SCHED_FIFO, os.SCHED_RR):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def _create_bag(folder: Path, mcap_path: Path) -> BinaryIO:
    try:
        if folder.exists() or folder.is_symlink():
            raise RecordingError(f"{folder} exists already: choose another name, or move the old one away.")
        folder.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir()
        return mcap_path.open("xb")
    except OSError as error:
        raise RecordingError(
            f"The bag {folder} cannot be created ({error.strerror}): choose a folder that you may write to."
        ) from error

# SPDX-License-Identifier: Apache-2.0
"""Writes serialized ROS 2 messages into a rosbag2 bag folder: `metadata.yaml` and one MCAP file."""

import math
import os
import sys
import threading
import time
from collections import deque
from collections.abc import Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import BinaryIO

from skydiver_utc.errors import RecordingError
from skydiver_utc.parameters.files import write_file
from skydiver_utc.recording.mcap_file import Definition, McapFile, QueuedMessage, StoredTopic
from skydiver_utc.recording.metadata import HASH_KEY, METADATA_FILE, QOS_KEY, metadata_yaml


class BagWriter(AbstractContextManager["BagWriter"]):
    """Writes a bag; one caller at a time.

    `write` only queues. A thread writes the queue to the file and flushes it every `flush_interval_s`, so that a
    killed process loses about that much, a slow disk does not block the caller, and Ctrl-C, which Python raises in
    the main thread, never cuts a record in half.

    `close` writes the index and `metadata.yaml`; a folder without `metadata.yaml` is an unfinished recording, whose
    MCAP file `skydiver-utc recover` completes.
    """

    def __init__(
        self,
        folder: Path,
        flush_interval_s: float = 0.5,
        queue_limit_bytes: float = math.inf,
        beside: Mapping[str, str] | None = None,
    ) -> None:
        """Create the folder and its missing parents; one that is not empty raises `RecordingError`.

        Messages beyond `queue_limit_bytes` in the queue are dropped and counted in `dropped`. `beside`: further files
        of the folder, names and texts.
        """
        self.folder = Path(folder)
        self.mcap_path = self.folder / f"{self.folder.name}_0.mcap"
        self.dropped = 0
        self._flush_interval_s = flush_interval_s
        self._queue_limit_bytes = queue_limit_bytes
        self._stream = _create_bag(self.folder, self.mcap_path, beside or {})
        self._mcap = McapFile(self._stream)
        self._queue: deque[QueuedMessage] = deque()
        self._queued_bytes = self._written_bytes = 0
        self._flushed_at_s = time.monotonic()
        self._failure: Exception | None = None
        self._failure_raised = False
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._record, name="bag writer", daemon=True)
        self._thread.start()

    def add_topic(
        self, topic: str, type_name: str, schema_text: str, type_hash: str, qos_profiles_yaml: str
    ) -> int:
        """Add a topic and return its channel id, for `write`.

        `schema_text` (ros2msg with all dependencies) and `type_hash` (RIHS01) are from `schemas.message_schema`;
        `qos_profiles_yaml` is a YAML list of offered profiles in rosbag2's form.
        """
        self._check_open()
        metadata = {QOS_KEY: qos_profiles_yaml, HASH_KEY: type_hash}
        definition = Definition(type_name, "ros2msg", schema_text.encode())
        self._mcap.topics.append(StoredTopic(topic, definition, "cdr", metadata))
        return len(self._mcap.topics)

    def write(self, channel_id: int, cdr: bytes, log_time_ns: int, publish_time_ns: int) -> bool:
        """Queue a serialized message with its times in ns; returns False if it was dropped."""
        self._check_open()
        if self.waiting_bytes + len(cdr) > self._queue_limit_bytes:
            self.dropped += 1
            return False
        self._queued_bytes += len(cdr)
        self._queue.append(QueuedMessage(channel_id, cdr, log_time_ns, publish_time_ns))
        return True

    @property
    def waiting_bytes(self) -> int:
        """Bytes of the messages that are queued and not flushed yet."""
        return self._queued_bytes - self._written_bytes

    @property
    def behind_s(self) -> float:
        """Time since the last flush, beyond the flush interval; 0 while nothing waits."""
        late_s = time.monotonic() - self._flushed_at_s - self._flush_interval_s
        return max(0.0, late_s) if self.waiting_bytes else 0.0

    def close(self) -> None:
        """Write the queue, the index and `metadata.yaml`; a second call does nothing."""
        self._closing.set()
        self._thread.join()
        if not self._failure_raised:
            self._raise_failure()

    def __exit__(self, *_: object) -> None:
        self.close()

    def _check_open(self) -> None:
        self._raise_failure()
        if self._closing.is_set():
            raise RecordingError(f"The bag {self.folder} is closed: open another one.")

    def _raise_failure(self) -> None:
        if self._failure is None:
            return
        self._failure_raised = True
        reason = getattr(self._failure, "strerror", None) or repr(self._failure)
        raise RecordingError(
            f"The recording stopped, {self.folder} cannot be written ({reason}): make room or choose another"
            f" folder; `skydiver-utc recover {self.folder}` saves what was written."
        ) from self._failure

    def _record(self) -> None:
        """The thread, from the header to `metadata.yaml`."""
        _use_normal_priority()
        try:
            with self._stream:
                self._mcap.start()
                while not self._closing.wait(self._flush_interval_s):
                    self._write_queue()
                self._write_queue()
                self._mcap.finish()
                self._stream.flush()
                os.fsync(self._stream.fileno())
            text = metadata_yaml(self.mcap_path.name, self._mcap)
            write_file(self.folder / METADATA_FILE, text)
        except Exception as error:  # raised in the caller's thread by its next call
            self._failure = error

    def _write_queue(self) -> None:
        messages = [self._queue.popleft() for _ in range(len(self._queue))]
        self._mcap.write(messages)
        self._written_bytes += sum(len(message.cdr) for message in messages)
        self._flushed_at_s = time.monotonic()


def _use_normal_priority() -> None:
    """Leave real-time priority in this thread: a flush would block the process for longer than a step."""
    if sys.platform == "linux" and os.sched_getscheduler(0) in (os.SCHED_FIFO, os.SCHED_RR):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def _create_bag(folder: Path, mcap_path: Path, beside: Mapping[str, str]) -> BinaryIO:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise RecordingError(f"{folder} exists already: choose another name, or move the old one away.")
        for name, text in beside.items():
            (folder / name).write_text(text, encoding="utf-8")
        return mcap_path.open("xb")
    except OSError as error:
        raise RecordingError(
            f"The bag {folder} cannot be created ({error.strerror}): choose a folder that you may write to."
        ) from error

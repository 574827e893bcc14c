# SPDX-License-Identifier: Apache-2.0
"""The run of a recording: the log time of each message, the run's id, and its outcome."""

from contextlib import suppress

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from skydiver_utc.loop.outcome import Outcome
from skydiver_utc.messages import MessageError, Refusals
from skydiver_utc.messages.texts import read_outcome, run_id_of
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.recorder_inputs import RawMessage
from skydiver_utc.nodes.topics import Topic
from skydiver_utc.recording.stamps import leading_stamp_ns


class RunMonitor:
    """The state of a run, from its messages; `newest_ns`: time of the newest clock or state, None before the first.

    Simulated time lies in the scenario's range, epoch to epoch + length. The first stamp of a vehicle lies outside:
    then the range begins with it.
    """

    def __init__(self, epoch_ns: int, length_ns: int, refusals: Refusals) -> None:
        self.newest_ns: int | None = None
        self.ended, self.aborted = False, False
        self._states = 0  # of the whole run, from its outcome
        self._begin_ns, self._length_ns, self._refusals = epoch_ns, length_ns, refusals
        self._first_state_ns: int | None = None
        self._run_id = ""

    @property
    def running(self) -> bool:
        """True between the first state and the outcome."""
        return self._first_state_ns is not None and not self.ended

    def expected_states(self, dt_ns: int) -> int:
        """States of an ended run from the first recorded one on."""
        first_ns = self._begin_ns if self._first_state_ns is None else self._first_state_ns
        return self._states - (first_ns - self._begin_ns) // dt_ns

    def receive(self, topic: Topic, message: RawMessage) -> None:
        """Learn the time, the id and the outcome; `MessageError` for a message that is not of this run."""
        if topic.name in (topics.CLOCK.name, topics.STATE.name):
            self._receive_time(topic, message.cdr)
        elif topic.name == topics.SCENARIO.name:
            self._run_id = run_id_of(_text(message))
        elif topic.name == topics.OUTCOME.name:
            self._receive_outcome(message)

    def log_time(self, topic: Topic, cdr: bytes) -> int:
        """The message's stamp; without one, or with one that is not of this run, the newest time.

        Diagnostics come from nodes of any clock.
        """
        stamped = topic.type is Clock or "header" in topic.type.get_fields_and_field_types()
        if stamped and topic.name != topics.DIAGNOSTICS.name:
            try:
                return self._stamp_ns(cdr)
            except MessageError as error:
                self._refusals.add(topic.name, error)
        return self._newest_or_begin_ns

    @property
    def _newest_or_begin_ns(self) -> int:
        return self._begin_ns if self.newest_ns is None else self.newest_ns

    def _stamp_ns(self, cdr: bytes) -> int:
        stamp_ns = leading_stamp_ns(cdr)
        if self.newest_ns is None and stamp_ns > self._begin_ns + self._length_ns:
            self._begin_ns = stamp_ns
        if not self._begin_ns <= stamp_ns <= self._begin_ns + self._length_ns:
            raise MessageError("stamp", "its stamp is outside of the run, it is recorded at the newest time")
        return stamp_ns

    def _receive_time(self, topic: Topic, cdr: bytes) -> None:
        with suppress(MessageError):  # counted by `log_time` when it is written
            stamp_ns = self._stamp_ns(cdr)
            self.newest_ns = max(self._newest_or_begin_ns, stamp_ns)
            if self._first_state_ns is None and topic.name == topics.STATE.name:
                self._first_state_ns = stamp_ns

    def _receive_outcome(self, message: RawMessage) -> None:
        outcome = read_outcome(_text(message))
        if outcome["states"] > 0 and self._first_state_ns is None:
            raise MessageError("earlier", "its run ended before this recording began")
        if outcome["run_id"] != self._run_id:
            raise MessageError(
                "run", f"it is of the run {outcome['run_id']}, this is {self._run_id or 'none'}"
            )
        self.ended, self._states = True, outcome["states"]
        self.aborted = outcome["outcome"] == Outcome.ABORTED.value


def _text(message: RawMessage) -> str:
    try:
        return str(deserialize_message(message.cdr, String).data)
    except rclpy_implementation.RMWError as error:
        raise MessageError("bytes", "its bytes are no text") from error

# SPDX-License-Identifier: Apache-2.0
"""Damaged scenarios, CSV files, recordings and messages: read or refused, never a traceback, a hang or much memory.

`make fuzz` tries very many, anew for each SEED; without it the same few hundred are tried.
"""

import math
import os
import resource
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType
from recordings import STORE, named, odometry, preview, write_run
from runs import CART, random_run

from bags import rewritten
from skydiver_utc.analysis.recorded_run import RecordedRun
from skydiver_utc.body.posture import joint_angle_names
from skydiver_utc.errors import AnalysisError, RecordingError
from skydiver_utc.messages import (
    MessageError,
    StepGrid,
    outcome_text,
    read_named,
    read_outcome,
    read_preview,
    read_state,
)
from skydiver_utc.parameters import ParameterError, from_yaml, leaves, load_scenario, to_yaml
from skydiver_utc.recording.joint_angles import read_joint_angles
from skydiver_utc.recording.reader import RecordedTopic, read_bag
from skydiver_utc.recording.recovery import recover, survey

COUNT = int(os.environ.get("SKYDIVER_UTC_FUZZ", "40"))
SEED = int(os.environ.get("SKYDIVER_UTC_FUZZ_SEED", "1"))
LONGEST_S, MOST_BYTES = 5.0, 2**30
NAMES = joint_angle_names()
CSV = f"time_s,{NAMES[0]}_deg,{NAMES[1]}_deg\n0,10,1\n0.5,20,2\n1,15,30\n".encode()
RUN = random_run(from_yaml(CART.replace("duration_s: 4.0", "duration_s: 0.3")), steps=6)
WORDS = [
    *("&a ", "*a", "<<: ", "? ", "- ", "!!", "!!python/name:os.system", "{", "}", "[", "]", "|", ">", "'", '"', "#"),
    *(": ", "\n", "\n  ", "\t", "\r", "\0", "\ufeff", "\x1b[31m", "\u202e", "~", "null", "true", "yes", ".nan", ".inf"),
    *("1e999", "-0", "010", "0x", "1_0", "1:30", "9" * 5000, "[" * 2000, "- " * 200, "extends: x\n", "kind: skydiver"),
    *("kind: os:path", "posture: /etc/passwd", "name: ", "plant: ", "time_s", ",", ";", "1,2", "a: &a [*a, *a]\n"),
]  # fmt: skip
PIECES = st.sampled_from([word.encode() for word in WORDS]) | st.binary(max_size=9)
NUMBERS = st.sampled_from([b"\0", b"\xff", b"\0" * 8, b"\xff" * 8, b"\xff\xff\xff\x7f", b"\x00\x00\x00\x80"])


def damaged(whole: bytes, pieces: st.SearchStrategy[bytes]) -> st.SearchStrategy[bytes]:
    """The bytes with one to five places overwritten, lengthened or cut."""
    edits = st.lists(
        st.tuples(
            st.integers(0, len(whole)), st.sampled_from([0, 0, 1, 2, 4, 8, 40, 10**6]), pieces | st.none()
        ),
        min_size=1,
        max_size=5,
    )

    def apply(places: list[tuple[int, int, bytes | None]]) -> bytes:
        data = whole
        for position, length, piece in places:
            end = position + (len(piece) if piece and length == 0 else length)
            data = data[:position] + (piece or b"") + data[end:]
        return data

    return edits.map(apply)


def fuzzed(data: st.SearchStrategy[bytes]) -> Callable[[Any], Any]:
    """A test of many inputs, those of the seed."""

    def decorate(test: Any) -> Any:
        every = settings(max_examples=COUNT, database=None, suppress_health_check=list(HealthCheck))
        return seed(SEED)(every(given(data=data)(test)))

    return decorate


@contextmanager
def bounded(*refusals: type[Exception]) -> Iterator[None]:
    """What is read within, or refused by one of these errors in one sentence, in little time and memory."""
    began, before = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    sentences = ["read"]
    try:
        yield
    except refusals as error:
        sentences = str(error).splitlines()
    assert len(sentences) == 1, sentences
    assert time.process_time() - began < LONGEST_S
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 < MOST_BYTES


def read_angles(path: Path, data: bytes) -> None:
    """Joint angles of a file with these bytes are sound, or refused."""
    path.write_bytes(data)
    with bounded(RecordingError):
        found = read_joint_angles(path, NAMES)
        assert np.isfinite(found.values).all()
        assert np.abs(found.values).max() <= math.pi
        assert (np.diff(found.time_s) > 0.0).all()


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fuzz")


@fuzzed(damaged(CART.encode(), PIECES))
def test_scenario_texts(data: bytes) -> None:
    with bounded(ParameterError):
        found = from_yaml(data.decode(errors="replace"))
        assert from_yaml(to_yaml(found)) == found
        assert all(np.isfinite(leaf.value).all() for leaf in leaves(found) if not isinstance(leaf.value, str))


@fuzzed(
    damaged(
        b"extends: bank_recovery\nplant: {posture: box, initial: {bank_deg: 5.0}}\nduration_s: 2\n", PIECES
    )
)
def test_scenario_files(scratch: Path, data: bytes) -> None:
    path = scratch / "flight.yaml"
    path.write_bytes(data)
    with bounded(ParameterError):
        found = load_scenario(str(path))
        assert from_yaml(to_yaml(found)) == found


@fuzzed(damaged(CSV, PIECES))
def test_csv_files(scratch: Path, data: bytes) -> None:
    read_angles(scratch / "measured.csv", data)


@fuzzed(
    damaged(b"x\ninDegrees=yes\nendheader\ntime knee_angle_r arm_add_l tx\n0 10 1 9\n.5 20 2 9\n", PIECES)
)
def test_motion_files(scratch: Path, data: bytes) -> None:
    read_angles(scratch / "measured.mot", data)


with tempfile.TemporaryDirectory() as _scratch:
    _options = {"compression": CompressionType.NONE, "enable_crcs": False}
    _file = rewritten(write_run(Path(_scratch) / "run", RUN), Path(_scratch) / "whole.mcap", **_options)
    WHOLE = _file.read_bytes()


@fuzzed(damaged(WHOLE, NUMBERS | st.binary(max_size=3)))
def test_recordings(scratch: Path, data: bytes) -> None:
    path = scratch / "run.mcap"
    path.write_bytes(data)
    with bounded(RecordingError):
        for topic in read_bag(path).values():
            assert len(topic.readable) == len(topic) == len(topic.log_times_ns)
    with bounded(RecordingError, AnalysisError):
        run = RecordedRun(path).run()
        assert np.isfinite(run.applied[~np.isnan(run.applied).all(axis=1)]).all()
    with bounded(RecordingError):
        found = survey(path)
        recover(path, scratch / "recovered")
        again = survey(scratch / "recovered")
        assert (again.counts, again.whole) == (found.counts, True)
    shutil.rmtree(scratch / "recovered", ignore_errors=True)


GRID = StepGrid(RUN.scenario.stamp_ns(0), RUN.scenario.dt_ns)
READERS: dict[str, Callable[[Any], Any]] = {
    "sensor_msgs/msg/JointState": lambda message: read_named(message, ["place", "speed"]),
    "nav_msgs/msg/Odometry": read_state,
    "trajectory_msgs/msg/JointTrajectory": lambda message: read_preview(message, GRID, ["place"])[1],
}
SENT = {
    "sensor_msgs/msg/JointState": named(RUN.scenario, 1, ["place", "speed"], [1.0, 2.0]),
    "nav_msgs/msg/Odometry": odometry(RUN.scenario, 1, np.eye(13)[6]),
    "trajectory_msgs/msg/JointTrajectory": preview(RUN.scenario, 1, ["place"], [[1.0], [2.0]]),
}


@pytest.mark.parametrize("kind", READERS)
@fuzzed(st.data())
def test_messages(kind: str, data: Any) -> None:
    whole = bytes(STORE.serialize_cdr(SENT[kind], kind))
    topic = RecordedTopic("/t", kind, STORE.generate_msgdef(kind)[0])
    topic.add(data.draw(damaged(whole, NUMBERS | st.binary(max_size=8))), 1, 1, 1)
    with bounded(MessageError):
        for message in topic.readable:
            assert message is None or np.isfinite(READERS[kind](message)).all()


@fuzzed(damaged(outcome_text("id", "completed", "6 steps", wall_time_s=0.5, states=7).encode(), PIECES))
def test_outcomes(data: bytes) -> None:
    with bounded(MessageError):
        assert read_outcome(data.decode(errors="replace"))["states"] >= 0

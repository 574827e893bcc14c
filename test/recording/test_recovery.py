# SPDX-License-Identifier: Apache-2.0
"""Recordings cut short or damaged anywhere: every complete chunk is recovered, and nothing else."""

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from command_line import invoke
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rosbags.rosbag2 import Reader

from bags import START_NS, STRING, Row, messages_in, stored, text_message, write_bag
from skydiver_utc.errors import RecordingError
from skydiver_utc.recording.reader import read_bag
from skydiver_utc.recording.recovery import recover, survey

TOPICS = ("/one", "/two", "/three")
MESSAGES = 120


TEXTS = [text_message(f"message {k} " + "x" * (k % 17)) for k in range(MESSAGES)]
ROWS = [Row(TOPICS[k % 3], START_NS + k * 1_000_000, 7_000_000 + k, text) for k, text in enumerate(TEXTS)]


def write(path: Path, compression: CompressionType = CompressionType.LZ4) -> Path:
    """The messages in an .mcap file of many small chunks, by the library's writer alone."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=300, compression=compression)
        writer.start(profile="ros2")
        schema = writer.register_schema(STRING[0], "ros2msg", STRING[1].encode())
        metadata = {"topic_type_hash": STRING[2], "offered_qos_profiles": ""}
        ids = {name: writer.register_channel(name, "cdr", schema, metadata) for name in TOPICS}
        for topic, log_time, publish_time, cdr in ROWS:
            writer.add_message(ids[topic], log_time, cdr, publish_time)
        writer.finish()
    return path


class Place(NamedTuple):
    """The bytes of a chunk in a file, and the messages up to its end."""

    start: int
    end: int
    count: int


def chunks(path: Path) -> list[Place]:
    """The chunks of a whole file, by the file's own index."""
    places, count = [], 0
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
        assert summary is not None
        for chunk in sorted(summary.chunk_indexes, key=lambda index: index.chunk_start_offset):
            count += (chunk.message_end_time - chunk.message_start_time) // 1_000_000 + 1
            start = chunk.chunk_start_offset
            places.append(Place(start, start + chunk.chunk_length, count))
    assert count == MESSAGES
    assert len(places) > 8
    return places


def recovered(folder: Path) -> list[Row]:
    """The messages in a bag folder, which two independent libraries read alike."""
    with Reader(folder) as reader:
        by_rosbags = [(c.topic, log_time, bytes(data)) for c, log_time, data in reader.messages()]
        assert reader.message_count == len(by_rosbags)
    found = stored(folder)
    assert by_rosbags == [(topic, log_time, data) for topic, log_time, _, data in found]
    return found


def put(path: Path, data: bytes) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    return path


def damaged(source: Path, position: int, flipped: int, path: Path) -> Path:
    """A file with these bits of a byte flipped."""
    data = bytearray(source.read_bytes())
    data[position] ^= flipped
    return put(path, data)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("whole") / "run_0.mcap")


@pytest.mark.long
def test_a_cut_anywhere_keeps_exactly_the_whole_chunks(whole: Path, tmp_path: Path) -> None:
    ends = chunks(whole)
    size = whole.stat().st_size
    seen = set()
    boundaries = {each.end + offset for each in ends for offset in (-1, 0, 1, 9, 10)}
    for at in sorted(boundaries | set(range(8, size, 101))):
        found = survey(put(tmp_path / "cut.mcap", whole.read_bytes()[:at]))
        expected = max((each.count for each in ends if each.end <= at), default=0)
        assert found.message_count == expected, at
        assert not found.whole
        seen.add(expected)
    assert len(seen) == len(ends) + 1


@pytest.mark.parametrize("compression", list(CompressionType), ids=lambda kind: kind.name)
def test_a_recovered_bag_is_read_by_others(tmp_path: Path, compression: CompressionType) -> None:
    """Cut in a chunk, at its end, in an index, in the summary, before and in the end."""
    file = write(tmp_path / "whole.mcap", compression)
    cuts = [each.end + offset for each in chunks(file)[1::9] for offset in (-20, 0, 5)]
    for at in [*cuts, *(file.stat().st_size - size for size in (300, 40, 37, 8, 1))]:
        run = tmp_path / f"run_{at}"
        data = file.read_bytes()[:at]
        put(run / "run_0.mcap", data)
        found = recover(run, tmp_path / f"recovered_{at}")
        expected = max(each.count for each in chunks(file) if each.end <= at)
        assert recovered(tmp_path / f"recovered_{at}") == ROWS[:expected]
        assert found.message_count == expected
        assert survey(tmp_path / f"recovered_{at}").whole
        assert {path.name: path.read_bytes() for path in run.iterdir()} == {"run_0.mcap": data}


def test_a_file_with_a_damaged_index_or_frame_is_whole_only_where_others_read_it(
    whole: Path, tmp_path: Path
) -> None:
    """Such bytes lead the library to errors of ten classes, of which none is raised here."""
    size, ends = whole.stat().st_size, [each.end for each in chunks(whole)]
    judged = []
    for position in (*range(ends[-1], size, 61), *range(size - 36, size), *(end - 4 for end in ends)):
        path = damaged(whole, position, 0x81, tmp_path / "run_0.mcap")
        judged.append(survey(path).whole)
        if judged[-1]:
            assert [message.data for message in messages_in(path)] == [row.cdr for row in ROWS]
    assert not any(judged[-len(ends) :])
    assert judged.count(True) < len(judged) // 4


@pytest.mark.long
def test_a_damaged_byte_anywhere_costs_at_most_a_chunk(whole: Path, tmp_path: Path) -> None:
    """All messages of the other chunks are recovered, and nothing else, in their order; losses are reported."""
    sent = {row.cdr: place for place, row in enumerate(ROWS)}
    costs = []
    for position in np.random.default_rng(1).integers(8, whole.stat().st_size, 50).tolist():
        path = damaged(whole, position, 0x5A, tmp_path / "run" / "run_0.mcap")
        found = survey(path)
        if found.whole:
            assert found.message_count == MESSAGES
            continue
        if found.message_count:
            recover(path, tmp_path / str(position))
            back = [sent[row.cdr] for row in recovered(tmp_path / str(position))]
            assert back == sorted(set(back))
            assert len(back) == found.message_count
            before = 0
            for each in chunks(whole):
                if each.start + 9 <= position < each.end:  # no length in the file is damaged
                    assert set(range(MESSAGES)) - set(back) <= set(range(before, each.count)), position
                before = each.count
        if found.message_count < MESSAGES:
            assert found.losses or found.lost_messages
        costs.append(MESSAGES - found.message_count)
    assert len(costs) > 25
    # Only a length that is wrong costs all that follows it.
    assert sorted(costs)[len(costs) * 3 // 4] < MESSAGES // 8


@pytest.mark.parametrize("number", [0, 4])
@pytest.mark.parametrize("what", ["opcode 0", "opcode 127", "byte"])
def test_a_damaged_chunk_is_left_out_and_its_times_are_reported(
    whole: Path, tmp_path: Path, what: str, number: int
) -> None:
    """Topics that it defines are found at the end of the file."""
    chunk = chunks(whole)[number]
    before = chunks(whole)[number - 1].count if number else 0
    position = chunk.end - 30 if what == "byte" else chunk.start
    flipped = {"opcode 0": Opcode.CHUNK, "opcode 127": Opcode.CHUNK ^ 0x7F, "byte": 0xFF}[what]
    path = damaged(whole, position, flipped, tmp_path / "run_0.mcap")
    found = survey(path)
    assert found.lost_messages == chunk.count - before == MESSAGES - found.message_count
    (loss,) = found.losses
    assert loss.byte_count == chunk.end - chunk.start
    assert (loss.after_ns, loss.before_ns) == (
        ROWS[before - 1].log_time if before else None,
        ROWS[chunk.count].log_time,
    )
    recover(path, tmp_path / "recovered")
    assert recovered(tmp_path / "recovered") == ROWS[:before] + ROWS[chunk.count :]


def test_a_record_of_a_writer_s_own_is_no_loss(whole: Path, tmp_path: Path) -> None:
    end, data = chunks(whole)[3].end, whole.read_bytes()
    own = b"\xff" + (5).to_bytes(8, "little") + b"12345"
    found = survey(put(tmp_path / "run_0.mcap", data[:end] + own + data[end:]))
    assert (found.message_count, found.losses, found.lost_messages) == (MESSAGES, [], 0)


@pytest.mark.parametrize("extra", [1, 9, 100])
def test_the_bytes_after_the_last_whole_record_are_counted(whole: Path, tmp_path: Path, extra: int) -> None:
    """A file cut within a chunk, or within the nine bytes before it."""
    before, chunk = chunks(whole)[5:7]
    found = survey(put(tmp_path / "run_0.mcap", whole.read_bytes()[: chunk.start + extra]))
    (loss,) = found.losses
    last_ns = ROWS[before.count - 1].log_time
    assert (loss.byte_count, loss.after_ns, loss.before_ns) == (extra, last_ns, None)


@pytest.mark.parametrize("what", [b"std_msgs/msg/String", b"/two", b"RIHS01"])
def test_a_damaged_index_is_replaced_by_the_chunks(whole: Path, tmp_path: Path, what: bytes) -> None:
    path = damaged(whole, whole.read_bytes().rindex(what) + 2, 0x01, tmp_path / "run_0.mcap")
    assert not survey(path).whole
    recover(path, tmp_path / "recovered")
    assert recovered(tmp_path / "recovered") == ROWS
    assert read_bag(tmp_path / "recovered")["/two"].type_hash == STRING[2]


def test_a_bag_of_two_files_becomes_one(whole: Path, tmp_path: Path) -> None:
    for number in range(2):
        put(tmp_path / "run" / f"run_{number}.mcap", whole.read_bytes())
    recover(tmp_path / "run", tmp_path / "recovered")
    for name, topic in read_bag(tmp_path / "recovered").items():
        assert topic.cdr == 2 * [row.cdr for row in ROWS if row.topic == name]
    (tmp_path / "link").symlink_to("nowhere")
    for name in ("recovered", "link"):
        with pytest.raises(RecordingError, match="exists already"):
            recover(tmp_path / "run", tmp_path / name)


def test_messages_whose_channel_is_lost_are_lost_bytes(whole: Path, tmp_path: Path) -> None:
    """A bag of two files, of which the first lost the chunk with its channels and its end."""
    first, *_, last = chunks(whole)[:4]
    run = tmp_path / "run"
    first_file = damaged(whole, first.start, 0x7F, run / "run_0.mcap")
    put(first_file, first_file.read_bytes()[: last.end])
    put(run / "run_1.mcap", whole.read_bytes())
    found = survey(run)
    assert (found.message_count, found.lost_messages, found.whole) == (MESSAGES, None, False)
    (loss,) = found.losses
    unknown = sum(len(row.cdr) for row in ROWS[first.count : last.count])
    assert loss.byte_count == first.end - first.start + unknown
    assert (loss.file, loss.after_ns, loss.before_ns) == ("run_0.mcap", None, None)
    recover(run, tmp_path / "recovered")
    assert recovered(tmp_path / "recovered") == ROWS


def test_a_complete_bag_is_left_alone(tmp_path: Path) -> None:
    folder = write_bag(tmp_path / "run", ROWS)
    result = invoke("recover", folder)
    assert result.exit_code == 0, result.output
    assert str(MESSAGES) in result.output
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
    assert json.loads(invoke("recover", folder, "--json").stdout)["whole"] is True
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information: {message_count: 3}")
    assert not survey(folder).whole


def test_a_bag_without_metadata_gets_it_with_its_qos_and_types_once(tmp_path: Path) -> None:
    folder = write_bag(tmp_path / "run", ROWS, "[{depth: 10}]")
    metadata = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").unlink()
    (folder / "scenario.yaml").write_text("name: kept")
    assert not survey(folder).whole
    result = invoke("recover", folder)
    assert result.exit_code == 0, result.output
    recovered = tmp_path / "run_recovered"
    made = {path.name: path.read_bytes() for path in recovered.iterdir()}
    assert made["metadata.yaml"].decode() == metadata.replace("run_0.mcap", "run_recovered_0.mcap")
    assert made["scenario.yaml"] == b"name: kept"
    assert json.loads(invoke("recover", recovered, "--json").stdout)["whole"] is True
    again = invoke("recover", folder)
    assert again.exit_code == 2
    assert "run_recovered" in again.output
    assert {path.name: path.read_bytes() for path in recovered.iterdir()} == made


def test_the_loss_is_reported_of_a_folder_or_file(whole: Path, tmp_path: Path) -> None:
    chunk = chunks(whole)[5]
    file = put(tmp_path / "run" / "run_0.mcap", whole.read_bytes()[: chunk.end + 60])
    result = invoke("recover", file.parent)
    assert result.exit_code == 0
    for words in (f"{chunk.count}", f"{(chunk.count - 1) / 1000:.4g}", "no end"):
        assert words in result.output
    again = json.loads(invoke("recover", file, "--json").stdout)
    assert again["messages"] == chunk.count
    assert again["lost_messages"] is None
    assert again["last_ns"] == ROWS[chunk.count - 1].log_time
    assert survey(file.with_name("run_0_recovered")).whole


@pytest.mark.parametrize("size", [0, 5, 8, 9, 60])
def test_a_recording_without_a_message_is_refused(whole: Path, tmp_path: Path, size: int) -> None:
    put(tmp_path / "run" / "run_0.mcap", whole.read_bytes()[:size])
    result = invoke("recover", tmp_path / "run")
    assert result.exit_code == 2
    assert "Traceback" not in result.output
    assert not (tmp_path / "run_recovered").exists()

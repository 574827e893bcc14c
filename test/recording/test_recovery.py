# SPDX-License-Identifier: Apache-2.0
"""Recordings cut short or damaged anywhere: every complete chunk is recovered, and nothing else."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rosbags.rosbag2 import Reader

from bags import START_NS, STRING, Row, messages_in, text_message, write_bag
from skydiver_utc.cli.main import main
from skydiver_utc.errors import RecordingError
from skydiver_utc.recording.reader import read_bag
from skydiver_utc.recording.recovery import Survey, recover, survey

TOPICS = ("/one", "/two", "/three")
MESSAGES = 120


def rows() -> list[Row]:
    """Different messages of different lengths."""
    texts = [text_message(f"message {k} " + "x" * (k % 17)) for k in range(MESSAGES)]
    return [Row(TOPICS[k % 3], START_NS + k * 1_000_000, 7_000_000 + k, texts[k]) for k in range(MESSAGES)]


def write(path: Path, compression: CompressionType = CompressionType.LZ4) -> Path:
    """The messages in an .mcap file of many small chunks, by the library's writer alone."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=300, compression=compression)
        writer.start(profile="ros2")
        schema = writer.register_schema(STRING[0], "ros2msg", STRING[1].encode())
        metadata = {"topic_type_hash": STRING[2], "offered_qos_profiles": ""}
        ids = {name: writer.register_channel(name, "cdr", schema, metadata) for name in TOPICS}
        for topic, log_time, publish_time, cdr in rows():
            writer.add_message(ids[topic], log_time, cdr, publish_time)
        writer.finish()
    return path


def chunk_ends(path: Path) -> list[tuple[int, int]]:
    """Where each chunk of a whole file ends, and how many messages lie before that, by the file's own index."""
    ends, count = [], 0
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
        assert summary is not None
        for chunk in sorted(summary.chunk_indexes, key=lambda index: index.chunk_start_offset):
            first, last = chunk.message_start_time, chunk.message_end_time
            count += (last - first) // 1_000_000 + 1
            ends.append((chunk.chunk_start_offset + chunk.chunk_length, count))
    assert count == MESSAGES
    assert len(ends) > 8
    return ends


def stored(folder: Path) -> list[Row]:
    """The messages in a bag folder, read by two independent libraries."""
    with Reader(folder) as reader:
        by_rosbags = [(c.topic, log_time, bytes(data)) for c, log_time, data in reader.messages()]
        assert reader.message_count == len(by_rosbags)
    (file,) = folder.glob("*.mcap")
    with file.open("rb") as stream:
        found = [
            Row(channel.topic, message.log_time, message.publish_time, message.data)
            for _, channel, message in make_reader(stream, validate_crcs=True).iter_messages()
        ]
    assert by_rosbags == [(topic, log_time, data) for topic, log_time, _, data in found]
    return found


def cut(source: Path, size: int, path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(source.read_bytes()[:size])
    return path


def call(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["recover", *map(str, arguments)])


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("whole") / "run_0.mcap")


@pytest.mark.long
def test_a_cut_anywhere_keeps_exactly_the_whole_chunks(whole: Path, tmp_path: Path) -> None:
    ends = chunk_ends(whole)
    size = whole.stat().st_size
    seen = set()
    boundaries = {end + offset for end, _ in ends for offset in (-1, 0, 1, 9, 10)}
    for at in sorted(boundaries | set(range(8, size, 101))):
        found = survey(cut(whole, at, tmp_path / "cut.mcap"))
        expected = max((count for end, count in ends if end <= at), default=0)
        assert found.message_count == expected, at
        assert not found.whole
        seen.add(expected)
    assert len(seen) == len(ends) + 1


def places(path: Path) -> Iterator[int]:
    """One cut of every kind: in a chunk, at its end, in an index, in the summary, in the closing magic."""
    for end, _ in chunk_ends(path)[1::5]:
        yield from (end - 20, end, end + 5)
    size = path.stat().st_size
    yield from (size - 300, size - 40, size - 8, size - 1)


@pytest.mark.parametrize("compression", list(CompressionType), ids=lambda kind: kind.name)
def test_a_recovered_bag_is_read_by_others(tmp_path: Path, compression: CompressionType) -> None:
    file = write(tmp_path / "whole.mcap", compression)
    for at in places(file):
        run = tmp_path / f"run_{at}"
        data = cut(file, at, run / "run_0.mcap").read_bytes()
        found = recover(run, tmp_path / f"recovered_{at}")
        expected = max(count for end, count in chunk_ends(file) if end <= at)
        assert stored(tmp_path / f"recovered_{at}") == rows()[:expected]
        assert found.message_count == expected
        assert survey(tmp_path / f"recovered_{at}").whole
        assert {path.name: path.read_bytes() for path in run.iterdir()} == {"run_0.mcap": data}


def test_a_file_with_a_damaged_index_or_frame_is_whole_only_where_others_read_it(
    whole: Path, tmp_path: Path
) -> None:
    """Such bytes lead the library to errors of ten classes, of which none is raised here."""
    data, ends = whole.read_bytes(), [end for end, _ in chunk_ends(whole)]
    positions = [*range(ends[-1], len(data), 61), *range(len(data) - 36, len(data)), *(e - 4 for e in ends)]
    judged = []
    for position in positions:
        damaged = bytearray(data)
        damaged[position] ^= 0x81
        path = cut(whole, 0, tmp_path / "run_0.mcap")
        path.write_bytes(damaged)
        judged.append(survey(path).whole)
        if judged[-1]:
            assert [message.data for message in messages_in(path)] == [row.cdr for row in rows()]
    assert not any(judged[-len(ends) :])
    assert judged.count(True) < len(judged) // 4


@pytest.mark.long
def test_a_damaged_byte_anywhere_costs_at_most_a_chunk(whole: Path, tmp_path: Path) -> None:
    """All messages of the other chunks are recovered, and nothing else, in their order; losses are reported."""
    data, begins = whole.read_bytes(), {}
    for number, (end, count) in enumerate(chunk_ends(whole)):
        begins[end - int.from_bytes(length_of_chunk(whole, number), "little")] = end, count
    sent = {row[3]: place for place, row in enumerate(rows())}
    costs = []
    for position in np.random.default_rng(1).integers(8, len(data), 50).tolist():
        damaged = bytearray(data)
        damaged[position] ^= 0x5A
        path = tmp_path / "run" / "run_0.mcap"
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(damaged)
        found = survey(path)
        if found.whole:
            assert found.message_count == MESSAGES
            continue
        if found.message_count:
            recover(path, tmp_path / str(position))
            back = [sent[row[3]] for row in stored(tmp_path / str(position))]
            assert back == sorted(set(back))
            assert len(back) == found.message_count
            ends = [end for begin, end in begins.items() if begin <= position < end[0]]
            if ends:  # no length in the file is damaged
                lost, (_, count) = set(range(MESSAGES)) - set(back), ends[0]
                before = max((other for _, other in begins.values() if other < count), default=0)
                assert lost <= set(range(before, count)), position
        if found.message_count < MESSAGES:
            assert found.losses or found.lost_messages
        costs.append(MESSAGES - found.message_count)
    assert len(costs) > 25
    # Only a length that is wrong costs all that follows it.
    assert sorted(costs)[len(costs) * 3 // 4] < MESSAGES // 8


def test_a_damaged_chunk_in_the_middle_is_left_out_and_its_times_are_reported(
    whole: Path, tmp_path: Path
) -> None:
    ends = chunk_ends(whole)
    data = bytearray(whole.read_bytes())
    data[ends[4][0] - 30] ^= 0xFF
    path = tmp_path / "run_0.mcap"
    path.write_bytes(data)
    found = survey(path)
    before, after = ends[3][1], ends[4][1]
    assert found.message_count == MESSAGES - (after - before)
    assert found.lost_messages == after - before
    (loss,) = found.losses
    assert (loss.after_ns, loss.before_ns) == (rows()[before - 1][1], rows()[after][1])


@pytest.mark.parametrize("opcode", [0x00, 0x7F])
def test_a_chunk_with_a_damaged_opcode_is_a_loss(whole: Path, tmp_path: Path, opcode: int) -> None:
    (end, before), (_, after) = chunk_ends(whole)[3:5]
    data = bytearray(whole.read_bytes())
    start = data.index(Opcode.CHUNK.to_bytes(1, "little") + length_of_chunk(whole, 4), end)
    data[start] = opcode
    path = tmp_path / "run_0.mcap"
    path.write_bytes(data)
    found = survey(path)
    assert found.message_count == MESSAGES - (after - before)
    (loss,) = found.losses
    assert loss.byte_count == 9 + int.from_bytes(length_of_chunk(whole, 4), "little")
    assert (loss.after_ns, loss.before_ns) == (rows()[before - 1][1], rows()[after][1])


def length_of_chunk(path: Path, number: int) -> bytes:
    """The length of a chunk's contents, as it stands in the file."""
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
        assert summary is not None
        index = sorted(summary.chunk_indexes, key=lambda index: index.chunk_start_offset)[number]
        return (index.chunk_length - 9).to_bytes(8, "little")


@pytest.mark.parametrize("opcode", [0x80, 0xFF])
def test_a_record_of_a_writer_s_own_is_no_loss(whole: Path, tmp_path: Path, opcode: int) -> None:
    (end, _), data = chunk_ends(whole)[3], whole.read_bytes()
    own = bytes([opcode]) + (5).to_bytes(8, "little") + b"12345"
    path = tmp_path / "run_0.mcap"
    path.write_bytes(data[:end] + own + data[end:])
    found = survey(path)
    assert (found.message_count, found.losses, found.lost_messages) == (MESSAGES, [], 0)


@pytest.mark.parametrize("extra", [1, 9, 100])
def test_the_bytes_after_the_last_whole_record_are_counted(whole: Path, tmp_path: Path, extra: int) -> None:
    """A file cut within a chunk, or within the nine bytes before it."""
    (end, count), data = chunk_ends(whole)[5], whole.read_bytes()
    start = data.index(Opcode.CHUNK.to_bytes(1, "little") + length_of_chunk(whole, 6), end)
    found = survey(cut(whole, start + extra, tmp_path / "run_0.mcap"))
    (loss,) = found.losses
    assert (loss.byte_count, loss.after_ns, loss.before_ns) == (extra, rows()[count - 1][1], None)


def test_topics_of_a_damaged_chunk_are_found_at_the_end(whole: Path, tmp_path: Path) -> None:
    ends = chunk_ends(whole)
    data = bytearray(whole.read_bytes())
    data[ends[0][0] - 30] ^= 0xFF
    path = tmp_path / "run_0.mcap"
    path.write_bytes(data)
    recover(path, tmp_path / "recovered")
    assert stored(tmp_path / "recovered") == rows()[ends[0][1] :]


@pytest.mark.parametrize("what", [b"std_msgs/msg/String", b"/two", b"RIHS01"])
def test_a_damaged_index_is_replaced_by_the_chunks(whole: Path, tmp_path: Path, what: bytes) -> None:
    data = bytearray(whole.read_bytes())
    data[data.rindex(what) + 2] ^= 0x01
    path = tmp_path / "run_0.mcap"
    path.write_bytes(data)
    assert not survey(path).whole
    recover(path, tmp_path / "recovered")
    assert stored(tmp_path / "recovered") == rows()
    assert read_bag(tmp_path / "recovered")["/two"].type_hash == STRING[2]


def test_a_bag_of_two_files_becomes_one(whole: Path, tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    for number in range(2):
        cut(whole, whole.stat().st_size, tmp_path / "run" / f"run_{number}.mcap")
    recover(tmp_path / "run", tmp_path / "recovered")
    for name, topic in read_bag(tmp_path / "recovered").items():
        assert topic.cdr == 2 * [row.cdr for row in rows() if row.topic == name]
    (tmp_path / "link").symlink_to("nowhere")
    for name in ("recovered", "link"):
        with pytest.raises(RecordingError, match="exists already"):
            recover(tmp_path / "run", tmp_path / name)


def own_bag(folder: Path) -> Path:
    return write_bag(folder, rows(), "[{depth: 10}]")


def test_a_complete_bag_is_left_alone(tmp_path: Path) -> None:
    folder = own_bag(tmp_path / "run")
    result = call(folder)
    assert result.exit_code == 0, result.output
    assert str(MESSAGES) in result.output
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
    assert json.loads(call(folder, "--json").stdout)["whole"] is True


def test_a_recovered_bag_is_complete(tmp_path: Path) -> None:
    folder = own_bag(tmp_path / "run")
    (folder / "metadata.yaml").unlink()
    assert call(folder).exit_code == 0
    made = {path.name: path.read_bytes() for path in (tmp_path / "run_recovered").iterdir()}
    assert json.loads(call(tmp_path / "run_recovered", "--json").stdout)["whole"] is True
    assert {path.name: path.read_bytes() for path in (tmp_path / "run_recovered").iterdir()} == made
    again = call(folder)
    assert again.exit_code == 2
    assert "run_recovered" in again.output


def test_a_bag_without_metadata_gets_it_with_its_qos_and_types(tmp_path: Path) -> None:
    folder = own_bag(tmp_path / "run")
    metadata = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").unlink()
    (folder / "scenario.yaml").write_text("name: kept")
    assert not survey(folder).whole
    result = call(folder, "--out", tmp_path / "again")
    assert result.exit_code == 0, result.output
    recovered = (tmp_path / "again" / "metadata.yaml").read_text()
    assert recovered == metadata.replace("run_0.mcap", "again_0.mcap")
    assert (tmp_path / "again" / "scenario.yaml").read_text() == "name: kept"


@pytest.mark.parametrize("text", ["", "rosbag2_bagfile_information: {files: 3}", "[" * 3000])
def test_metadata_that_cannot_be_used_are_replaced(tmp_path: Path, text: str) -> None:
    folder = write_bag(tmp_path / "run", rows())
    (folder / "metadata.yaml").write_text(text)
    assert not survey(folder).whole
    recover(folder, tmp_path / "again")
    assert stored(tmp_path / "again") == rows()


def test_metadata_with_another_count_is_no_complete_bag(tmp_path: Path) -> None:
    folder = own_bag(tmp_path / "run")
    metadata = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(metadata.replace(f"message_count: {MESSAGES}", "message_count: 3"))
    assert not survey(folder).whole


def test_the_loss_is_reported(whole: Path, tmp_path: Path) -> None:
    end, count = chunk_ends(whole)[5]
    cut(whole, end + 60, tmp_path / "run" / "run_0.mcap")
    result = call(tmp_path / "run")
    assert result.exit_code == 0
    last = (count - 1) / 1000
    assert f"{count} messages, {last:.3f} s" in result.output
    again = json.loads(call(tmp_path / "run", "--out", tmp_path / "second", "--json").stdout)
    assert again["messages"] == count
    assert again["lost_messages"] is None
    assert again["last_ns"] == rows()[count - 1][1]


@pytest.mark.parametrize("size", [0, 5, 8, 9, 60])
def test_a_recording_without_a_message_is_refused(whole: Path, tmp_path: Path, size: int) -> None:
    cut(whole, size, tmp_path / "run" / "run_0.mcap")
    result = call(tmp_path / "run")
    assert result.exit_code == 2
    assert "Traceback" not in result.output
    assert not (tmp_path / "run_recovered").exists()


def test_the_reader_recommends_the_recovery(whole: Path, tmp_path: Path) -> None:
    file = cut(whole, 2000, tmp_path / "run" / "run_0.mcap")
    with pytest.raises(RecordingError, match="skydiver-utc recover"):
        read_bag(file)
    assert call(file).exit_code == 0
    found: Survey = survey(tmp_path / "run" / "run_0_recovered")
    assert found.whole

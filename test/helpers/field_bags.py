# SPDX-License-Identifier: Apache-2.0
"""Makes the recordings of test/data/field; call it after a change: python test/helpers/field_bags.py"""

import json
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml
import zstandard
from mcap.writer import CompressionType, Writer
from recordings import STRING, Edit, Message, added, change, text, without, write_run
from runs import CART, random_run

from bags import Record, chunk_file, rewritten
from skydiver_utc.loop.outcome import Outcome
from skydiver_utc.parameters import from_yaml, to_yaml

FOLDER = Path(__file__).resolve().parents[1] / "data" / "field"
CART_RUN = random_run(from_yaml(CART.replace("duration_s: 4.0", "duration_s: 0.3")), steps=6)
EVENT = b"service_msgs/ServiceEventInfo info\npkg/srv/Add_Request[<=1] request\n"
Of = Callable[[Record], Record]
More = Callable[[Writer], object]


def main() -> None:
    for path in FOLDER.glob("*.mcap"):
        path.unlink()
    for path in FOLDER.glob("bag_*"):
        shutil.rmtree(path)
    whole = make("whole")
    make("hole", edit=without("state", 2, 3))
    make("no_outcome", edit=without("outcome"))
    ended = random_run(CART_RUN.scenario, steps=0, outcome=Outcome.ABORTED, reason="no clock was there")
    make("ended_before_step_0", run=ended, edit=without("state"))
    make("time_beyond_int64", record=field("command", 2, publish_time=2**64 - 1000))
    make(
        "quality_of_3000_brackets", more=topic("/notes", "cdr", ("s/msg/S", "ros2msg", b"int8 a"), "[" * 3000)
    )
    make("service_event", more=topic("/add/_service_event", "cdr", ("pkg/srv/Add_Event", "ros2msg", EVENT)))
    make("json_notes", more=topic("/notes", "json", ("note", "jsonschema", b"{}")))
    make("no_definition", more=topic("/notes", "json", None))
    make("definition_in_idl", more=topic("/notes", "cdr", ("s/msg/S", "ros2idl", b"struct S {};")))
    make("two_types_on_one_topic", more=topic("/skydiver/command", "cdr", ("s/msg/S", "ros2msg", b"int8 a")))
    make(
        "attachment",
        more=lambda w: (w.add_attachment(1, 1, "a.txt", "text/plain", b"a"), w.add_metadata("b", {})),
    )
    make("damaged_definition_of_telemetry", record=definition("controller/telemetry", b"\xffstring[ name"))
    make("damaged_definition_of_state", record=definition("state", b"\xffstring[ name"))
    make("other_fields_of_outcome", record=definition("outcome", b"string text\n"))
    make("other_fields_of_telemetry", record=definition("controller/telemetry", b"uint32 name\n"))
    make("other_fields_of_state", record=definition("state", b"uint32 header\n"))
    make("damaged_message", record=field("state", 2, data=b"\x00\x01\x00\x00\xff\xff\xff\xff"))
    resolved = yaml.safe_load(to_yaml(CART_RUN.scenario))
    make("scenario_with_extends", edit=added(scenario(resolved | {"extends": 300 * "a"})))
    aliases = "a: &a [1]\n" + "".join(
        f"{b}: &{b} [{', '.join(9 * [f'*{a}'])}]\n" for a, b in zip("abcdefghi", "bcdefghij", strict=True)
    )
    make("scenario_of_aliases", edit=added(("scenario", STRING, 0, text(aliases))))
    make("scenario_with_escapes", edit=added(scenario(resolved | {"title": "\x1b[31mred"})))
    make("change_that_names_a_file", edit=added(change(3, "controller", plant__posture="/home/you/x.yaml")))
    make("change_of_brackets", edit=added(("changes", STRING, 3, text("[" * 3000))))
    data = (FOLDER / "whole.mcap").read_bytes()
    (FOLDER / "no_end.mcap").write_bytes(data[: len(data) * 2 // 3])
    (FOLDER / "flipped_byte.mcap").write_bytes(data[:900] + bytes([data[900] ^ 0x5A]) + data[901:])
    (FOLDER / "empty.mcap").write_bytes(b"")
    (FOLDER / "only_magic.mcap").write_bytes(data[:8])
    packer = zstandard.ZstdCompressor().compressobj(size=1_500_000_000)
    bomb = b"".join([packer.compress(bytes(10_000_000)) for _ in range(150)]) + packer.flush()
    chunk_file(FOLDER / "chunk_of_1_5_gigabytes.mcap", "zstd", bomb, 1_500_000_000)
    chunk_file(FOLDER / "chunk_of_zeros.mcap", "zstd", zstandard.compress(bytes(9_000_000)), 9_000_000)
    bag("no_storage", whole, {"storage_identifier": "", "relative_file_paths": ["bag_0.db3"]})
    bag("empty_metadata", whole, None)
    bag("garbled_metadata", whole, "[" * 3000)
    packed = make("packed", record=compressed)
    bag(
        "compressed_messages",
        packed,
        {"compression_format": "zstd", "compression_mode": "MESSAGE", "relative_file_paths": ["bag_0.mcap"]},
    )
    packed.unlink()
    (FOLDER / "bag_sqlite3").mkdir()
    (FOLDER / "bag_sqlite3" / "bag_0.db3").write_bytes(b"SQLite format 3\x00")


def make(
    name: str, run: Any = CART_RUN, edit: Edit = list, record: Of = lambda r: r, more: More = lambda w: None
) -> Path:
    """A recording of the cart after these edits."""
    with tempfile.TemporaryDirectory() as scratch:
        source = write_run(Path(scratch) / "run", run, edit)
        return rewritten(source, FOLDER / f"{name}.mcap", record, more, compression=CompressionType.ZSTD)


def bag(name: str, file: Path, metadata: object) -> None:
    folder = FOLDER / f"bag_{name}"
    folder.mkdir()
    shutil.copy(file, folder / "bag_0.mcap")
    content = metadata if isinstance(metadata, str) else json.dumps({"rosbag2_bagfile_information": metadata})
    (folder / "metadata.yaml").write_text("" if metadata is None else content)


def field(name: str, k: int, **values: object) -> Of:
    """Sets fields of the message of a topic at a step."""

    def edit(record: Record) -> Record:
        if record[1].topic.endswith(f"/{name}") and record[2].log_time == CART_RUN.scenario.stamp_ns(k):
            for key, value in values.items():
                setattr(record[2], key, value)
        return record

    return edit


def definition(name: str, data: bytes) -> Of:
    def edit(record: Record) -> Record:
        if record[0] is not None and record[1].topic.endswith(f"/{name}"):
            record[0].data = data
        return record

    return edit


def compressed(record: Record) -> Record:
    record[2].data = zstandard.compress(record[2].data)
    return record


def topic(name: str, encoding: str, schema: tuple[str, str, bytes] | None, quality: str = "") -> More:
    def more(writer: Writer) -> None:
        schema_id = writer.register_schema(*schema) if schema else 0
        channel = writer.register_channel(name, encoding, schema_id, {"offered_qos_profiles": quality})
        writer.add_message(channel, CART_RUN.scenario.stamp_ns(1), b'{"x": 1}', CART_RUN.scenario.stamp_ns(1))

    return more


def scenario(content: dict[str, Any]) -> Message:
    return "scenario", STRING, 0, text(yaml.safe_dump(content))


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""The records of an MCAP file, including those inside chunks."""

import struct
from collections.abc import Iterator
from io import BytesIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Message, Schema
from mcap.stream_reader import get_chunk_data_stream
from zstandard import ZstdError

MAGIC = b"\x89MCAP0\r\n"
RECORD_HEADER = struct.Struct("<BQ")  # opcode, length
_MESSAGE_HEADER = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time

# What the libraries raise on damaged bytes: RuntimeError comes from lz4, the last two from wrong lengths.
DAMAGE = (
    *(McapError, ValueError, RuntimeError, LookupError, struct.error, ZstdError),
    *(MemoryError, OverflowError),
)

RawMessage = tuple[int, int, int, bytes]  # channel id, log time, publish time, serialized message


def parts(record: McapRecord) -> Iterator[McapRecord | RawMessage]:
    """The record itself, or the records of a chunk; messages as tuples, in a third of the library's time.

    The checksum of a chunk is verified before its first record is yielded; damage raises an error of `DAMAGE`.
    """
    if isinstance(record, Chunk):
        yield from _parts_of_chunk(record)
    elif isinstance(record, Message):
        yield record.channel_id, record.log_time, record.publish_time, record.data
    else:
        yield record


def _parts_of_chunk(chunk: Chunk) -> Iterator[McapRecord | RawMessage]:
    stream, length = get_chunk_data_stream(chunk, validate_crc=True)
    data = stream.read(length)
    position = 0
    while position < length:
        opcode, size = RECORD_HEADER.unpack_from(data, position)
        start = position + RECORD_HEADER.size
        position = start + size
        if opcode == Opcode.MESSAGE:
            channel_id, _, log_time, publish_time = _MESSAGE_HEADER.unpack_from(data, start)
            yield channel_id, log_time, publish_time, data[start + _MESSAGE_HEADER.size : position]
        elif opcode == Opcode.SCHEMA:
            yield Schema.read(ReadDataStream(BytesIO(data[start:position])))
        elif opcode == Opcode.CHANNEL:
            yield Channel.read(ReadDataStream(BytesIO(data[start:position])))

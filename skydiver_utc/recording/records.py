# SPDX-License-Identifier: Apache-2.0
"""The readable records of an MCAP file, including those inside chunks; damaged ones are told apart."""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import zstandard
from lz4.frame import LZ4FrameDecompressor
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Footer, Metadata, Schema, Statistics

from skydiver_utc.errors import RecordingError

MAGIC = b"\x89MCAP0\r\n"
_HEADER = struct.Struct("<BQ")  # opcode, length
_MESSAGE_HEADER = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_CRC = struct.Struct("<I")
_FIRST_PRIVATE_OPCODE = 0x80
_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
# Bytes that a chunk, or a compressed message, may unpack to; writers begin a new chunk after a few megabytes.
_LARGEST = 2**28

# What the libraries raise on damaged bytes: RuntimeError comes from lz4, the last two from wrong lengths.
DAMAGE = (
    *(McapError, ValueError, RuntimeError, LookupError, struct.error, zstandard.ZstdError),
    *(MemoryError, OverflowError),
)

RawMessage = tuple[int, int, int, bytes]  # channel id, log time, publish time, serialized message
# The records with contents; the others are indexes.
_CONTENTS = {
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.ATTACHMENT: Attachment,
    Opcode.METADATA: Metadata,
    Opcode.STATISTICS: Statistics,
    Opcode.FOOTER: Footer,
}
_INDEXES = frozenset(Opcode) - _CONTENTS.keys() - {Opcode.MESSAGE, Opcode.CHUNK}


class Damaged(NamedTuple):
    """A run of bytes without a readable record, and why."""

    byte_count: int
    reason: str


Part = Any  # a record of the library, a `RawMessage`, or `Damaged`


def parts(file: Path) -> Iterator[Part]:
    """Every record with contents, also in chunks; messages as tuples, in a third of the library's time."""
    for _, size, opcode, data in records(file):
        yield from _parts_of(size, opcode, data)


def records(file: Path) -> Iterator[tuple[int, int, int, bytes]]:
    """Offset, size, opcode and contents of every record, opcode 0 for a cut one; `RecordingError` for no MCAP file."""
    try:
        with file.open("rb") as stream:
            if stream.read(len(MAGIC)) != MAGIC:
                raise RecordingError(
                    f"{file} is not an MCAP file: give the folder of a recording or its .mcap file."
                )
            size = file.stat().st_size
            while (header := stream.read(_HEADER.size)) not in (MAGIC, b""):
                begin, rest = stream.tell() - len(header), size - stream.tell()
                opcode, length = _HEADER.unpack(header) if len(header) == _HEADER.size else (0, rest)
                if length > rest:
                    opcode, length = 0, rest
                yield begin, len(header) + length, opcode, stream.read(length)
    except OSError as error:
        raise RecordingError(f"{file} cannot be read ({error.strerror}): check its permissions.") from error


def unpacked(message: bytes) -> bytes:
    """A message as it was published; rosbag2 can compress each one by itself."""
    return _decompressed(message, "zstd", None) if is_compressed(message) else message


def is_compressed(message: bytes) -> bool:
    """True for a message in a frame of Zstandard; no serialized message begins so."""
    return message.startswith(_ZSTD_MAGIC)


class _ExactStream(ReadDataStream):
    """Refuses a length beyond the end of a record, where the library returns what is there."""

    def read(self, length: int) -> bytes:
        data: bytes = super().read(length)
        if len(data) != length:
            raise ValueError("a length in a record is beyond its end")
        return data


def _parts_of(size: int, opcode: int, data: bytes) -> list[Part]:
    """The parts of one record; one `Damaged` if any of it is damaged."""
    try:
        if opcode == Opcode.CHUNK:
            return list(_parts_of_chunk(data))
        return [part for part in [_part(opcode, data)] if part is not None]
    except DAMAGE as error:
        return [Damaged(size, str(error))]


def _part(opcode: int, data: bytes) -> Part | None:
    """A record, None for one of the indexes and of a writer's own; damage raises an error of `DAMAGE`."""
    if opcode == Opcode.MESSAGE:
        channel_id, _, log_time, publish_time = _MESSAGE_HEADER.unpack_from(data)
        return channel_id, log_time, publish_time, data[_MESSAGE_HEADER.size :]
    if opcode == Opcode.ATTACHMENT and _CRC.unpack(data[-_CRC.size :])[0] not in (
        0,
        zlib.crc32(data[: -_CRC.size]),
    ):
        raise ValueError("the checksum of an attachment is wrong")
    if opcode in _CONTENTS:
        return _CONTENTS[Opcode(opcode)].read(_ExactStream(BytesIO(data)))
    if opcode in _INDEXES or opcode >= _FIRST_PRIVATE_OPCODE:
        return None
    raise ValueError(f"there is no record of kind {opcode}")


def _parts_of_chunk(record: bytes) -> Iterator[Part]:
    chunk = Chunk.read(_ExactStream(BytesIO(record)))
    data = _decompressed(chunk.data, chunk.compression, chunk.uncompressed_size)
    if chunk.uncompressed_crc not in (0, zlib.crc32(data)):
        raise ValueError("the checksum of a chunk is wrong")
    position = 0
    while position < len(data):
        opcode, size = _HEADER.unpack_from(data, position)
        start = position + _HEADER.size
        position = start + size
        if position > len(data):
            raise ValueError("a chunk ends within a record")
        if (part := _part(opcode, data[start:position])) is not None:
            yield part


def _decompressed(data: bytes, compression: str, size: int | None) -> bytes:
    """The bytes of a chunk that claims this size, or of a message; neither may be larger than `_LARGEST`."""
    wanted = zstandard.frame_content_size(data) if size is None else size
    if not 0 <= wanted <= _LARGEST:
        raise ValueError(f"what is compressed claims {wanted} bytes, the most is {_LARGEST}")
    if compression == "zstd" and data:
        # A size in the frame itself is allocated whatever is asked for.
        fits = zstandard.frame_content_size(data) in (-1, wanted)
        data = zstandard.decompress(data, wanted) if fits else b""
    elif compression == "lz4" and data:
        frame = LZ4FrameDecompressor()
        data = frame.decompress(data, max_length=wanted)
        if not frame.eof:
            raise ValueError("the end of a frame is damaged")
    if len(data) != wanted:
        raise ValueError("what is compressed does not have the size that it claims")
    return data

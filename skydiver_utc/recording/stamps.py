"""The stamp of a serialized message, read without decoding the rest of it."""

import struct

from skydiver_utc.recording.errors import RecordingError

NANOSECONDS_PER_SECOND = 1_000_000_000

# sec int32 and nanosec uint32 follow the 4 bytes of the encapsulation header.
_OFFSET = 4
_LITTLE_ENDIAN = struct.Struct("<iI")
_BIG_ENDIAN = struct.Struct(">iI")
_LENGTH = _OFFSET + _LITTLE_ENDIAN.size


def leading_stamp_ns(cdr: bytes) -> int:
    """The stamp, in ns, of a message that begins with a std_msgs/Header or a builtin_interfaces/Time.

    `cdr` is the serialized message with its encapsulation header, in either byte order. Too few bytes, or
    bytes that cannot be a time, raise `RecordingError`; another leading field may still look like a time, so
    ask only for types that begin with one.
    """
    if len(cdr) < _LENGTH:
        raise RecordingError(
            f"A message of {len(cdr)} bytes cannot begin with a stamp: ask only for types that begin with a"
            " std_msgs/Header or a builtin_interfaces/Time."
        )
    layout = _LITTLE_ENDIAN if cdr[1] & 1 else _BIG_ENDIAN
    sec, nanosec = layout.unpack_from(cdr, _OFFSET)
    if nanosec >= NANOSECONDS_PER_SECOND:
        raise RecordingError(
            f"The message does not begin with a stamp ({nanosec} ns is no part of a second): ask only for"
            " types that begin with a std_msgs/Header or a builtin_interfaces/Time."
        )
    return int(sec) * NANOSECONDS_PER_SECOND + int(nanosec)

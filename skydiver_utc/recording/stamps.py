# SPDX-License-Identifier: Apache-2.0
"""The stamp of a serialized message, without deserializing the rest."""

import struct

from skydiver_utc.errors import RecordingError
from skydiver_utc.parameters.nanoseconds import NANOSECONDS

_OFFSET = 4  # bytes of the encapsulation header, before sec (int32) and nanosec (uint32)
_LITTLE_ENDIAN = struct.Struct("<iI")
_BIG_ENDIAN = struct.Struct(">iI")


def leading_stamp_ns(cdr: bytes) -> int:
    """The stamp, in ns, of a message whose type begins with a std_msgs/Header or a builtin_interfaces/Time.

    `cdr` is the serialized message in either byte order. Bytes that are too few or no time raise `RecordingError`;
    other types may look like a time, so call this only for types that begin with one.
    """
    if len(cdr) < _OFFSET + _LITTLE_ENDIAN.size:
        raise RecordingError(f"The message has {len(cdr)} bytes, too few for a stamp: check its publisher.")
    layout = _LITTLE_ENDIAN if cdr[1] & 1 else _BIG_ENDIAN
    sec, nanosec = layout.unpack_from(cdr, _OFFSET)
    if nanosec >= NANOSECONDS:
        raise RecordingError(
            f"The message does not begin with a stamp ({nanosec} ns is more than a second): check its publisher."
        )
    return int(sec) * NANOSECONDS + int(nanosec)

# SPDX-License-Identifier: Apache-2.0
"""The stamp of a serialized message, without deserializing the rest."""

import struct

from skydiver_utc.messages.errors import MessageError
from skydiver_utc.parameters.nanoseconds import NANOSECONDS

_OFFSET = 4  # bytes of the encapsulation header, before sec (int32) and nanosec (uint32)


def leading_stamp_ns(cdr: bytes) -> int:
    """The stamp, in ns, of a message whose type begins with a std_msgs/Header or a builtin_interfaces/Time.

    `cdr` is the serialized message in either byte order. Bytes that are too few or no time raise `MessageError`;
    other types may look like a time, so call this only for types that begin with one.
    """
    try:
        sec, nanosec = struct.unpack_from("<iI" if cdr[1] & 1 else ">iI", cdr, _OFFSET)
    except (IndexError, struct.error) as error:
        raise MessageError(
            "stamp", f"The message has {len(cdr)} bytes, too few for a stamp: check its publisher."
        ) from error
    if nanosec >= NANOSECONDS:
        raise MessageError(
            "stamp",
            f"The message does not begin with a stamp ({nanosec} ns is more than a second): check its publisher.",
        )
    return int(sec) * NANOSECONDS + int(nanosec)

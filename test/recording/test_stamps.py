# SPDX-License-Identifier: Apache-2.0
"""The leading stamp of a serialized message, in both byte orders."""

import struct

import pytest

from skydiver_utc.messages.errors import MessageError
from skydiver_utc.recording.stamps import leading_stamp_ns

LITTLE, BIG = b"\x00\x01\x00\x00", b"\x00\x00\x00\x00"


@pytest.mark.parametrize(("header", "order"), [(LITTLE, "<"), (BIG, ">")])
@pytest.mark.parametrize(("sec", "nanosec"), [(1_700_000_000, 999_999_999), (-1, 500_000_000)])
def test_both_byte_orders(header, order, sec, nanosec):
    cdr = header + struct.pack(f"{order}iI", sec, nanosec)
    for message in (cdr, cdr + b"whatever follows"):
        assert leading_stamp_ns(message) == sec * 10**9 + nanosec


@pytest.mark.parametrize(
    ("cdr", "words"),
    [
        *((cdr, "too few") for cdr in (b"", LITTLE, LITTLE + bytes(7))),
        # A std_msgs/String: length, then characters that would be 1.8e9 ns.
        (LITTLE + struct.pack("<I", 6) + b"hello\x00" + bytes(2), "does not begin with a stamp"),
        (LITTLE + struct.pack("<iI", 1, 10**9), "does not begin with a stamp"),
    ],
)
def test_what_is_no_stamp_is_refused(cdr, words):
    with pytest.raises(MessageError, match=words):
        leading_stamp_ns(cdr)

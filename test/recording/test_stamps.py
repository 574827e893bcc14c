# SPDX-License-Identifier: Apache-2.0
"""The leading stamp of a serialized message, in both byte orders."""

import struct

import pytest

from skydiver_utc.errors import RecordingError
from skydiver_utc.recording.stamps import leading_stamp_ns

LITTLE, BIG = b"\x00\x01\x00\x00", b"\x00\x00\x00\x00"


@pytest.mark.parametrize(("header", "order"), [(LITTLE, "<"), (BIG, ">")])
@pytest.mark.parametrize(
    ("sec", "nanosec"),
    [(0, 0), (1, 4_200_000), (1_700_000_000, 999_999_999), (2**31 - 1, 1), (-1, 500_000_000)],
)
def test_both_byte_orders(header, order, sec, nanosec):
    cdr = header + struct.pack(f"{order}iI", sec, nanosec)
    for message in (cdr, cdr + b"whatever follows"):
        assert leading_stamp_ns(message) == sec * 10**9 + nanosec


@pytest.mark.parametrize("cdr", [b"", LITTLE, LITTLE + bytes(7)])
def test_too_short(cdr):
    with pytest.raises(RecordingError, match="too few"):
        leading_stamp_ns(cdr)


def test_text_is_not_a_stamp():
    # A std_msgs/String: length, then characters that would be 1.8e9 ns.
    text = LITTLE + struct.pack("<I", 6) + b"hello\x00" + bytes(2)
    for cdr in (text, LITTLE + struct.pack("<iI", 1, 10**9)):
        with pytest.raises(RecordingError, match="does not begin with a stamp"):
            leading_stamp_ns(cdr)

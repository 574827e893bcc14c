# SPDX-License-Identifier: Apache-2.0
"""A link of two Ethernet ends (TAP devices) that delays and loses frames, and a ping over it; Linux, root.

The kernel's own `tc qdisc ... netem` does this, too, but many kernels are built without it. As there, a frame is
lost with a probability, and what is not lost comes after `delay` plus or minus a uniform `jitter`: one frame may
overtake another.

    lossy_link.py link NAME_A NAME_B DELAY_MS JITTER_MS LOSS SEED    until stdin ends
    lossy_link.py echo PORT                                          until stdin ends
    lossy_link.py ping ADDRESS PORT COUNT                            prints round trips and losses as JSON
"""

import fcntl
import heapq
import json
import os
import random
import select
import socket
import statistics
import struct
import sys
import time

_TUNSETIFF = 0x400454CA
_IFF_TAP, _IFF_NO_PI = 0x0002, 0x1000
_LARGEST_FRAME = 65536
_PING_PERIOD_S, _PING_PATIENCE_S = 0.01, 1.0


def open_tap(name: str) -> int:
    """The near side of a new Ethernet device; it goes away with its file descriptor."""
    tap = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(tap, _TUNSETIFF, struct.pack("16sH", name.encode(), _IFF_TAP | _IFF_NO_PI))
    return tap


def link(names: tuple[str, str], delay_s: float, jitter_s: float, loss: float, seed: int) -> None:
    """Carry frames between two devices until stdin ends."""
    chance = random.Random(seed)
    a, b = (open_tap(name) for name in names)
    other = {a: b, b: a}
    on_the_way: list[tuple[float, int, int, bytes]] = []
    count = 0
    print("ready", flush=True)
    while True:
        wait_s = max(0.0, on_the_way[0][0] - time.monotonic()) if on_the_way else None
        readable, _, _ = select.select([a, b, sys.stdin], [], [], wait_s)
        if sys.stdin in readable:
            return
        for tap in readable:
            for frame in _frames(tap):
                if chance.random() >= loss:
                    arrives = time.monotonic() + max(0.0, delay_s + chance.uniform(-jitter_s, jitter_s))
                    count += 1
                    heapq.heappush(on_the_way, (arrives, count, other[tap], frame))
        while on_the_way and on_the_way[0][0] <= time.monotonic():
            _, _, tap, frame = heapq.heappop(on_the_way)
            _send(tap, frame)


def _frames(tap: int) -> list[bytes]:
    """What has come on a device; nothing while it is down."""
    frames = []
    try:
        while True:
            frames.append(os.read(tap, _LARGEST_FRAME))
    except OSError:
        return frames


def _send(tap: int, frame: bytes) -> None:
    """A device that is down, or full, loses the frame, as cables do."""
    try:
        os.write(tap, frame)
    except OSError:
        return


def echo(port: int) -> None:
    """Send every datagram back until stdin ends."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as here:
        here.bind(("", port))
        print("ready", flush=True)
        while sys.stdin not in (readable := select.select([here, sys.stdin], [], [])[0]):
            if here in readable:
                here.sendto(*here.recvfrom(_LARGEST_FRAME))


def ping(address: str, port: int, count: int) -> dict[str, float]:
    """Round trips of `count` datagrams [ms], and how many came back."""
    sent: dict[int, float] = {}
    round_trips: dict[int, float] = {}
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as here:
        here.connect((address, port))
        deadline = time.monotonic() + 2 * count * _PING_PERIOD_S + _PING_PATIENCE_S
        while time.monotonic() < deadline and len(round_trips) < count:
            if len(sent) < count:
                sent[len(sent)] = time.monotonic()
                here.send(struct.pack("I", len(sent) - 1))
            while select.select([here], [], [], _PING_PERIOD_S)[0]:
                (number,) = struct.unpack("I", here.recv(4))
                round_trips.setdefault(number, time.monotonic() - sent[number])
    times_ms = sorted(1e3 * value for value in round_trips.values()) or [float("nan")]
    return {
        "sent": len(sent),
        "came_back": len(round_trips),
        "round_trip_ms_median": round(statistics.median(times_ms), 2),
        "round_trip_ms_min": round(times_ms[0], 2),
        "round_trip_ms_max": round(times_ms[-1], 2),
    }


if __name__ == "__main__":
    command, arguments = sys.argv[1], sys.argv[2:]
    if command == "link":
        delay_ms, jitter_ms, share = map(float, arguments[2:5])
        link((arguments[0], arguments[1]), delay_ms / 1e3, jitter_ms / 1e3, share, int(arguments[5]))
    elif command == "echo":
        echo(int(arguments[0]))
    else:
        print(json.dumps(ping(arguments[0], int(arguments[1]), int(arguments[2]))))

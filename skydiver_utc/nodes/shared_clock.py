"""What plants that share one `/clock` tell each other, as JSON; no rclpy here.

One plant publishes `/clock` and says on `/clock/source` who it is; the others follow it and say on `/clock/awaited`
which step they wait for. The clock shows a step only when every follower waits for it.
"""

from typing import TypeVar

import msgspec

from skydiver_utc.nodes.border import BorderError
from skydiver_utc.nodes.roll_call import Claim

# Both sides say that they are there this many times before the other one loses patience.
SIGNS_OF_LIFE = 4


class ClockSource(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The plant that publishes `/clock`, and what those who follow it must have in common with it."""

    claim: Claim
    namespace: str
    mode: str
    dt_ns: int
    epoch_ns: int
    ended: bool = False  # it will show no further step

    def differs_from(self, mode: str, dt_ns: int, epoch_ns: int) -> str:
        """What a follower has otherwise, in words; empty where all is the same."""
        own = {"dt_s": dt_ns / 1e9, "epoch_s": epoch_ns / 1e9, "mode": mode}
        its = {"dt_s": self.dt_ns / 1e9, "epoch_s": self.epoch_ns / 1e9, "mode": self.mode}
        return ", ".join(
            f"{name} is {value}, there it is {its[name]}" for name, value in own.items() if value != its[name]
        )


class Awaited(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A plant that follows the clock: which step it waits for, or that its flight has ended."""

    namespace: str
    step: int
    ended: bool = False


Told = TypeVar("Told", ClockSource, Awaited)


def read(text: str, kind: type[Told]) -> Told:
    """What a message says; anything else raises `BorderError`."""
    try:
        return msgspec.json.decode(text, type=kind)
    except (msgspec.MsgspecError, RecursionError) as error:
        raise BorderError("clock", f"it does not say what plants under one clock say ({error})") from error


def write(told: ClockSource | Awaited) -> str:
    """The text of a message."""
    return msgspec.json.encode(told).decode()

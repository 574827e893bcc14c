# SPDX-License-Identifier: Apache-2.0
"""Message stamps and integer steps: integer nanoseconds on the grid epoch + k dt, in both directions."""

from typing import Any

from skydiver_utc.messages.errors import MessageError
from skydiver_utc.parameters.nanoseconds import NANOSECONDS, stamp_ns


class StepGrid:
    """The times epoch + k dt, k = 0, 1, 2, ...

    Simulated time lies on the grid exactly; a vehicle's own stamps (`exact` False) count as the nearest step.
    """

    def __init__(self, epoch_ns: int, dt_ns: int, exact: bool = True) -> None:
        self.epoch_ns, self.dt_ns, self.exact = epoch_ns, dt_ns, exact

    def set_stamp(self, stamp: Any, k: int) -> None:
        """Write the time of step k into a builtin_interfaces/Time."""
        stamp.sec, stamp.nanosec = divmod(self.epoch_ns + k * self.dt_ns, NANOSECONDS)

    def step_of(self, stamp: Any) -> int:
        """The step of a builtin_interfaces/Time; a time off the grid raises `MessageError`."""
        since_ns = stamp_ns(stamp) - self.epoch_ns
        if not self.exact:
            since_ns += self.dt_ns // 2
        k, rest = divmod(since_ns, self.dt_ns)
        if k < 0 or (rest and self.exact):
            raise MessageError(
                "stamp",
                f"its stamp {stamp.sec}.{stamp.nanosec:09d} s is not on the grid of {self.dt_ns} ns from"
                f" {self.epoch_ns} ns: give every node the same scenario",
            )
        return k

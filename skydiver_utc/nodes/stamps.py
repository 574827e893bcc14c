"""Message stamps and integer steps: exact integer nanoseconds on the global grid, in both directions."""

from typing import Any

from skydiver_utc.nodes.border import BorderError
from skydiver_utc.parameters import Scenario

NANOSECONDS = 1_000_000_000


class StepGrid:
    """The times epoch + k dt of a scenario, k = 0, 1, 2, ..."""

    def __init__(self, scenario: Scenario) -> None:
        self.epoch_ns = scenario.stamp_ns(0)
        self.dt_ns = scenario.dt_ns

    def set_stamp(self, stamp: Any, k: int) -> None:
        """Write the time of step k into a builtin_interfaces/Time."""
        stamp.sec, stamp.nanosec = divmod(self.epoch_ns + k * self.dt_ns, NANOSECONDS)

    def set_duration(self, duration: Any, steps: int) -> None:
        """Write the length of so many steps into a builtin_interfaces/Duration."""
        duration.sec, duration.nanosec = divmod(steps * self.dt_ns, NANOSECONDS)

    def step_of(self, stamp: Any) -> int:
        """The step of a builtin_interfaces/Time; a time off the grid raises `BorderError`."""
        k, rest = divmod(stamp.sec * NANOSECONDS + stamp.nanosec - self.epoch_ns, self.dt_ns)
        if rest or k < 0:
            raise BorderError(
                "stamp",
                f"its stamp {stamp.sec}.{stamp.nanosec:09d} s is not on the grid of {self.dt_ns} ns from"
                f" {self.epoch_ns} ns: give every node the same scenario",
            )
        return int(k)

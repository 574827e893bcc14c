"""The reference's preview: on the wire a JointTrajectory, in the controller values by global step."""

import array
from typing import Any

import numpy as np
from numpy.typing import NDArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from skydiver_utc.nodes.border import BorderError
from skydiver_utc.nodes.stamps import NANOSECONDS, StepGrid
from skydiver_utc.parameters import Signal
from skydiver_utc.simulation.outcome import LARGEST_RATE_RAD_S


def _field(signal: Signal) -> str:
    """Which of a point's lists holds the signal: a rate is a velocity, the pattern angle a position."""
    return "positions" if signal == "alpha" else "velocities"


class PreviewWriter:
    """A signal at consecutive steps into one reused trajectory_msgs/JointTrajectory."""

    def __init__(self, grid: StepGrid, signal: Signal, count: int) -> None:
        self._grid = grid
        self._field = _field(signal)
        self._message = JointTrajectory(joint_names=[signal])
        self._message.points = [self._point(i) for i in range(count)]

    def _point(self, i: int) -> Any:
        point = JointTrajectoryPoint(**{self._field: array.array("d", [0.0])})
        self._grid.set_duration(point.time_from_start, i)
        return point

    def fill(self, k0: int, values: NDArray[np.float64]) -> Any:
        """The message of values (count,), rad/s or rad, at steps k0, k0 + 1, ..."""
        self._grid.set_stamp(self._message.header.stamp, k0)
        for point, value in zip(self._message.points, values.tolist(), strict=True):
            getattr(point, self._field)[0] = value
        return self._message


def read_preview(message: Any, grid: StepGrid, signal: Signal) -> tuple[int, NDArray[np.float64]]:
    """First step k0 and values (count,), rad/s or rad, of a chunk; raises `BorderError`."""
    field = _field(signal)
    if list(message.joint_names) != [signal]:
        raise BorderError("names", f"it names {list(message.joint_names)}: the reference names [{signal!r}]")
    k0 = grid.step_of(message.header.stamp)
    points = message.points
    if not points:
        raise BorderError("size", "it has no points: give one a step")
    values = np.empty(len(points))
    for i, point in enumerate(points):
        given = getattr(point, field)
        if len(given) != 1:
            raise BorderError("size", f"its point {i} has {len(given)} {field}: give one")
        after = point.time_from_start
        if after.sec * NANOSECONDS + after.nanosec != i * grid.dt_ns:
            raise BorderError("stamp", f"its point {i} is not {i} steps of {grid.dt_ns} ns after its stamp")
        values[i] = given[0]
    if not np.isfinite(values).all():
        i = int(np.argmin(np.isfinite(values)))
        raise BorderError("finite", f"its point {i} is {values[i]}: every value must be finite")
    if np.abs(values).max() > LARGEST_RATE_RAD_S:
        i = int(np.argmax(np.abs(values)))
        raise BorderError(
            "model", f"its point {i} is {values[i]:.3g}: beyond {LARGEST_RATE_RAD_S:g} nothing turns"
        )
    return k0, values


class PreviewStore:
    """The part of the reference received so far, by global step; the newest chunk wins where it says something.

    What an older chunk says before and after it stays, so that a short chunk of a stranger does not take away what
    the next decisions need. Of that at most the length of the longest chunk is kept on either side.
    """

    def __init__(self) -> None:
        self._begin = 0
        self._values = np.empty(0)  # of steps _begin, _begin + 1, ...
        self._longest = 0
        self.chunk = 0  # steps of the newest chunk

    def add(self, k0: int, values: NDArray[np.float64]) -> None:
        """Take in a chunk; one that neither overlaps nor follows what is there replaces it."""
        self.chunk = len(values)
        self._longest = max(self._longest, len(values))
        end = k0 + len(values)
        before = after = np.empty(0)
        if self._begin <= end and k0 <= self._end:
            before = self._values[: max(0, k0 - self._begin)][-self._longest :]
            after = self._values[end - self._begin :][: self._longest]
        self._begin = k0 - len(before)
        self._values = np.concatenate([before, values, after])

    def window(self, k: int, count: int) -> NDArray[np.float64] | None:
        """Values (count,) at steps k .. k + count - 1 as a copy, None unless all are there."""
        if k < self._begin or k + count > self._end:
            return None
        return self._values[k - self._begin : k - self._begin + count].copy()

    @property
    def count(self) -> int:
        """How many steps are there."""
        return len(self._values)

    def covered(self) -> str:
        """The steps covered, for a message to people."""
        return f"steps {self._begin} to {self._end - 1}" if len(self._values) else "nothing"

    @property
    def _end(self) -> int:
        return self._begin + len(self._values)

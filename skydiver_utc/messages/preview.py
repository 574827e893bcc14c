# SPDX-License-Identifier: Apache-2.0
"""The reference's preview: a trajectory_msgs/JointTrajectory on the wire, values by step in the controller."""

import array
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.messages.errors import MessageError, refuse_non_finite
from skydiver_utc.messages.grid import StepGrid
from skydiver_utc.parameters.nanoseconds import NANOSECONDS, stamp_ns

_KEPT = 8  # previews; each is longer than what one decision takes


def fill_preview(message: Any, grid: StepGrid, k0: int, values: Array) -> Any:
    """Write values (count, l) at steps k0, k0 + 1, ... into as many points; returns the message.

    The names and the empty points are the caller's. A point's time counts from the message's stamp.
    """
    grid.set_stamp(message.header.stamp, k0)
    for i, (point, row) in enumerate(zip(message.points, values, strict=True)):
        after = point.time_from_start
        after.sec, after.nanosec = divmod(i * grid.dt_ns, NANOSECONDS)
        point.positions = array.array("d", row.tobytes())
    return message


def read_preview(message: Any, grid: StepGrid, outputs: Sequence[str]) -> tuple[int, Array]:
    """First step k0 and values (count, l), columns in the order of `outputs`; the message's order is free."""
    names, points = list(message.joint_names), message.points
    if sorted(names) != sorted(outputs):
        raise MessageError("names", f"it names {names}: the reference names {list(outputs)}")
    k0 = grid.step_of(message.header.stamp)
    if not points:
        raise MessageError("size", "it has no points: give one a step")
    values = np.empty((len(points), len(names)))
    for i, point in enumerate(points):
        if len(point.positions) != len(names):
            raise MessageError(
                "size", f"its point {i} has {len(point.positions)} positions: give {len(names)}"
            )
        if stamp_ns(point.time_from_start) != i * grid.dt_ns:
            raise MessageError("stamp", f"its point {i} is not {i} steps of {grid.dt_ns} ns after its stamp")
        values[i] = point.positions
    values = values[:, [names.index(name) for name in outputs]]
    refuse_non_finite(values.ravel(), [f"point {i}" for i in range(len(points)) for _ in names])
    return k0, values


class PreviewStore:
    """The newest previews received, by step; where two overlap the newer one counts."""

    def __init__(self, outputs: int) -> None:
        self._shape = (outputs,)
        self._previews: deque[tuple[int, Array]] = deque(maxlen=_KEPT)

    def add(self, k0: int, values: Array) -> None:
        """Take in the values (count, l) of steps k0, k0 + 1, ..."""
        self._previews.append((k0, values))

    def window(self, k: int, count: int) -> Array | None:
        """A copy of the values (count, l) from step k on, None unless all are there."""
        if not self._previews:
            return None
        k0, values = self._previews[-1]
        if k0 <= k and k + count <= k0 + len(values):
            return values[k - k0 : k - k0 + count].copy()
        window = np.full((count, *self._shape), np.nan)
        for k0, values in self._previews:
            first, end = max(k, k0), min(k + count, k0 + len(values))
            if first < end:
                window[first - k : end - k] = values[first - k0 : end - k0]
        return None if np.isnan(window).any() else window

    def covered(self) -> str:
        """The steps of the newest preview, as text."""
        if not self._previews:
            return "nothing"
        k0, values = self._previews[-1]
        return f"steps {k0} to {k0 + len(values) - 1}"

# SPDX-License-Identifier: Apache-2.0
"""The grid of steps and the previews on it."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plain_messages import put, time, trajectory

from skydiver_utc.messages import MessageError, PreviewStore, StepGrid, fill_preview, read_preview
from skydiver_utc.parameters.nanoseconds import stamp_ns

GRID = StepGrid(1_767_225_600_000_000_000, 4_200_000)
OUTPUTS = ("yaw_rate", "pitch_rate")


@given(st.integers(0, 10**8))
def test_a_stamp_is_an_integer_step_to_the_nanosecond(k: int) -> None:
    stamp = time()
    GRID.set_stamp(stamp, k)
    assert stamp_ns(stamp) == GRID.epoch_ns + k * GRID.dt_ns
    assert GRID.step_of(stamp) == k
    stamp.nanosec += 1
    with pytest.raises(MessageError):
        GRID.step_of(stamp)


@given(st.integers(0, 10**6), st.integers(-2_099_999, 2_099_999))
def test_a_vehicle_s_stamp_counts_as_the_nearest_step(k: int, off_ns: int) -> None:
    grid = StepGrid(GRID.epoch_ns, GRID.dt_ns, exact=False)
    sec, nanosec = divmod(grid.epoch_ns + k * grid.dt_ns + off_ns, 10**9)
    assert grid.step_of(time(sec, nanosec)) == k


def preview(k0: int, values: np.ndarray, names: tuple[str, ...] = OUTPUTS) -> Any:
    return fill_preview(trajectory(names, len(values)), GRID, k0, values)


@given(st.integers(0, 10**6), st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=20))
def test_a_preview_comes_back_bit_for_bit(k0: int, values: list[float]) -> None:
    wanted = np.array([[value, -value] for value in values])
    found_k0, found = read_preview(preview(k0, wanted), GRID, OUTPUTS)
    assert (found_k0, found.tobytes()) == (k0, wanted.tobytes())
    _, swapped = read_preview(preview(k0, wanted), GRID, OUTPUTS[::-1])
    assert swapped.tobytes() == wanted[:, ::-1].tobytes()


@pytest.mark.parametrize(
    ("kind", "place", "value"),
    [
        ("size", "points", []),
        ("size", "points.1.positions", [1.0]),
        ("finite", "points.2.positions.1", float("nan")),
        ("stamp", "points.2.time_from_start.nanosec", 1),
        ("stamp", "header.stamp.nanosec", 1),
        ("stamp", "header.stamp.sec", 0),  # on the grid, before the epoch
        ("names", "joint_names.0", "roll_rate"),
    ],
)
def test_a_preview_that_cannot_be_used_is_refused(kind: str, place: str, value: object) -> None:
    message = preview(3, np.ones((4, 2)))
    put(message, place, value)
    with pytest.raises(MessageError) as refused:
        read_preview(message, GRID, OUTPUTS)
    assert refused.value.kind == kind


chunks = st.lists(st.tuples(st.integers(0, 40), st.integers(1, 20)), min_size=1, max_size=8)


@given(chunks, st.integers(0, 60), st.integers(1, 15))
def test_the_store_has_the_newest_value_of_each_step_and_nothing_else(
    received: list[tuple[int, int]], k: int, count: int
) -> None:
    store, newest = PreviewStore(1), {}
    for number, (k0, length) in enumerate(received):
        store.add(k0, np.full((length, 1), float(number)))
        newest |= {k0 + i: float(number) for i in range(length)}
    wanted = [newest.get(k + i) for i in range(count)]
    window = store.window(k, count)
    if None in wanted:
        assert window is None
    else:
        assert window is not None
        assert window[:, 0].tolist() == wanted


def test_a_window_cannot_be_changed_from_outside_and_the_store_stays_small() -> None:
    store = PreviewStore(2)
    assert store.window(0, 1) is None
    for k0 in range(0, 10_000, 10):
        store.add(k0, np.full((25, 2), float(k0)))
    window = store.window(10_000, 5)
    assert window is not None
    window[:] = -1.0
    again = store.window(10_000, 5)
    assert again is not None
    assert (again == 9_990.0).all()
    assert store.window(5_000, 1) is None
    assert store.covered() == "steps 9990 to 10014"

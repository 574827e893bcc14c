# SPDX-License-Identifier: Apache-2.0
"""The random search that tunes every controller of the benchmarks."""

from collections.abc import Callable, Iterator

import numpy as np

from skydiver_utc.arrays import Array


def random_search(
    objective: Callable[[Array], float], start: Array, reach: float, flights: int, seed: int
) -> Iterator[tuple[Array, float]]:
    """Points (n,) that were tried, with their objectives.

    First the start, then half of the flights uniformly within `reach` of it, then the others about the best so far,
    ever nearer.
    """
    generator = np.random.default_rng(seed)
    best_point, best = start, np.inf
    random = 1 + (flights - 1) // 2
    for flight in range(flights):
        if flight == 0:
            point = start
        elif flight < random:
            point = start + generator.uniform(-reach, reach, len(start))
        else:
            spread = reach / 3.0 * 0.03 ** ((flight - random) / max(1, flights - random - 1))
            point = best_point + spread * generator.standard_normal(len(start))
        result = objective(point)
        if result < best:
            best_point, best = point, result
        yield point, result

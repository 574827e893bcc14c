# SPDX-License-Identifier: Apache-2.0
"""The paper's claims about linear plants, computed and compared with the package's UTC."""

from collections.abc import Callable
from functools import cache

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.loop.linear_loop import measured_decay
from skydiver_utc.parameters.linear_plant import load_linear_plant
from skydiver_utc.plants.linear import linear_model
from skydiver_utc.studies.claim import Claim, decided
from skydiver_utc.theory.stability import analyse

_PLANT, _LONGER = "admire", 5
_EQUAL, _DIFFERENT = 1e-9, 1e-2
_DECAYS_AGREE = 1e-4  # the digits that are shown
_DRAWS, _SEED, _ROUNDING = 100, 1, 1e-12


@cache
def mean_square(update: Callable[..., Array]) -> Claim:
    """The claim on a linear update, called as `updated_control`."""
    generator = np.random.default_rng(_SEED)
    largest = max(_update_mismatch(update, generator) for _ in range(_DRAWS))
    return decided(
        "The update is the minimum mean square error solution, given the sigma points",
        "on y = B u, 1 to 6 controls, 1 to 3 outputs, W0 from -0.9 to 0.9, the package's UTC moves to u + K (r - B u),"
        f" K = Pu B' (B Pu B' + P_err)^-1, to {_ROUNDING:g}",
        f"largest difference on {_DRAWS} random plants {'below' if largest < _ROUNDING else 'above'} {_ROUNDING:g}",
        [largest < _ROUNDING],
    )


def _update_mismatch(update: Callable[..., Array], generator: np.random.Generator) -> float:
    """Largest difference of one step from the closed form, over the largest entry of that."""
    m, outputs = int(generator.integers(1, 7)), int(generator.integers(1, 4))
    B, factor, P_err = generator.normal(size=(outputs, m)), generator.normal(size=(m, m)), np.eye(outputs)
    Pu = factor @ factor.T + 0.1 * np.eye(m)
    before, wanted = generator.normal(size=m), generator.normal(size=outputs)

    found = update(B, Pu, P_err, generator.uniform(-0.9, 0.9), before, wanted)
    expected = before + Pu @ B.T @ np.linalg.inv(B @ Pu @ B.T + P_err) @ (wanted - B @ before)
    return float(np.abs(found - expected).max() / np.abs(expected).max())


@cache
def stability() -> Claim:
    """The conclusion's outlook."""
    given = load_linear_plant(_PLANT)
    plant = linear_model(given, given.dt_s)
    Qu, P_err = given.process_noise, np.diag(given.P_err)
    added, decays = {}, {}
    for steps in (1, _LONGER):
        found = analyse(plant, steps, Qu, P_err, given.nonlinearity)
        weight = plant.C.T @ np.linalg.solve(P_err, plant.C)
        added[steps] = float(np.abs(found.riccati.additional).max() / np.abs(weight).max())
        decays[steps] = (found.decay, measured_decay(plant, steps, Qu, P_err, found))
    first = f"below {_EQUAL:g}" if added[1] < _EQUAL else f"{added[1]:.2g}"
    return decided(
        "For linear systems stability takes the form of a Riccati equation, with one more term for N > 1",
        "ADMIRE: the additional term of docs/theory.md is zero for N = 1 and not for"
        f" N = {_LONGER}; the package's UTC decays as the loop's eigenvalues say (`skydiver-utc stability --plant"
        f" admire`, `--steps {_LONGER}`)",
        f"the term is {first} for N = 1, {added[_LONGER]:.2g} for N = {_LONGER}, of the error's weight; decay per step"
        f" {_shown(decays[1])}, and {_shown(decays[_LONGER])}",
        [
            added[1] < _EQUAL,
            added[_LONGER] > _DIFFERENT,
            *(abs(flown - expected) < _DECAYS_AGREE for expected, flown in decays.values()),
        ],
    )


def _shown(pair: tuple[float, float]) -> str:
    return f"{pair[0]:.4f} computed, {pair[1]:.4f} flown"

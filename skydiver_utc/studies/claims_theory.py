# SPDX-License-Identifier: Apache-2.0
"""The paper's claims about linear plants, computed and compared with the package's UTC."""

from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.loop.linear_loop import measured_decay, updated_control
from skydiver_utc.parameters.linear_plant import load_linear_plant
from skydiver_utc.plants.linear import LinearModel, linear_model
from skydiver_utc.studies.claim import Claim, decided
from skydiver_utc.studies.paper_results import PaperResults
from skydiver_utc.theory.linear_plant import to_the_horizon
from skydiver_utc.theory.riccati import Riccati, output_riccati
from skydiver_utc.theory.stability import analyse
from skydiver_utc.theory.steady_gain import gain

Array = NDArray[np.float64]

_PLANT, _LONGER = "admire", 5
_EQUAL, _DIFFERENT = 1e-9, 1e-2
_DECAYS_AGREE = 1e-4  # the digits that are shown
_DRAWS, _SEED, _ROUNDING = 100, 1, 1e-12


def mean_square(_results: PaperResults) -> Claim:
    """Claims on the update."""
    return _mean_square(updated_control)


@cache
def _mean_square(update: Callable[..., Array]) -> Claim:
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
    B, Pu, P_err = generator.normal(size=(outputs, m)), _random_covariance(generator, m), np.eye(outputs)
    before, wanted = generator.normal(size=m), generator.normal(size=outputs)

    found = update(B, Pu, P_err, generator.uniform(-0.9, 0.9), before, wanted)
    expected = before + Pu @ B.T @ np.linalg.inv(B @ Pu @ B.T + P_err) @ (wanted - B @ before)
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def _random_covariance(generator: np.random.Generator, size: int) -> Array:
    """A dense positive definite matrix."""
    factor: Array = generator.normal(size=(size, size))
    return factor @ factor.T + 0.1 * np.eye(size)


def stability(_results: PaperResults) -> Claim:
    """The conclusion's outlook."""
    return _stability(output_riccati)


@cache
def _stability(riccati: Callable[..., Riccati]) -> Claim:
    given = load_linear_plant(_PLANT)
    plant = linear_model(given, given.dt_s)
    Qu, P_err = given.process_noise, np.diag(given.P_err)
    without, with_term, decays = {}, {}, {}
    for steps in (1, _LONGER):
        found = analyse(plant, steps, Qu, P_err, given.nonlinearity)
        Pu = found.gain.covariance + Qu
        terms = riccati(plant, Pu, P_err, steps)
        without[steps] = _mismatch(plant, Pu, P_err, steps, terms._replace(additional=0.0 * terms.additional))
        with_term[steps] = _mismatch(plant, Pu, P_err, steps, terms)
        decays[steps] = (found.decay, measured_decay(plant, steps, Qu, P_err, found))
    return decided(
        "For linear systems stability takes the form of a Riccati equation, with one more term for N > 1",
        "ADMIRE: what a step does to the weighted error is cost and effort of the Riccati equation for N = 1, and"
        f" for N = {_LONGER} only with the additional term of docs/theory.md; the package's UTC decays as the"
        f" loop's eigenvalues say (`skydiver-utc stability --plant admire`, `--steps {_LONGER}`)",
        f"mismatch {_size(without[1])} for N = 1; for N = {_LONGER} {_size(without[_LONGER])} without the term,"
        f" {_size(with_term[_LONGER])} with it; decay per step {_shown(decays[1])}, and {_shown(decays[_LONGER])}",
        [
            without[1] < _EQUAL,
            without[_LONGER] > _DIFFERENT,
            with_term[_LONGER] < _EQUAL,
            *(abs(flown - expected) < _DECAYS_AGREE for expected, flown in decays.values()),
        ],
    )


def _mismatch(plant: LinearModel, Pu: Array, P_err: Array, steps: int, terms: Riccati) -> float:
    """X - (A - B L)' X (A - B L) less the terms, over the largest entry of X = C' P_err^-1 C."""
    F, H = to_the_horizon(plant, steps)
    X = plant.C.T @ np.linalg.solve(P_err, plant.C)
    step = plant.A - plant.B @ gain(Pu, H, P_err) @ F
    difference = X - step.T @ X @ step - (terms.cost + terms.effort - terms.additional)
    return float(np.abs(difference).max() / np.abs(X).max())


def _size(mismatch: float) -> str:
    """Two digits, or that it is only rounding."""
    return f"below {_EQUAL:g}" if mismatch < _EQUAL else f"{mismatch:.2g}"


def _shown(pair: tuple[float, float]) -> str:
    return f"{pair[0]:.4f} computed, {pair[1]:.4f} flown"

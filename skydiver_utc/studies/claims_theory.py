"""The paper's claim about linear plants, computed on one and held against a flight of the package's UTC."""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.parameters.linear_plant import load_linear_plant
from skydiver_utc.simulation.linear_loop import fly_linear, measured_decay
from skydiver_utc.studies.claim import Claim, judge
from skydiver_utc.studies.paper_results import PaperResults
from skydiver_utc.theory.linear_plant import LinearPlant, to_the_horizon, zero_order_hold
from skydiver_utc.theory.riccati import Riccati, output_riccati
from skydiver_utc.theory.stability import analyse
from skydiver_utc.theory.steady_gain import gain

Array = NDArray[np.float64]

_PLANT, _LONGER = "admire", 5
_EQUAL, _DIFFERENT = 1e-9, 1e-2
_STEPS, _SHRUNK, _DECAYS_AGREE = 2000, 1e-8, 2e-3


def stability(_results: PaperResults) -> Claim:
    """The conclusion's outlook."""
    given = load_linear_plant(_PLANT)
    A, B = zero_order_hold(np.array(given.A), np.array(given.B), given.dt_s)
    plant = LinearPlant(A, B, np.eye(len(A)) if given.C is None else np.array(given.C))
    Qu, P_err = np.diag(given.Qu), np.diag(given.P_err)
    without, with_term, decays = {}, {}, {}
    for steps in (1, _LONGER):
        found = analyse(plant, steps, Qu, P_err, given.nonlinearity)
        Pu = found.gain.covariance + Qu
        terms = output_riccati(plant, Pu, P_err, steps)
        without[steps] = _mismatch(plant, Pu, P_err, steps, terms._replace(additional=0.0 * terms.additional))
        with_term[steps] = _mismatch(plant, Pu, P_err, steps, terms)
        decays[steps] = (found.decay, _flown(plant, steps, Pu, Qu, P_err, found.slowest, found.across))
    return Claim(
        "For linear systems stability takes the form of a Riccati equation, with one more term for N > 1",
        "ADMIRE: what a step does to the weighted error is cost and effort of the Riccati equation for N = 1, and"
        f" for N = {_LONGER} only with the additional term of docs/theory.md; the package's UTC decays as the"
        " loop's eigenvalues say",
        f"mismatch {_size(without[1])} for N = 1; for N = {_LONGER} {_size(without[_LONGER])} without the term and"
        f" {_size(with_term[_LONGER])} with it; decay per step {_shown(decays[1])}, and {_shown(decays[_LONGER])}"
        " (`skydiver-utc stability --plant admire`)",
        judge(
            [
                without[1] < _EQUAL,
                without[_LONGER] > _DIFFERENT,
                with_term[_LONGER] < _EQUAL,
                *(abs(flown - expected) < _DECAYS_AGREE for expected, flown in decays.values()),
            ]
        ),
    )


def _mismatch(plant: LinearPlant, Pu: Array, P_err: Array, steps: int, terms: Riccati) -> float:
    """X - (A - B L)' X (A - B L) less the terms, over the largest entry of X = C' P_err^-1 C."""
    F, H = to_the_horizon(plant, steps)
    X = plant.C.T @ np.linalg.solve(P_err, plant.C)
    step = plant.A - plant.B @ gain(Pu, H, P_err) @ F
    difference = X - step.T @ X @ step - (terms.cost + terms.effort - terms.additional)
    return float(np.abs(difference).max() / np.abs(X).max())


def _flown(
    plant: LinearPlant, steps: int, Pu: Array, Qu: Array, P_err: Array, start: Array, across: Array
) -> float:
    """Decay per step of the distance from rest, flown from the slowest direction."""
    distance = np.linalg.norm(fly_linear(plant, steps, Pu, Qu, P_err, start, _STEPS) @ across, axis=1)
    return measured_decay(distance[: int((distance > _SHRUNK * distance[0]).sum())])


def _size(mismatch: float) -> str:
    """Two digits, or that it is only rounding."""
    return f"below {_EQUAL:g}" if mismatch < _EQUAL else f"{mismatch:.2g}"


def _shown(pair: tuple[float, float]) -> str:
    return f"{pair[0]:.4f} computed, {pair[1]:.4f} flown"

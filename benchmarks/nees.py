# SPDX-License-Identifier: Apache-2.0
"""NEES: many runs of a pendulum whose noise is what the filter expects, and a figure of the mean over the runs.

    python benchmarks/nees.py FIGURE.png [--runs 200]

The normalised estimation error squared, error' P^-1 error, of a filter that is right has the mean 2, the number of
states; over N runs N times its mean has the chi-square distribution with 2 N degrees of freedom.
"""

import argparse
from pathlib import Path

import numba
import numpy as np
from scipy.stats import chi2

from skydiver_utc.arrays import Array
from skydiver_utc.estimators.protocol import Reading
from skydiver_utc.estimators.unscented_kalman_filter import UnscentedKalmanFilter
from skydiver_utc.plants.function import FunctionPlant

DT_S, STEPS = 0.02, 250
INITIAL, WALK, NOISE = (0.2, 0.4), (0.02, 0.3), 0.05


@numba.njit
def swing(x, u, dt):
    """Angle, 0 hanging down, and rate of a pendulum under a torque."""
    rate = x[1] + dt * (u[0] - 9.0 * np.sin(x[0]) - 0.1 * x[1])
    return np.array([x[0] + dt * rate, rate])


def nees(runs: int, assumed_noise: float = NOISE) -> Array:
    """NEES (runs, STEPS) of a filter that assumes this deviation of the encoder's noise; run i has the seed i."""
    names = {
        "state_names": ("angle", "rate"),
        "control_names": ("torque",),
        "output_names": ("angle", "rate"),
    }
    plant = FunctionPlant(swing, state=(0.8, 0.0), control=0.0, dt=DT_S, **names)
    settings = UnscentedKalmanFilter.Settings.model_validate(
        {
            "sensors": {"encoder": {"of": ["angle"], "rate_Hz": 0.5 / DT_S, "noise": assumed_noise}},
            "initial_deviation": dict(zip(plant.state_names, INITIAL, strict=True)),
            "process_noise": dict(zip(plant.state_names, WALK, strict=True)),
            "angles": ["angle"],
        }
    )
    estimator, found = UnscentedKalmanFilter(settings, plant, DT_S), np.empty((runs, STEPS))
    for run in range(runs):
        rng = np.random.default_rng(run)
        estimator.reset()
        state = plant.initial_state() + INITIAL * rng.standard_normal(2)
        for k in range(STEPS):
            encoder = [Reading(0, k, state[:1] + NOISE * rng.standard_normal(1))] if k % 2 == 0 else []
            error = state - estimator.update(encoder)
            error[0] -= 2.0 * np.pi * np.rint(error[0] / (2.0 * np.pi))
            found[run, k] = error @ np.linalg.solve(estimator.covariance, error)
            torque = np.array([2.0 * np.sin(2.0 * k * DT_S)])
            state = plant.step(state, torque, torque) + np.sqrt(DT_S) * np.array(WALK) * rng.standard_normal(
                2
            )
            estimator.predict(torque)
    return found


def bounds(runs: int) -> tuple[float, float]:
    """Between which the mean NEES of so many runs lies, with 95 %, at a given step."""
    low, high = chi2.ppf([0.025, 0.975], 2 * runs) / runs
    return float(low), float(high)


def main() -> None:
    """Write the figure, print the share of the steps inside the band."""
    from skydiver_utc.analysis.style import BLUE, GREEN, empty_figure, house_style, png

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("figure", type=Path)
    parser.add_argument("--runs", type=int, default=200)
    given = parser.parse_args()
    mean, (low, high) = nees(given.runs).mean(axis=0), bounds(given.runs)
    inside = np.mean((mean >= low) & (mean <= high))
    with house_style():
        figure = empty_figure(8.0, 3.0)
        axes = figure.add_axes((0.08, 0.17, 0.9, 0.68))
        axes.axhspan(low, high, color=GREEN, alpha=0.18, linewidth=0.0)
        axes.plot(DT_S * np.arange(STEPS), mean, color=BLUE, linewidth=1.2)
        axes.set_ylim(0.0, 4.0)
        axes.set_xlabel("time [s]")
        axes.set_title(
            f"NEES, mean of {given.runs} runs of a pendulum: 2 for a filter that is right;"
            f" {100 * inside:.0f} % of the steps lie in the 95 % band",
            fontsize=9.0, loc="left",
        )  # fmt: skip
    given.figure.write_bytes(png(figure))
    print(f"mean NEES {mean.mean():.3f}, {100 * inside:.1f} % of the steps within {low:.3f} to {high:.3f}")


if __name__ == "__main__":
    main()

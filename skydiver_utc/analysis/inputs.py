# SPDX-License-Identifier: Apache-2.0
"""The inputs of a flight from its states: the filter that UTC came from.

Sigma points of the inputs each drive the model over the horizon t_pred, held; their outputs at its end, beside the
measured ones, correct the inputs. UTC is the same step with a reference in the place of the measurement, so its class
computes both. An estimate is therefore of the mean input over the horizon.
"""

import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from skydiver_utc.analysis.estimation import sensor_names
from skydiver_utc.analysis.numbers import finite, root_mean_square
from skydiver_utc.arrays import Array, Flags
from skydiver_utc.controllers.utc.result import UtcResult
from skydiver_utc.controllers.utc.settings import UtcSettings
from skydiver_utc.controllers.utc.unscented_transform_controller import UnscentedTransformController
from skydiver_utc.errors import AnalysisError
from skydiver_utc.loop.run import Run

SCHEMA_VERSION = 1
T_PRED_S = 0.25  # the paper's
SHARES = (1 / 3, 2 / 3, 1.0)  # of the horizon, where outputs are compared
PERIOD_S = 0.02  # between two estimates
# Standard deviation of a measured output, by unit: noise of an inertial unit, and what holding the inputs leaves out.
# Calibrated on fast_turn_unknown_dynamics: two deviations of the estimates hold all of damping and hands, and 81 % of
# alpha, which moves within the horizon.
DEVIATIONS = {"rad/s": 0.05, "rad": 0.02, "m/s": 0.3, "m": 0.1}
_SHARE = 0.01  # of the largest value of an output with any other unit
# An input is seen where its deviation is below this share of that of a number anywhere within its limits.
SEEN = 0.5


@dataclass(frozen=True, eq=False)
class Inputs:
    """Estimates (T, m) with standard deviations (T, m) at the middles of their horizons, time_s (T,).

    applied (T, m): the mean of what was applied over each horizon
    seen (T, m): where the outputs of one horizon leave less than half of the deviation that the limits alone leave
    of_estimate: the states were an estimator's, with its noise, and not the true ones
    """

    run: Run
    time_s: Array
    estimate: Array
    deviation: Array
    applied: Array
    seen: Flags
    of_estimate: bool


def estimate_inputs(run: Run) -> Inputs:
    """The inputs of a run from its estimated states, if it has any, else from the true ones. Raises `AnalysisError`."""
    plant, dt_s = run.plant, run.scenario.dt_s
    steps, period = max(1, round(T_PRED_S / dt_s)), max(1, round(PERIOD_S / dt_s))
    count = len(run.commands) - steps
    if count < 1 or run.holes:
        raise AnalysisError(
            f"the run must have {steps} steps without a hole, {T_PRED_S:g} s: give a longer recording"
        )
    if not np.isfinite(plant.maximum - plant.minimum).all():
        raise AnalysisError("an input without limits has no scale: give the plant limits of every control")
    states, of_estimate = run.states, bool(sensor_names(run))
    if of_estimate:
        first = run.telemetry_names.index(f"estimate_{plant.state_names[0]}")
        states = np.ascontiguousarray(run.telemetry[:, first : first + len(plant.state_names)])
    measured, rows = plant.outputs(states), np.arange(0, min(count, len(states) - steps), period)
    if not np.isfinite(measured).all():
        raise AnalysisError("the recording lacks estimated states: record its telemetry whole")
    span = (plant.maximum - plant.minimum) / np.sqrt(12.0)
    deviations = [
        DEVIATIONS.get(plant.units.get(name, "1"), max(_SHARE * float(np.abs(measured[:, j]).max()), 1e-6))
        for j, name in enumerate(plant.output_names)
    ]
    settings = UtcSettings(
        horizon_steps=tuple(sorted({max(1, round(share * steps)) for share in SHARES})),
        P_err=tuple(d**2 for d in deviations),
        Pu=tuple((span**2).tolist()),
        # An input may go anywhere within its limits in one horizon.
        Qu_ratio=period / steps,
        innovation="control",
    )
    free = copy.copy(plant)
    free.rate = np.full(len(span), np.inf)
    law = UnscentedTransformController(settings, free, plant.output_names)
    law.reset(0.5 * (plant.minimum + plant.maximum))
    estimate, deviation, alone = np.empty((3, len(rows), len(span)))
    for i, k in enumerate(rows):
        found = law.step(states[k], measured[k : k + steps + 1])
        estimate[i], deviation[i] = found.control, found.deviations
        alone[i] = _of_one_horizon(found, np.tile(deviations, len(settings.steps)), span)
    sums = np.cumsum(np.vstack([np.zeros(len(span)), run.applied]), axis=0)
    applied = (sums[rows + steps] - sums[rows]) / steps
    time_s = run.time_s[rows] + 0.5 * steps * dt_s
    return Inputs(run, time_s, estimate, deviation, applied, alone < SEEN * span, of_estimate)


def _of_one_horizon(found: UtcResult, deviations: Array, span: Array) -> Array:
    """sqrt(diag((S^-2 + G' R^-1 G)^-1)) (m,): S the span, G the slope of the outputs over the sigma points."""
    alive = np.isfinite(found.outputs).all(axis=1)
    slope, *_ = np.linalg.lstsq(
        (found.sigma_points - found.sigma_points[0])[alive] / span,
        (found.outputs - found.outputs[0])[alive] / deviations,
        rcond=None,
    )
    left = np.linalg.inv(np.eye(len(span)) + slope @ slope.T)
    return span * np.sqrt(left.diagonal())


def report(found: Inputs) -> dict[str, Any]:
    """As plain data: for each input how long it is seen, and there its RMSE and the share inside two deviations."""
    return {
        "schema_version": SCHEMA_VERSION,
        "scenario": found.run.scenario.name,
        "states": "estimated" if found.of_estimate else "true",
        "inputs": {name: _of_input(found, j) for j, name in enumerate(found.run.plant.control_names)},
    }


def _of_input(found: Inputs, j: int) -> dict[str, Any]:
    seen, error = found.seen[:, j], (found.estimate - found.applied)[:, j]
    share = float(np.mean(seen))
    return {
        "seen_share": share,
        "verdict": "seen" if share > 0.9 else "seen at times" if share > 0.1 else "not seen",
        "rmse": finite(root_mean_square(error[seen])),
        "inside_two_deviations": float(np.mean(np.abs(error[seen]) <= 2.0 * found.deviation[seen, j]))
        if seen.any()
        else None,
        "time_s": found.time_s.tolist(),
        # What is not seen has no estimate.
        "estimate": [float(u) if s else None for u, s in zip(found.estimate[:, j], seen, strict=True)],
        "deviation": found.deviation[:, j].tolist(),
        "applied": found.applied[:, j].tolist(),
    }

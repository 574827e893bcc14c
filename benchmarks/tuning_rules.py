# SPDX-License-Identifier: Apache-2.0
"""Each rule of docs/tuning.md on a plant of a few lines, measured and by its formula.

``python benchmarks/tuning_rules.py``
"""

from math import factorial

import numpy as np

from skydiver_utc import UnscentedTransformController
from skydiver_utc.arrays import Array
from skydiver_utc.studies.markdown import percent, table

DT = 0.02
ORDERS = (1, 2, 3, 4, 5)
RATIOS = (0.01, 0.1, 1.0, 10.0)
HORIZONS = (5, 10, 20)


def chain(state: Array, control: Array, dt: float) -> Array:
    """n integrators in a row, exactly: x_i' = x_i+1, the last one's derivative is the control."""
    n = len(state)
    power = dt ** np.arange(n + 1) / [factorial(j) for j in range(n + 1)]
    return np.array([power[: n - i] @ state[i:] + power[n - i] * control[0] for i in range(n)])


def with_rates(order: int, time_s: float) -> Array:
    """Coefficients of (1 + T d/dt)^(order - 1) y."""
    return np.array(
        [factorial(order - 1) / factorial(order - 1 - i) / factorial(i) * time_s**i for i in range(order)]
    )


def response(order: int, horizon: int, output: Array, steps: int, **settings: object) -> tuple[Array, Array]:
    """y and control of a chain from rest after a step of the reference to 1."""
    given = {"Pu": 1.0, "Qu": 1.0, "P_err": 1e-14, **settings}
    state, y, controls = np.zeros(order), np.empty(steps + 1), np.empty(steps)
    controller = UnscentedTransformController.of(
        chain, lambda x: output @ x, state=state, control=0.0, dt=DT, horizon=horizon, **given
    )
    for k in range(steps):
        y[k] = state[0]
        controls[k] = controller.step(state, 1.0).control[0]
        state = chain(state, controls[k : k + 1], DT)
    y[steps] = state[0]
    return y, controls


def time_constant(horizon: int) -> float:
    """Of the error of an integrator [s], from one step to the next."""
    y, _ = response(1, horizon, np.ones(1), 10)
    return float(-DT / np.log((1.0 - y[-1]) / (1.0 - y[-2])))


def overshoot(order: int, rates: bool, steps: int = 250) -> float:
    """Of a chain under a horizon of 0.4 s, with y or (1 + T d/dt)^(n-1) y as output, T = 0.6 s."""
    output = with_rates(order, 0.6) if rates else np.eye(order)[0]
    y, _ = response(order, 20, output, steps)
    return float(max(y.max() - 1.0, 0.0))


def gain_of(ratio: float) -> float:
    """The share of the innovation that a step takes, where B Qu B' = ratio P_err in steady state."""
    spread = 0.5 * (ratio + np.sqrt(ratio**2 + 4.0 * ratio))
    return float(spread / (1.0 + spread))


def tracking(ratio: float, noise: float = 0.01, steps: int = 600) -> tuple[float, float, float]:
    """Share of the innovation taken at the end, RMSE to a sine, and RMS change of the control in a step.

    x' = u with a horizon of 5 steps and a noise on the measured x; P_err is the noise's variance.
    """
    N, random = 5, np.random.default_rng(1)
    B = N * DT
    controller = UnscentedTransformController.of(
        chain, state=[0.0], control=0.0, dt=DT, horizon=N, Pu=1.0, P_err=noise**2, Qu=ratio * noise**2 / B**2
    )
    state, errors, controls, share = np.zeros(1), [], [0.0], 0.0
    for k in range(steps):
        wanted = np.sin(2.0 * DT * np.arange(k, k + N + 1))[:, None]
        errors.append(state[0] - wanted[0, 0])
        result = controller.step(state + noise * random.normal(size=1), wanted)
        share = B * (result.control[0] - controls[-1]) / result.innovation[0]
        controls.append(result.control[0])
        state = chain(state, result.control, DT)
    late = slice(steps // 4, None)
    return (
        float(share),
        float(np.sqrt(np.mean(np.square(errors[late])))),
        float(np.sqrt(np.mean(np.diff(controls[late]) ** 2))),
    )


def overshoot_of_slow_actuator(horizon: int, rate: float = 1.0) -> float:
    """Of an integrator whose control stays within +-1 and changes by at most `rate` per second."""
    bounds = {"minimum": -1.0, "maximum": 1.0, "rate": rate}
    y, _ = response(1, horizon, np.ones(1), 400, P_err=1e-6, Pu=0.04, Qu=0.004, **bounds)
    return float(max(y.max() - 1.0, 0.0))


def main() -> None:
    horizons = [(f"{n * DT:.1f} s", f"{time_constant(n):.2f} s") for n in HORIZONS]
    print(table(("horizon", "time constant of the error"), horizons))
    slow = [(f"{n * DT:.1f} s", percent(overshoot_of_slow_actuator(n))) for n in (*HORIZONS, 25)]
    print(table(("horizon", "overshoot with a rate limit of 1 /s"), slow))
    head = (
        "integrations n from control to y",
        "overshoot, output y",
        "overshoot, output (1 + T d/dt)^(n-1) y",
    )
    print(table(head, [(str(n), *(percent(overshoot(n, rates)) for rates in (False, True))) for n in ORDERS]))
    head = ("B Qu B' / P_err", "share of the innovation taken", "RMSE", "change of the control in a step")
    rows = [(ratio, gain_of(ratio), *tracking(ratio)[1:]) for ratio in RATIOS]
    print(
        table(head, [(f"{q:g}", f"{gain:.2f}", f"{rmse:.3f}", f"{move:.3f}") for q, gain, rmse, move in rows])
    )


if __name__ == "__main__":
    main()

"""The CasADi model of the tool chains in benchmarks/ is the package's skydiver with a held posture."""

import numpy as np
import pytest

pytest.importorskip("casadi", reason="the tool chains are an extra: pip install '.[bench]'")

from tool_chains.model import derivative, geometry, reduced, step

from skydiver_utc.parameters import load_scenario
from skydiver_utc.plant.dynamics import (
    WORK_SIZE,
    invert_inertia,
    posture_geometry,
    rk4_step,
    state_derivative,
)
from skydiver_utc.plant.model import GEOMETRY_SIZE, build_model

MODEL = build_model(load_scenario("fast_turn_unknown_dynamics"))
NODES = np.linspace(MODEL.control_min[3], MODEL.control_max[3], len(MODEL.geometry))


def random_flight(seed):
    rng = np.random.default_rng(seed)
    state = np.concatenate(
        [np.zeros(3), rng.normal(size=4), [0, 0, -55] + 10 * rng.normal(size=3), 4 * rng.normal(size=3)]
    )
    state[3:7] /= np.linalg.norm(state[3:7])
    control = MODEL.control_min + rng.random(4) * (MODEL.control_max - MODEL.control_min)
    control[3] = rng.choice(NODES)
    return state, control


@pytest.mark.parametrize("seed", range(20))
def test_dynamics_and_step_at_random_states(seed):
    """At the nodes of alpha, where the package's table is exact."""
    state, control = random_flight(seed)
    posture, inverse, expected = np.empty(GEOMETRY_SIZE), np.empty(6), np.empty(13)
    posture_geometry(MODEL, control[3], posture)
    invert_inertia(posture, inverse)
    state_derivative(MODEL, posture, inverse, control, state, expected)
    found = derivative(MODEL)(reduced(state), control, geometry(MODEL)(control[3]))
    scale = np.abs(expected).max()
    np.testing.assert_allclose(np.array(found).ravel(), reduced(expected), atol=1e-9 * scale)
    rk4_step(MODEL, state, control, expected, np.empty(WORK_SIZE))
    found = step(MODEL)(reduced(state), control)
    np.testing.assert_allclose(np.array(found).ravel(), reduced(expected), atol=1e-9)


def test_geometry_between_the_nodes():
    """There the package's cubic table has an error of its own."""
    found, out, series = 0.0, np.empty(GEOMETRY_SIZE), geometry(MODEL)
    for alpha in np.linspace(MODEL.control_min[3], MODEL.control_max[3], 501):
        posture_geometry(MODEL, alpha, out)
        found = max(found, float(np.abs(np.array(series(alpha)).ravel() - out).max()))
    assert found < 5e-7

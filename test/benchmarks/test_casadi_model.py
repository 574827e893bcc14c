# SPDX-License-Identifier: Apache-2.0
"""The CasADi model of the tool chains in benchmarks/ is the package's skydiver with a held posture."""

import numpy as np
import pytest
from skydivers import random_control, step_of

pytest.importorskip("casadi", reason="the tool chains are an extra: pip install '.[bench]'")

from tool_chains.model import derivative, geometry, reduced, step

from skydiver_utc.body.movement import movement
from skydiver_utc.body.segments import build_body
from skydiver_utc.parameters import load_scenario
from skydiver_utc.plants.skydiver.dynamics import (
    invert_inertia,
    posture_geometry,
    state_derivative,
)
from skydiver_utc.plants.skydiver.model import GEOMETRY_SIZE, build_model, posture_rows

SCENARIO = load_scenario("fast_turn_unknown_dynamics")
MODEL = build_model(SCENARIO.plant, SCENARIO.dt_s)
BODY, MOVES = build_body(SCENARIO.plant.subject), movement(SCENARIO.plant.posture, SCENARIO.plant.pattern)


def random_flight(seed):
    rng = np.random.default_rng(seed)
    state = np.concatenate(
        [np.zeros(3), rng.normal(size=4), [0, 0, -55] + 10 * rng.normal(size=3), 4 * rng.normal(size=3)]
    )
    state[3:7] /= np.linalg.norm(state[3:7])
    return state, random_control(rng, SCENARIO)


def at_posture(alpha):
    """The package's model with the body's own posture at alpha in its table, free of interpolation."""
    return MODEL._replace(geometry=np.tile(posture_rows(BODY, MOVES, [alpha]), (4, 1)))


@pytest.mark.parametrize("seed", range(20))
def test_dynamics_and_step_at_random_states_and_postures(seed):
    state, control = random_flight(seed)
    model = at_posture(control[3])
    posture, inverse, expected = np.empty(GEOMETRY_SIZE), np.empty(6), np.empty(13)
    posture_geometry(model, control[3], posture)
    invert_inertia(posture, inverse)
    state_derivative(model, posture, inverse, control, state, expected)
    found = derivative(MODEL)(reduced(state), control, geometry(MODEL)(control[3]))
    scale = np.abs(expected).max()
    np.testing.assert_allclose(np.array(found).ravel(), reduced(expected), atol=1e-9 * scale)
    step_of(model)(state, control, expected)
    found = step(MODEL)(reduced(state), control, MODEL.dt)
    np.testing.assert_allclose(np.array(found).ravel(), reduced(expected), atol=1e-9)


def test_geometry_is_the_body_s_between_the_nodes_too():
    """Only the package's cubic table has an error there."""
    series, tabulated = geometry(MODEL), np.empty(GEOMETRY_SIZE)
    largest = 0.0
    for alpha in np.linspace(*SCENARIO.plant.limits.alpha, 101):
        found = np.array(series(alpha)).ravel()
        np.testing.assert_allclose(found, posture_rows(BODY, MOVES, [alpha])[0], atol=1e-11)
        posture_geometry(MODEL, alpha, tabulated)
        largest = max(largest, float(np.abs(found - tabulated).max()))
    assert 1e-9 < largest < 5e-7

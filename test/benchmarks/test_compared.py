# SPDX-License-Identifier: Apache-2.0
"""The comparison on textbook plants: one model for all controllers, one search, and what a flight holds."""

import numpy as np
import pytest
from compared import SUBJECTS, compared, fly, tables
from random_search import random_search
from textbook_plants import PLANTS, TextbookPlant
from textbook_tasks import TASKS, reference


@pytest.mark.parametrize("name", PLANTS)
def test_the_model_in_casadi_is_the_plant(name):
    """At random states and controls about the start: the same step and the same outputs, lead included."""
    pytest.importorskip("casadi", reason="the tool chains are an extra: pip install '.[bench]'")
    from tool_chains.textbook import model_of

    plant, generator = TextbookPlant(name, lead=0.3), np.random.default_rng(1)
    model = model_of(plant)
    for _ in range(5):
        state = plant.initial_state() + generator.normal(size=len(plant.state_names))
        control = generator.uniform(plant.minimum, plant.maximum)
        expected = plant.step(state, control, control)
        found, outputs = (np.array(value).ravel() for value in model(state, control))
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(outputs, plant.outputs(expected), rtol=1e-12, atol=1e-12)


@pytest.mark.long
@pytest.mark.parametrize("name", PLANTS)
def test_a_reference_is_what_the_outputs_of_its_moves_are(name):
    """From the plant's own start to the last move's end; with a lead (T d/dt + 1)^p of it, here by differences."""
    task, lead = TASKS[name].judged_on, 3.0 * PLANTS[name].dt
    plant, plain = TextbookPlant(name, lead), TextbookPlant(name)
    y, led = (reference(one, task.moves, task.steps) for one in (plain, plant))
    start = plain.outputs(plain.initial_state())
    np.testing.assert_allclose(y[0], start)
    np.testing.assert_allclose(y[-1], start + task.moves[-1][2])
    expected = y
    for _ in range(plain.about.order):
        expected = expected + lead * np.gradient(expected, plain.dt_s, axis=0)
    np.testing.assert_allclose(led, expected, atol=0.1 * task.span)


def test_the_search_begins_at_the_start_and_ends_near_the_best():
    """A bowl about (1, -1): half of the points lie within reach of the start; the others find a better one."""

    def bowl(point):
        return float(np.sum((point - [1.0, -1.0]) ** 2))

    tried = list(random_search(bowl, np.zeros(2), 2.0, 41, 3))
    points, results = (np.array(values) for values in zip(*tried, strict=True))
    np.testing.assert_array_equal(points[0], 0.0)
    assert (np.abs(points[:21]) <= 2.0).all()
    assert results.min() < 0.1 * results[:21].min() or results.min() < 0.01
    np.testing.assert_array_equal(points, [p for p, _ in random_search(bowl, np.zeros(2), 2.0, 41, 3)])


@pytest.mark.long
def test_utc_and_the_regulator_steer_the_ship():
    """Two flights of search each: both stay near, and at rest there is no offset."""
    rows = list(compared(("ship",), ("utc", "lqr"), flights=2))
    assert [row.controller for row in rows] == ["UTC", "LQR"]
    for row in rows:
        assert row.rmse < 5.0
        assert row.settled is not None
        assert row.offset < 1.0
        assert (row.seconds > 0.0).all()
    assert all(row.plant in tables(rows) for row in rows)


def test_the_predictive_controller_holds_the_limits_of_the_ship():
    pytest.importorskip("casadi", reason="the tool chains are an extra: pip install '.[bench]'")
    values = SUBJECTS["mpc"].start | {"horizon": 8.0, "change_cost": 1e-4, "lead": 5.0}
    plant, task = TextbookPlant("ship"), TASKS["ship"].tuned_on
    flight = fly("ship", SUBJECTS["mpc"], values, task)
    assert np.abs(flight.y - flight.wanted).max() < 0.05 * task.span
    assert (np.abs(flight.controls) <= plant.maximum).all()
    assert (np.abs(np.diff(flight.controls, axis=0)) <= plant.rate * plant.dt_s * (1.0 + 1e-6)).all()

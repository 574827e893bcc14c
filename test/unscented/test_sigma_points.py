# SPDX-License-Identifier: Apache-2.0
"""Moments of sigma points, and angles on one turn."""

import numpy as np
import pytest

from skydiver_utc.unscented.sigma_points import (
    add_cross_covariance,
    spread,
    unwrap,
    weighted_mean,
    weights,
)


def test_the_points_have_the_mean_and_the_covariance_that_they_are_made_of():
    rng = np.random.default_rng(1)
    centre, root, points = rng.normal(size=3), np.tril(rng.normal(size=(3, 3))), np.full((7, 3), np.nan)
    spread(centre, root, 0.3, points)
    mean, covariance = np.empty(3), np.zeros((3, 3))
    weighted_mean(points, weights(3, 0.3), mean)
    add_cross_covariance(points, mean, points, mean, weights(3, 0.3), covariance)
    np.testing.assert_allclose(mean, centre, rtol=1e-12)
    np.testing.assert_allclose(covariance, root @ root.T, rtol=1e-12, atol=1e-12)


def test_a_cross_covariance_is_added_about_any_point():
    rng = np.random.default_rng(2)
    a, b, W, before = (rng.normal(size=shape) for shape in ((5, 2), (5, 3), 5, (2, 3)))
    of_a, of_b, found = rng.normal(size=2), rng.normal(size=3), before.copy()
    add_cross_covariance(a, of_a, b, of_b, W, found)
    np.testing.assert_allclose(found, before + (a - of_a).T @ np.diag(W) @ (b - of_b), rtol=1e-12)


@pytest.mark.parametrize("first", [0, 1])
def test_angles_come_onto_the_turn_of_the_first_point_that_is_left(first):
    """A point that is left out stays as it is, and so does the other output."""
    angles = np.array([50.0, 6.2, 0.1, -6.4, 6.2 + 9 * np.pi, 3.0])
    outputs, alive = np.column_stack([np.arange(6.0), angles]), np.ones(6)
    alive[:first] = 0.0
    unwrap(outputs, alive, 1)
    np.testing.assert_array_equal(outputs[:, 0], np.arange(6.0))
    np.testing.assert_array_equal(outputs[: first + 1, 1], angles[: first + 1])
    left = outputs[first:, 1]
    np.testing.assert_allclose(np.exp(1j * left), np.exp(1j * angles[first:]), atol=1e-12)
    assert np.abs(left - angles[first]).max() <= np.pi + 1e-12

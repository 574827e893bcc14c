# SPDX-License-Identifier: Apache-2.0
"""Moments of sigma points, and angles on one turn."""

import numpy as np

from skydiver_utc.unscented.sigma_points import (
    add_cross_covariance,
    spread,
    unwrap,
    weighted_mean,
    weights,
)


def test_the_points_have_the_mean_and_the_covariance_that_they_are_made_of():
    rng = np.random.default_rng(1)
    centre, root, points = rng.normal(size=3), np.tril(rng.normal(size=(3, 3))), np.empty((7, 3))
    spread(centre, root, 0.3, points)
    mean, covariance = np.empty(3), np.zeros((3, 3))
    weighted_mean(points, weights(3, 0.3), mean)
    add_cross_covariance(points, mean, points, mean, weights(3, 0.3), covariance)
    np.testing.assert_allclose(mean, centre, rtol=1e-12)
    np.testing.assert_allclose(covariance, root @ root.T, rtol=1e-12, atol=1e-12)


def test_angles_come_onto_the_turn_of_the_first_point_that_is_left():
    """Point 0 is left out and stays as it is, and so does the other output."""
    angles = np.array([50.0, 6.2, 0.1, -6.4, 6.2 + 9 * np.pi, 3.0])
    outputs = np.column_stack([np.arange(6.0), angles])
    unwrap(outputs, np.array([0.0, 1.0, 1.0, 1.0, 1.0, 1.0]), 1)
    np.testing.assert_array_equal(outputs[:, 0], np.arange(6.0))
    assert outputs[0, 1] == 50.0
    assert outputs[1, 1] == 6.2
    left = outputs[1:, 1]
    np.testing.assert_allclose(np.exp(1j * left), np.exp(1j * angles[1:]), atol=1e-12)
    assert np.abs(left - 6.2).max() <= np.pi + 1e-12

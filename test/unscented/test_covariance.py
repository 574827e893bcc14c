# SPDX-License-Identifier: Apache-2.0
"""Weights and roots against the paper's text and SciPy."""

import numpy as np
import paper_utc as paper
import pytest
from scipy.linalg import sqrtm

from skydiver_utc.unscented.covariance import symmetric_root
from skydiver_utc.unscented.linear_algebra import gain, raise_diagonal
from skydiver_utc.unscented.sigma_points import weights


def test_weights_are_those_of_eq_sigp():
    np.testing.assert_array_equal(weights(4, 0.25), paper.weights(4, 0.25))
    assert weights(4, 0.25).sum() == pytest.approx(1.0, rel=1e-15)


@pytest.mark.parametrize("seed", range(10))
def test_the_root_of_a_covariance_is_scipys_of_the_repaired_matrix(seed):
    """The repair is what the clipped eigenvalues add; a definite matrix stays as it is."""
    rng = np.random.default_rng(seed)
    factor = rng.normal(size=(4, 4))
    Pu = paper.initial_covariance(*rng.choice([-1.0, 1.0], 3)) + (factor @ factor.T) * (seed % 3)
    given, root, scratch = Pu.copy(), np.empty((4, 4)), np.empty((5, 4))
    lifted = symmetric_root(given, 1e-9, root, scratch)
    values, vectors = np.linalg.eigh(Pu)
    repaired = (vectors * np.maximum(values, 1e-9)) @ vectors.T
    np.testing.assert_allclose(given, repaired, atol=1e-12)
    np.testing.assert_allclose(root @ root, repaired, atol=1e-12)
    np.testing.assert_allclose(root, np.real(sqrtm(repaired)), atol=1e-6)
    assert lifted == pytest.approx(np.maximum(1e-9 - values, 0.0).sum(), rel=1e-6, abs=1e-12)
    if values.min() > 1e-6:
        assert lifted == 0.0
        np.testing.assert_array_equal(given, Pu)
    # The same matrix in another unit.
    smaller = np.empty((4, 4))
    assert symmetric_root(1e-20 * Pu, 1e-29, smaller, scratch) == pytest.approx(1e-20 * lifted, rel=1e-6)
    np.testing.assert_allclose(1e10 * smaller, root, atol=1e-12)


@pytest.mark.parametrize(("variances", "lifted"), [([0.0, 0.0, 4.0], 0.5), ([0.0, 0.0, 0.0], 0.75)])
def test_variances_of_zero_become_the_floor(variances, lifted):
    given, root, scratch = np.diag(variances), np.empty((3, 3)), np.empty((4, 3))
    assert symmetric_root(given, 0.25, root, scratch) == lifted
    np.testing.assert_array_equal(given, np.diag(np.maximum(variances, 0.25)))
    np.testing.assert_array_equal(root, np.sqrt(given))


@pytest.mark.parametrize(("m", "l"), [(1, 1), (2, 4), (3, 2)])
def test_the_gain_and_the_covariance_that_it_leaves_are_numpys(m, l):
    """In the place of C_uy and of P."""
    rng = np.random.default_rng(m)
    factor, C_uy, P = rng.normal(size=(l, l)), rng.normal(size=(m, l)), rng.normal(size=(m, m))
    C_y = 0.1 * (factor @ factor.T) + 0.01 * np.eye(l)
    K, left = C_uy.copy(), P.copy()
    assert gain(C_y.copy(), K, left)
    np.testing.assert_allclose(K, C_uy @ np.linalg.inv(C_y), rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(left, P - K @ C_y @ K.T, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("variance", [0.0, -1.0, np.inf, np.nan])
def test_outputs_without_a_definite_covariance_change_nothing(variance):
    K, left = np.ones((1, 2)), np.ones((1, 1))
    assert not gain(np.diag([2.0, variance]), K, left)
    np.testing.assert_array_equal(K, [[1.0, 1.0]])
    np.testing.assert_array_equal(left, [[1.0]])


def test_a_diagonal_is_raised_by_a_share_of_the_trace():
    matrix = np.random.default_rng(1).normal(size=(3, 3))
    raised = matrix.copy()
    raise_diagonal(raised, 0.1)
    np.testing.assert_allclose(raised, matrix + 0.1 * np.trace(matrix) * np.eye(3), rtol=1e-14)

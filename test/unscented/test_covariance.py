# SPDX-License-Identifier: Apache-2.0
"""Weights and roots against the paper's text and SciPy."""

import numpy as np
import paper_utc as paper
import pytest

from skydiver_utc.unscented.covariance import symmetric_root
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
    given, root = Pu.copy(), np.empty((4, 4))
    lifted = symmetric_root(given, 1e-9, root)
    repaired = paper.repair(Pu, 1e-9)
    np.testing.assert_allclose(given, repaired, atol=1e-12)
    np.testing.assert_allclose(root @ root, repaired, atol=1e-12)
    np.testing.assert_allclose(root, paper.matrix_square_root(repaired), atol=1e-6)
    values = np.linalg.eigvalsh(Pu)
    assert lifted == pytest.approx(np.maximum(1e-9 - values, 0.0).sum(), rel=1e-6, abs=1e-12)

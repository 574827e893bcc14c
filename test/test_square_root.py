"""The square-root form: the factor's algebra against NumPy, the law against closed forms and the plain law."""

import numpy as np
import paper_utc
import pytest
from test_unscented_controller import DT, random_plant

from skydiver_utc import Status, UnscentedTransformController
from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.control.utc import UtcLaw
from skydiver_utc.unscented.square_root import lower_triangular, root_of_factor, take_away


def dense_covariance(rng, m):
    factor = rng.normal(size=(m, m))
    return factor @ factor.T + 0.1 * np.eye(m)


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (1, 5), (3, 3), (4, 13), (7, 20)])
def test_the_lower_triangle_has_the_same_square(rows, columns):
    rng = np.random.default_rng(rows)
    array = rng.normal(size=(rows, columns))
    expected = np.linalg.cholesky(array @ array.T)
    lower_triangular(array)
    np.testing.assert_allclose(array[:, :rows], expected, rtol=1e-11, atol=1e-12)
    assert not array[:, rows:].any()


def test_rows_without_content_are_no_obstacle():
    array = np.zeros((3, 5))
    array[2] = [0.0, 3.0, 0.0, 4.0, 0.0]
    lower_triangular(array)
    np.testing.assert_allclose(array @ array.T, np.diag([0.0, 0.0, 25.0]), atol=1e-15)


@pytest.mark.parametrize("m", [1, 2, 4, 6])
def test_root_of_any_factor(m):
    """The symmetric root of S S', whatever S is, against the eigenvectors of LAPACK."""
    rng = np.random.default_rng(m)
    S = rng.normal(size=(m, m))
    values, vectors = np.linalg.eigh(S @ S.T)
    root, given = np.empty((m, m)), S.copy()
    lifted = root_of_factor(given, 1e-12, root, np.empty(m), np.empty((m, m)), np.empty((m, m)))
    np.testing.assert_allclose(root, vectors * np.sqrt(values) @ vectors.T, rtol=1e-10, atol=1e-11)
    np.testing.assert_array_equal(given, S)
    assert lifted == 0.0


def test_a_singular_factor_is_lifted_to_the_floor():
    """S S' = diag(4, 0): the floor of 0.01 becomes the second eigenvalue, and the factor follows."""
    factor, root = np.array([[2.0, 0.0], [0.0, 0.0]]), np.empty((2, 2))
    lifted = root_of_factor(factor, 0.01, root, np.empty(2), np.empty((2, 2)), np.empty((2, 2)))
    assert lifted == pytest.approx(0.01, rel=1e-12)
    np.testing.assert_allclose(factor @ factor.T, np.diag([4.0, 0.01]), rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("size", [1, 2, 5, 8])
def test_downdate(size):
    rng = np.random.default_rng(size)
    P = dense_covariance(rng, size)
    L = np.linalg.cholesky(P)
    direction = rng.normal(size=size)
    z = L @ (0.9 * direction / np.linalg.norm(direction))
    assert take_away(L, size, 0, z.copy()) == 0.0
    np.testing.assert_allclose(L, np.linalg.cholesky(P - np.outer(z, z)), rtol=1e-9, atol=1e-11)


def test_a_downdate_beyond_definiteness():
    """diag(1, 4) less (0, 3)(0, 3)' would be -5: 4 is given, 5 refused; in an output it cannot be done."""
    L = np.diag([1.0, 2.0])
    assert take_away(L, 2, 1, np.array([0.0, 3.0])) == pytest.approx(5.0, rel=1e-9)
    np.testing.assert_allclose(L @ L.T, np.diag([1.0, 0.0]), atol=1e-9)
    L = np.diag([1.0, 2.0])
    assert take_away(L, 2, 2, np.array([0.0, 3.0])) == -1.0
    np.testing.assert_array_equal(L, np.diag([1.0, 2.0]))


@pytest.mark.parametrize(
    ("m", "outputs", "W0"),
    [(4, 1, 0.25), (4, 2, 0.25), (3, 3, 0.0), (6, 2, -0.5), (1, 1, 0.25), (5, 1, -2.0)],
)
def test_linear_oracle(m, outputs, W0):
    """As test_utc_against_paper.test_linear_oracle; most with fewer outputs than controls, Pu dense."""
    rng = np.random.default_rng(m)
    B, Pu, u0 = rng.normal(size=(outputs, m)), dense_covariance(rng, m), rng.normal(size=m)
    R, r, Qu = dense_covariance(rng, outputs) * 1e-2, rng.normal(size=outputs), dense_covariance(rng, m)

    def predict(state, applied, points, preview, y, saved):
        y[:] = points @ B.T
        saved[:] = points

    free = ControlLimits(np.full(m, -np.inf), np.full(m, np.inf), np.full(m, np.inf))
    law = UtcLaw(predict, free, R, W0, square_root=True)
    law.reset(u0, Pu)
    for _ in range(3):
        step = law.step(np.zeros(1), np.zeros(1), r, Qu)
        np.testing.assert_allclose(
            step.control, paper_utc.linear_oracle(u0, Pu, B, R, r), rtol=1e-12, atol=1e-12
        )
        K = Pu @ B.T @ np.linalg.inv(B @ Pu @ B.T + R)
        Pu = Pu + Qu - K @ B @ Pu
        np.testing.assert_allclose(law.covariance, Pu, rtol=1e-11, atol=1e-11)
        u0 = step.control
    assert step.status is Status.SOLVED


@pytest.mark.parametrize("bounded", [False, True], ids=["free", "bounded"])
@pytest.mark.parametrize("seed", range(10))
def test_equals_the_plain_form_on_random_plants(seed, bounded):
    """Thirty closed-loop steps to 1e-10, each form with its own U and Pu; never as many outputs as controls."""
    rng = np.random.default_rng(200 + seed)
    n, m = int(rng.integers(2, 7)), int(rng.integers(2, 6))
    outputs = int(rng.integers(1, m))
    plant, output = random_plant(rng, n, m, outputs)
    state, Pu, Qu = rng.normal(size=n), 0.05 * dense_covariance(rng, m), 0.005 * dense_covariance(rng, m)
    limits = {"minimum": -0.2, "maximum": 0.15, "rate": 5.0} if bounded else {}
    settings = {
        "P_err": rng.uniform(0.01, 0.1, outputs),
        "W0": rng.uniform(-0.5, 0.6),
        "leak": 0.02,
        **limits,
    }
    plain, factored = (
        UnscentedTransformController(
            plant, output, state=state, control=np.zeros(m), dt=DT, horizon=[3, 7] if seed % 2 else 7, Pu=Pu, Qu=Qu,
            square_root=square_root, **settings,
        )
        for square_root in (False, True)
    )  # fmt: skip
    for _ in range(30):
        wanted = rng.normal(size=outputs)
        expected, got = plain.step(state, wanted), factored.step(state, wanted)
        assert np.linalg.eigvalsh(expected.covariance)[0] > 0.0
        for field in ("control", "predicted", "innovation", "covariance"):
            np.testing.assert_allclose(getattr(got, field), getattr(expected, field), rtol=1e-10, atol=1e-10)
        assert (got.status, got.repaired) == (expected.status, 0.0)
        state = plant(state, expected.control, DT)


def test_what_the_plain_form_loses_to_rounding():
    """y = u0 + u1 known to 1e-9 beside a direction that nothing sees: 1e-18 and 1 in one Pu, without a floor.

    The plain form comes out with a negative eigenvalue, which it has to lift; a factor cannot.
    """
    repaired = {}
    for square_root in (False, True):
        controller = UnscentedTransformController(
            lambda x, u, dt: np.array([u[0] + 1.3 * u[1]]), state=[0.0], control=[0.0, 0.0], dt=1.0, horizon=1,
            Pu=1.0, Qu=0.0, P_err=1e-18, covariance_floor=0.0, square_root=square_root,
        )  # fmt: skip
        repaired[square_root] = [controller.step([0.0], 0.3).repaired for _ in range(20)]
    assert max(repaired[False]) > 0.0
    assert max(repaired[True]) == 0.0

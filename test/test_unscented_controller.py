"""The library's controller against textbook UTC on random plants, and against what users do to controllers."""

import re
from pathlib import Path

import numba
import numpy as np
import paper_utc
import plain_utc
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import block_diag

from skydiver_utc import Status, UnscentedTransformController

DT = 0.05


def random_plant(rng, n, m, outputs):
    """A stable nonlinear plant x + dt (A tanh(x) - x + B sin(u) + x0 u0 / 5), and a nonlinear output map of it."""
    A, B, C = rng.normal(size=(n, n)), rng.normal(size=(n, m)), rng.normal(size=(outputs, n))

    def plant(x, u, dt):
        following = np.empty_like(x)
        for i in range(n):
            change = 0.2 * x[0] * u[0] - x[i]
            for j in range(n):
                change += A[i, j] * np.tanh(x[j])
            for j in range(m):
                change += B[i, j] * np.sin(u[j])
            following[i] = x[i] + dt * change
        return following

    def output(x):
        y = np.zeros(outputs)
        for i in range(outputs):
            for j in range(n):
                y[i] += C[i, j] * (x[j] + 0.1 * x[j] ** 2)
        return y

    return plant, output


def lagged(point, control, state, preview, j):
    """An actuator that follows the point with a lag, and leans on state and reference."""
    return control + 0.3 * (point - control) + 0.01 * (preview[j + 1, 0] - state[0])


def closed_loop_beside_the_oracle(
    seed, n, m, outputs, steps, *, bounded, dynamics, jitted, W0=0.25, count=12, drawn=()
):
    """Both controllers step the same plant side by side, each with its own U and Pu; returns both histories.

    Also counts the steps that would have gone another way without limits."""
    rng = np.random.default_rng(seed)
    plant, output = random_plant(rng, n, m, outputs)
    factor = rng.normal(size=(m, m))
    Pu = 0.05 * (factor @ factor.T + 0.3 * np.eye(m))
    P_err = np.diag(rng.uniform(0.01, 0.1, outputs))
    x, U = rng.normal(size=n), rng.uniform(-0.05, 0.05, m)
    if bounded:
        low, high, rate = np.full(m, -0.1), np.full(m, 0.08), rng.uniform(2.0, 20.0, m)
        U[0] = low[0]
    else:
        low, high, rate = np.full(m, -np.inf), np.full(m, np.inf), np.full(m, np.inf)
    rest, P_rest = rng.uniform(-0.05, 0.05, m), rng.uniform(0.01, 0.1, m)
    compiled = [numba.njit(f) if jitted else f for f in (plant, output)]
    controller = UnscentedTransformController(
        *compiled,
        state=x,
        control=U,
        dt=DT,
        horizon=steps,
        minimum=low,
        maximum=high,
        rate=rate,
        P_err=P_err,
        W0=W0,
        Pu=Pu,
        Qu_ratio=0.2,
        control_dynamics=lagged if dynamics else None,
        covariance_floor=1e-9,
        rest=rest if drawn else None,
        P_rest=np.where(np.isin(np.arange(m), drawn), P_rest, np.inf) if drawn else None,
    )
    assert controller.jitted is jitted
    problem = plain_utc.Problem(
        plant, output, DT, tuple(steps), low, high, rate * DT,
        block_diag(*[P_err] * len(steps), *P_rest[list(drawn)]), W0, 1e-9, lagged if dynamics else None,
        drawn, tuple(rest[list(drawn)]),
    )  # fmt: skip
    no_limit = np.full(m, np.inf)
    unbounded = problem._replace(low=-no_limit, high=no_limit, largest_change=no_limit)
    preview = rng.normal(size=(count + steps[-1] + 1, outputs))
    got, expected, limited = [], [], 0
    oracle_U, oracle_Pu = U, Pu
    for k in range(count):
        window = preview[k : k + steps[-1] + 1]
        result = controller.step(x, window)
        free_U, _, _ = plain_utc.step(oracle_U, oracle_Pu, x, window, 0.2 * Pu, unbounded)
        oracle_U, oracle_Pu, predicted = plain_utc.step(oracle_U, oracle_Pu, x, window, 0.2 * Pu, problem)
        got.append(np.concatenate([result.control, result.covariance.ravel(), result.predicted]))
        of_plant = len(predicted) - len(drawn)
        expected.append(np.concatenate([oracle_U, oracle_Pu.ravel(), predicted[:of_plant]]))
        limited += int(np.abs(free_U - oracle_U).max() > 1e-6)
        x = plant(x, result.control, DT)
    return np.array(got), np.array(expected), limited


@pytest.mark.parametrize("dynamics", [False, True], ids=["held", "own dynamics"])
@pytest.mark.parametrize("bounded", [False, True], ids=["free", "bounded"])
@pytest.mark.parametrize("seed", range(8))
def test_agrees_with_textbook_utc_on_random_plants(seed, bounded, dynamics):
    """Twelve closed-loop steps to 1e-10, relative to the size of the numbers (about 1) and absolute."""
    rng = np.random.default_rng(100 + seed)
    n, m, outputs = (int(rng.integers(low, high)) for low, high in ((1, 7), (1, 6), (1, 5)))
    steps = sorted({int(step) for step in rng.integers(1, 15, size=1 + seed % 2)})
    got, expected, limited = closed_loop_beside_the_oracle(
        seed,
        n,
        m,
        outputs,
        steps,
        bounded=bounded,
        dynamics=dynamics,
        jitted=False,
        W0=rng.uniform(-0.5, 0.6),
    )
    np.testing.assert_allclose(got, expected, rtol=1e-10, atol=1e-10)
    assert (limited > 0) is bounded


@pytest.mark.parametrize(("bounded", "dynamics"), [(False, False), (True, True)])
def test_a_jitted_plant_agrees_with_textbook_utc(bounded, dynamics):
    got, expected, _ = closed_loop_beside_the_oracle(
        5, 4, 3, 2, [4, 9], bounded=bounded, dynamics=dynamics, jitted=True
    )
    np.testing.assert_allclose(got, expected, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("jitted", [False, True], ids=["plain", "jitted"])
@pytest.mark.parametrize(("bounded", "dynamics"), [(False, False), (True, False), (True, True)])
def test_controls_drawn_to_rest_agree_with_textbook_utc(bounded, dynamics, jitted):
    """Two of three controls as outputs of their own, beside two outputs of the plant at two steps."""
    got, expected, _ = closed_loop_beside_the_oracle(
        6, 4, 3, 2, [4, 9], bounded=bounded, dynamics=dynamics, jitted=jitted, drawn=(0, 2)
    )
    np.testing.assert_allclose(got, expected, rtol=1e-10, atol=1e-10)


def accumulator(x, u, dt):
    """Without memory: the next state is B u, so the output of one step is y = B u."""
    return np.array([[1.0, -0.7, 0.2], [0.3, 0.4, 2.0]]) @ u + 0.0 * x


@pytest.mark.parametrize("in_place", [False, True])
def test_linear_oracle_through_the_library(in_place):
    """y = B u: U = u0 + K (r - B u0), K = Pu B' (B Pu B' + R)^-1, to relative 1e-12."""
    rng = np.random.default_rng(3)
    factor = rng.normal(size=(3, 3))
    Pu, R, u0, r = factor @ factor.T, np.diag([0.01, 0.2]), rng.normal(size=3), rng.normal(size=2)

    def write(x, u, dt, out):
        out[:] = accumulator(x, u, dt)

    controller = UnscentedTransformController(
        write if in_place else accumulator, state=np.zeros(2), control=u0, dt=1.0, horizon=1, P_err=R, Pu=Pu
    )
    result = controller.step(np.zeros(2), r)
    B = np.array([[1.0, -0.7, 0.2], [0.3, 0.4, 2.0]])
    np.testing.assert_allclose(result.control, paper_utc.linear_oracle(u0, Pu, B, R, r), rtol=1e-12)
    assert result.status is Status.SOLVED
    assert result.sentence.startswith("Solved")


# --------------------------------------------------------------------------- a small plant for all that follows


def cart(x, u, dt):
    """Position and speed under a force."""
    return np.array([x[0] + dt * x[1], x[1] + dt * u[0]])


def position(x):
    return x[0]


def controller(plant=cart, output=position, **changes):
    arguments = {"state": [0.0, 0.0], "control": 0.0, "dt": 0.1, "horizon": 8, "minimum": -1, "maximum": 1}
    return UnscentedTransformController(plant, output, **(arguments | changes))


def assert_usable(result, low=-1.0, high=1.0):
    """Finite and inside the bounds, whatever happened, and told in one sentence."""
    for array in (result.control, result.predicted, result.innovation, result.covariance, result.deviations):
        assert np.isfinite(array).all(), result
    assert np.isfinite(result.repaired)
    assert (low <= result.control).all()
    assert (result.control <= high).all()
    assert result.sentence.endswith(".")
    assert "\n" not in result.sentence


def test_it_drives_the_cart_to_its_place():
    drive, x = controller(), np.zeros(2)
    for _ in range(200):
        result = drive.step(x, 1.0)
        assert_usable(result)
        x = cart(x, result.control, 0.1)
    np.testing.assert_allclose(x, [1.0, 0.0], atol=1e-3)


def test_reset_and_warm_start():
    drive = controller()
    first = drive.step([0.0, 0.0], 1.0)
    second = drive.step([0.0, 0.1], 1.0)
    drive.reset(first.control, first.covariance)
    np.testing.assert_array_equal(drive.step([0.0, 0.1], 1.0).control, second.control)
    drive.reset()
    np.testing.assert_array_equal(drive.control, [0.0])
    np.testing.assert_array_equal(drive.step([0.0, 0.0], 1.0).control, first.control)


def test_what_is_handed_out_is_a_copy():
    drive = controller()
    result = drive.step([0.0, 0.0], 0.01)
    kept = drive.control
    result.control[:] = np.nan
    result.covariance[:] = np.nan
    drive.Pu[:] = np.nan
    drive.control[:] = np.nan
    np.testing.assert_array_equal(drive.control, kept)
    assert_usable(drive.step([0.0, 0.0], 0.01))
    not_begun = drive.step([0.0, np.nan], 0.01)
    expected = not_begun.predicted.copy()
    not_begun.predicted[:] = 1e9
    np.testing.assert_array_equal(drive.step([0.0, np.nan], 0.01).predicted, expected)


def test_rate_limit_counts_per_unit_of_time():
    drive = controller(rate=2.0)
    result = drive.step([0.0, 0.0], 100.0)
    np.testing.assert_allclose(result.control, [0.2])
    assert result.status is Status.SATURATED
    assert result.sentence == "Saturated: control 0 is held by its rate limit."


def test_several_steps_of_the_horizon_take_their_own_rows_of_the_preview():
    """An accumulating plant y = k u: with outputs after 1 and 3 steps the update is least squares over both."""
    steps, P_err, Pu = (1, 3), 0.5, 2.0
    drive = controller(
        lambda x, u, dt: x + u,
        None,
        state=[0.0],
        dt=1.0,
        horizon=steps,
        minimum=-9,
        maximum=9,
        Pu=Pu,
        P_err=P_err,
    )
    preview = np.array([7.0, 1.0, 8.0, 2.0])
    B = np.array([[1.0], [3.0]])
    expected = paper_utc.linear_oracle([0.0], [[Pu]], B, P_err * np.eye(2), preview[[1, 3]])
    np.testing.assert_allclose(drive.step([0.0], preview).control, expected, rtol=1e-12)


# --------------------------------------------------------------------------- what goes wrong inside


def escape(x, u, dt):
    """x' = x^3 + u: escapes to infinity in finite time from where u cannot hold it."""
    return x + dt * (x**3 + u)


escape_jitted = numba.njit(escape)


def overflowing(x, u, dt):
    """The same through plain floats, which raise OverflowError instead of going to infinity."""
    value = float(x[0])
    return np.array([value + dt * (value**3 + float(u[0]))])


@pytest.mark.parametrize("plant", [escape, escape_jitted, overflowing], ids=["numpy", "jitted", "floats"])
def test_points_that_diverge_are_left_out(plant):
    """At x = 1.3 only controls around -2 survive 20 steps; the controller finds them and then holds the plant."""
    drive = controller(
        plant, None, state=[0.0], control=0.0, dt=0.05, horizon=20, minimum=-8, maximum=8, Pu=9.0
    )
    x, lost = np.array([1.3]), 0
    for _ in range(200):
        result = drive.step(x, 0.0)
        assert_usable(result, -8.0, 8.0)
        if result.lost:
            lost += 1
            assert result.status in (Status.REPAIRED, Status.KEPT_PREVIOUS)
            assert "diverged" in result.sentence
        x = escape(x, result.control, 0.05)
    assert lost > 0
    assert abs(x[0]) < 1e-3


def test_to_keep_the_control_when_a_point_diverges_would_lose_that_plant():
    """Why points are left out: textbook UTC that keeps U and Pu instead, from the same start."""
    nothing = np.array([np.inf])
    problem = plain_utc.Problem(
        escape, lambda x: x, 0.05, (20,), np.array([-8.0]), np.array([8.0]), nothing,
        np.array([[1e-4]]), 0.25, 1e-9,
    )  # fmt: skip
    x, U, Pu = np.array([1.3]), np.zeros(1), np.array([[9.0]])
    with np.errstate(all="ignore"):
        for _ in range(40):
            after, Pu_after, _ = plain_utc.step(U, Pu, x, np.zeros((21, 1)), np.array([[0.9]]), problem)
            if np.isfinite(after).all():
                U, Pu = after, Pu_after
            x = escape(x, U, 0.05)
    assert not np.isfinite(x).all()


def test_when_all_points_diverge_the_previous_control_and_covariance_stay():
    drive = controller(escape, None, state=[0.0], control=0.5, dt=0.05, horizon=10, minimum=-8, maximum=8)
    before = drive.Pu
    result = drive.step([1e3], 0.0)
    assert_usable(result, -8.0, 8.0)
    assert result.status is Status.KEPT_PREVIOUS
    assert (result.lost, result.control[0]) == (3, 0.5)
    assert result.sentence == (
        "The previous control was kept: 3 of 3 sigma points diverged inside the horizon;"
        " the next step begins from the initial Pu."
    )
    np.testing.assert_array_equal(drive.Pu, before)
    assert drive.step([0.0], 0.3).status is Status.SOLVED


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_state_or_reference_that_is_not_finite_keeps_the_control(bad):
    drive = controller()
    drive.step([0.0, 0.0], 0.02)
    before, Pu = drive.control, drive.Pu
    for name, result in (
        ("state", drive.step([0.0, bad], 0.02)),
        ("reference", drive.step([0.0, 0.0], bad)),
    ):
        assert_usable(result)
        assert result.status is Status.KEPT_PREVIOUS
        assert result.sentence == f"The previous control was kept: {name} is not finite."
        np.testing.assert_array_equal(result.control, before)
        np.testing.assert_array_equal(result.covariance, Pu)
    assert drive.step([0.0, 0.0], 0.02).status is Status.SOLVED


def test_an_indefinite_covariance_is_repaired_and_reported():
    """Eigenvalues of [[1, 2], [2, 1]] are 3 and -1: the repair adds 1, and the floor."""
    drive = controller(
        lambda x, u, dt: x + dt * u, None, state=[0.0, 0.0], control=[0.0, 0.0], minimum=-9, maximum=9,
        Pu=[[1.0, 2.0], [2.0, 1.0]],
    )  # fmt: skip
    result = drive.step([0.0, 0.0], [0.1, 0.1])
    assert result.status is Status.REPAIRED
    assert result.repaired == pytest.approx(1.0, rel=1e-6)
    assert result.sentence.startswith("Repaired: eigenvalues of Pu were lifted by 1 in all")
    assert_usable(result, -9.0, 9.0)


@pytest.mark.parametrize("given_later", [False, True])
def test_the_square_root_form_tells_of_the_repair_of_a_given_covariance_once(given_later):
    indefinite = [[1.0, 2.0], [2.0, 1.0]]
    drive = controller(
        lambda x, u, dt: x + dt * u, None, state=[0.0, 0.0], control=[0.0, 0.0], minimum=-9, maximum=9,
        Pu=1.0 if given_later else indefinite, Qu=0.1, square_root=True,
    )  # fmt: skip
    if given_later:
        drive.reset(Pu=indefinite)
    result = drive.step([0.0, 0.0], [0.1, 0.1])
    assert result.status is Status.REPAIRED
    assert result.repaired == pytest.approx(1.0, rel=1e-6)
    result = drive.step([0.0, 0.0], [0.1, 0.1])
    assert result.status is Status.SOLVED
    assert result.sentence.startswith("Solved; ")


@pytest.mark.parametrize("square_root", [False, True])
def test_controls_of_different_units_need_no_repair(square_root):
    """A rocket of 1000 kg, thrust up to 20000 N, gimbal to 0.1 rad: variances 4e6 and 4e-4."""

    def rocket(x, u, dt):
        return x + dt * np.array([u[0] / 1000.0 * np.cos(u[1]) - 9.81, u[0] / 1000.0 * np.sin(u[1])])

    drive = controller(
        rocket,
        None,
        control=[9810.0, 0.0],
        minimum=[0.0, -0.1],
        maximum=[20000.0, 0.1],
        square_root=square_root,
    )
    x = np.zeros(2)
    for _ in range(60):
        result = drive.step(x, [1.0, 0.2])
        assert result.status in (Status.SOLVED, Status.SATURATED)
        x = rocket(x, result.control, 0.1)
    np.testing.assert_allclose(x, [1.0, 0.2], atol=1e-2)


@pytest.mark.parametrize("Qu", [np.zeros((1, 1)), [[1e12]], 0.0])
def test_a_process_noise_of_zero_or_huge(Qu):
    drive, x = controller(Qu=Qu), np.zeros(2)
    for _ in range(50):
        result = drive.step(x, 1.0)
        assert_usable(result)
        x = cart(x, result.control, 0.1)


anything = st.floats(allow_nan=True, allow_infinity=True)


@settings(max_examples=150)
@given(
    states=st.lists(arrays(float, 2, elements=anything), min_size=1, max_size=6),
    reference=anything,
    factor=arrays(float, (2, 2), elements=st.floats(-1e6, 1e6)),
    W0=st.floats(-20.0, 0.99),
    variance=st.floats(1e-12, 1e12),
    square_root=st.booleans(),
)
def test_whatever_arrives_the_control_is_finite_and_in_bounds(
    states, reference, factor, W0, variance, square_root
):
    """Any state, any reference, any covariance that can be given, on a plant that can diverge."""

    def plant(x, u, dt):
        return x + dt * (x**3 + np.array([u[0] * x[1], u[1]]))

    symmetric = factor + factor.T
    np.fill_diagonal(symmetric, np.abs(np.diag(symmetric)) + 1e-9)
    drive = UnscentedTransformController(
        plant, None, state=[0.0, 0.0], control=[0.0, 0.0], dt=0.1, horizon=5,
        minimum=[-1, -2], maximum=[3, 4], Pu=symmetric, Qu=symmetric, P_err=variance, W0=W0,
        square_root=square_root,
    )  # fmt: skip
    for state in states:
        assert_usable(drive.step(state, [reference, 0.0]), np.array([-1, -2]), np.array([3, 4]))


# --------------------------------------------------------------------------- what a user gets wrong


WRONG = [
    ({"dt": 0.0}, "dt is 0; it must be above 0"),
    ({"dt": np.nan}, "dt holds a value that is not finite"),
    ({"dt": "fast"}, "dt must be numbers"),
    ({"horizon": 0}, "horizon is 0; it must be a whole number of at least 1"),
    ({"horizon": 2.5}, "horizon is 2.5"),
    ({"horizon": []}, "horizon is"),
    ({"horizon": [5, 3]}, "rising order"),
    ({"W0": 1.0}, "W0 is 1; it must be below 1"),
    ({"minimum": 2.0}, "minimum 2 of control 0 is above its maximum 1"),
    ({"minimum": [-1.0, -1.0]}, "minimum has shape (2,), but there are 1 controls"),
    ({"maximum": np.nan}, "maximum holds NaN"),
    ({"control": 5.0}, "control 0 is 5 at the start, outside its bounds -1 .. 1"),
    ({"control": [[0.0]]}, "control has shape (1, 1); it must be a vector"),
    ({"rate": 0.0}, "rate must be above zero"),
    ({"state": [0.0, np.inf]}, "state holds a value that is not finite"),
    ({"P_err": -1.0}, "P_err has a negative variance"),
    ({"P_err": 0.0}, "P_err must be positive definite"),
    ({"P_err": [1.0, 1.0]}, "P_err has shape (2,), but there are 1 outputs"),
    ({"Pu": np.nan}, "Pu holds a value that is not finite"),
    ({"Pu": 0.0}, "Pu has a variance of zero"),
    ({"minimum": None}, "Pu is needed"),
    ({"Qu": np.eye(2)}, "Qu has shape (2, 2), but there are 1 controls"),
    ({"Qu_ratio": -0.1}, "Qu_ratio is -0.1; it must be at least 0"),
    ({"covariance_floor": -1.0}, "covariance_floor is -1"),
    ({"plant": lambda x, u: x}, "plant must be a function"),
    ({"plant": lambda x, u, dt: x[:1]}, "plant returns shape (1,) for a state of shape (2,)"),
    ({"plant": lambda x, u, dt: x * np.nan}, "plant returns [nan, nan]"),
    ({"output": 3}, "output must be a function"),
    ({"output": lambda x: x[:0]}, "output returns shape (0,)"),
    ({"output": lambda x: np.full(2, np.inf)}, "output returns"),
    (
        {"control": [0.0, 0.0], "Pu": [[1.0, 0.5], [0.0, 1.0]]},
        "Pu is not symmetric",
    ),
]  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "told"), WRONG, ids=lambda value: value if isinstance(value, str) else ""
)
def test_an_argument_that_is_wrong_is_named(changes, told):
    with pytest.raises(ValueError, match=re.escape(told)):
        controller(**changes)


@pytest.mark.parametrize("Pu", [0.0, -1.0])
def test_a_warm_start_asks_the_same_of_a_covariance(Pu):
    with pytest.raises(ValueError, match="Pu has a"):
        controller().reset(Pu=Pu)


@pytest.mark.parametrize(
    ("state", "reference", "told"),
    [
        ([0.0], 1.0, "state has shape (1,) instead of (2,)"),
        ([0.0, 0.0], [1.0, 2.0], "reference has shape (2,)"),
        ([0.0, 0.0], np.zeros((9, 2)), "reference has shape (9, 2)"),
        ([0.0, 0.0], "left", "reference must be numbers"),
    ],
)
def test_a_step_with_the_wrong_shape_is_an_error(state, reference, told):
    with pytest.raises(ValueError, match=re.escape(told)):
        controller().step(state, reference)


def test_a_jitted_plant_beside_an_output_that_cannot_be_compiled_is_named():
    not_arrays = object()
    with pytest.raises(ValueError, match="does not compile: Untyped"):
        controller(numba.njit(cart), lambda x: 1.0 if not_arrays else 0.0)


def test_the_quick_start_runs_as_printed(capsys):
    """At most 25 lines; the pendulum hangs at 1 rad under 9.81 sin(1) = 8.255."""
    page = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    code = page.partition("## UTC on your own plant")[2].partition("```python\n")[2].partition("```")[0]
    assert 10 < len(code.splitlines()) <= 25
    exec(code, {})
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith("angle 1.0000 rad, control 8.255 +-")
    assert second.startswith("Solved;")

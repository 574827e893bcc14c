# SPDX-License-Identifier: Apache-2.0
"""The gallery: each example flies, and its error is below a bound that follows from its plant."""

import sys
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.long

FOLDER = Path(__file__).parents[2] / "examples"
EXAMPLES = ("admire", "cart_pole", "quadcopter", "scalar_linear", "skydiver")


@pytest.fixture(autouse=True)
def _examples_importable(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))


def test_every_example_is_shown():
    page = (FOLDER.parent / "docs" / "library.md").read_text(encoding="utf-8")
    gallery = {
        path.stem for path in FOLDER.glob("*.py") if "UnscentedTransformController" in path.read_text("utf-8")
    }
    assert gallery == set(EXAMPLES)
    assert all(f"| [{name}.py](../examples/{name}.py) |" in page for name in EXAMPLES)


def test_scalar_linear():
    """Full force needs at most ln(2.5) = .92 s for a step; the error falls e-fold per horizon of .2 s.

    So 1.5 s after a step it is below 1.5 exp(-(1.5 - .92) / .2) = .08.
    """
    from scalar_linear import fly

    time, reference, states, controls, _ = fly()
    late = (time % 2.0) > 1.5
    assert np.abs(states - reference)[late].max() < 0.08
    assert np.abs(controls).max() == 2.0


def test_cart_pole():
    """Three poles at 3/s: 4 s after the catch what is left is below (1 + 12 + 72) exp(-12) = 5e-4 of the place."""
    from cart_pole import FORCE, fly

    time, states, forces, balanced = fly()
    caught = np.flatnonzero(~balanced)[-1] + 1
    assert time[caught] < 4.0
    late = time > time[caught] + 4.0
    lean = np.arctan2(np.sin(states[late, 1]), np.cos(states[late, 1]))
    assert np.abs(lean).max() < 1e-3
    assert np.abs(states[late, 0]).max() < 1e-2
    assert np.cos(states[0, 1]) < -0.999
    assert np.abs(forces).max() <= FORCE


def test_admire():
    """The reversal of the roll asks for up to 1 / .15 = 6.7 rad/s2, the surfaces on their bounds give 4.5.

    So the roll rate falls behind by at most about 2.2 rad/s2 x .3 s for half a second of ten: 8 deg/s RMSE.
    """
    from admire import HIGHEST, LOWEST, fly

    _, wanted, states, surfaces = fly()
    assert ((surfaces >= LOWEST) & (surfaces <= HIGHEST)).all()
    assert np.sqrt(np.mean((states - wanted) ** 2, axis=0)).max() < np.deg2rad(8.0)
    assert np.abs(states[-1] - wanted[-1]).max() < np.deg2rad(0.1)


def test_quadcopter():
    """Three poles at 3/s: 6 s on, the start 2 m away is forgotten to 2 (1 + 18 + 162) exp(-18) m = 1e-5 m.

    What remains is that the outputs hold for small angles: on the helix roll and pitch reach 1.28 / 9.81 = .13 rad
    and tan(angle) = angle is wrong by .13^3 / 3: .007 m/s2, and 3 / 3^2 of that in place, 2 mm. Ten times that.
    """
    from quadcopter import fly

    time, places, states, controls = fly(10.0)
    distance = np.linalg.norm(states[:, :3] - places.T, axis=1)
    assert distance[time > 6.0].max() < 0.024
    assert distance[0] == pytest.approx(2.0)
    assert np.abs(controls[:, 1:]).max() <= 1.0


def test_skydiver_is_the_flight_of_the_package():
    """The library with the same settings flies what `simulate` flies, to the rounding that a closed loop grows."""
    from skydiver import fly

    from skydiver_utc.loop.closed_loop import simulate
    from skydiver_utc.parameters import load_scenario

    _, _, rates, controls = fly(0.5)
    flight = simulate(load_scenario("fast_turn_unknown_dynamics", {"duration_s": 0.5}))
    np.testing.assert_allclose(rates, flight.states[: len(rates), 12], atol=1e-8)
    np.testing.assert_allclose(controls, flight.commands[: len(controls)], atol=1e-6)


def test_an_example_as_a_command(tmp_path, monkeypatch, capsys):
    """One line, and a figure where it is asked for."""
    import scalar_linear

    monkeypatch.setattr(sys, "argv", ["scalar_linear", "--figure", str(tmp_path / "out.png")])
    scalar_linear.main()
    assert capsys.readouterr().out.startswith("scalar_linear: ")
    assert (tmp_path / "out.png").read_bytes().startswith(b"\x89PNG")

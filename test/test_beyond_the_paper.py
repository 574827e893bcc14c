"""What the paper does not have: off by default, and what it does when it is on."""

import msgspec
import numpy as np
import paper_utc as paper
import pytest

from skydiver_utc import UnscentedTransformController
from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.control.coupling import CouplingSchedule
from skydiver_utc.parameters import load_scenario
from skydiver_utc.simulation.closed_loop import simulate

DT = 0.0042
PAPER_UTC = load_scenario("fast_turn_unknown_dynamics").controller


def test_without_an_option_the_controller_is_the_papers():
    parameters = PAPER_UTC
    assert parameters.full_coupling_acceleration == 0.0
    assert parameters.aim == "end_point"
    assert parameters.covariance_leak == 0.0
    assert parameters.square_root is False


@pytest.mark.parametrize(("change", "share"), [(0.25, 0.25), (-0.5, 0.5), (3.0, 1.0), (0.0, 0.02)])
def test_the_row_of_the_damping_grows_with_the_acceleration_ahead(change, share):
    """Full at 6 rad/s2, the largest |change| in the preview counts, the other variances stay."""
    schedule = CouplingSchedule(
        msgspec.structs.replace(PAPER_UTC, full_coupling_acceleration=6.0), k_hyst=2, dt_s=DT
    )
    preview = 1.0 + np.array([0.0, 0.1, 1.1, 1.1]) * change * 6.0 * DT
    Qu = schedule.process_noise(preview)
    full = np.abs(paper.process_noise(1.0, 1.0, 1.0))
    expected = full.copy()
    expected[0, :] *= share
    expected[:, 0] = expected[0, :]
    np.testing.assert_allclose(np.abs(Qu), expected, rtol=1e-12)
    np.testing.assert_array_equal(np.abs(schedule.initial_covariance(preview)), 10.0 * full)


def test_a_direction_that_no_output_sees_settles_at_Qu_over_leak():
    """One output u0 + u1: the variance of u0 - u1 obeys v = (1 - leak) (v + q), so v = q (1 - leak) / leak."""
    leak, q = 0.2, 0.3
    controller = UnscentedTransformController(
        lambda x, u, dt: np.array([u[0] + u[1]]), state=[0.0], control=[0.0, 0.0], dt=1.0, horizon=1,
        Pu=1.0, Qu=q, leak=leak,
    )  # fmt: skip
    for _ in range(200):
        Pu = controller.step([0.0], 0.0).covariance
    unseen = np.array([1.0, -1.0]) / np.sqrt(2.0)
    assert unseen @ Pu @ unseen == pytest.approx(q * (1.0 - leak) / leak, rel=1e-6)


BEYOND = {
    "controller.k_hyst_s": 0.7,
    "controller.full_coupling_acceleration": 6.1,
    "controller.aim": "tangent",
}


def test_one_setting_follows_a_slow_turn_that_the_papers_setting_loses():
    """300 deg/s at 0.1 Hz for 6 s: the swing down from the peak, where damping and pattern fight each other."""
    turn = {"reference.amplitude_deg_s": 300.0, "reference.frequency_hz": 0.1, "duration_s": 6.0}
    paper_setting = metrics(simulate(load_scenario("fast_turn_unknown_dynamics", turn)))
    beyond = metrics(simulate(load_scenario("fast_turn_unknown_dynamics", turn | BEYOND)))
    assert paper_setting["rmse_deg_s"] > 10.0
    assert beyond["rmse_deg_s"] < 1.0
    assert beyond["convergence_time_s"] < 1.0


def test_the_tangent_takes_away_the_lag_of_the_horizon():
    """A held control that meets the reference at T leaves T^2 / 2 of its second derivative.

    200 deg/s at 0.3 Hz, T = 84 ms: 2.5 deg/s at the peaks, 1.8 RMS; the rest of the error is the same.
    """
    turn = {"reference.amplitude_deg_s": 200.0, "reference.frequency_hz": 0.3, "duration_s": 8.0}
    end_point = BEYOND | turn | {"controller.aim": "end_point"}
    lagging = metrics(simulate(load_scenario("fast_turn_unknown_dynamics", end_point)))["rmse_deg_s"]
    tangent = metrics(simulate(load_scenario("fast_turn_unknown_dynamics", turn | BEYOND)))["rmse_deg_s"]
    assert lagging == pytest.approx(np.hypot(tangent, 1.8), abs=0.3)

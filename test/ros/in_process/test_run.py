# SPDX-License-Identifier: Apache-2.0
"""A run over ROS in lockstep is the in-process run, bit for bit, with any plant."""

from pathlib import Path

import numpy as np
from own_slots import CART, cart_file
from recorded import fly
from ros_fixtures import Ros

from skydiver_utc.analysis.controller_check import check
from skydiver_utc.analysis.recorded_run import RecordedRun
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.loop.outcome import Outcome
from skydiver_utc.messages import read_preview
from skydiver_utc.nodes import topics

pytest_plugins = ("ros_fixtures",)


DISTURBED = """
extends: fast_turn_pi_dynamics
name: disturbed
duration_s: 0.3
seed: 5
truth:
  actuator_lag_s: 0.03
  ratios: {mass: 1.1, inertia: 0.9, pattern: 0.9}
  initial: {bank_deg: 10.0}
disturbances:
  - {kind: steady_wind, speed_m_s: 5.0, to_deg: 0.0}
  - {kind: dryden, sigma_m_s: 3.0}
  - {kind: measurement_error, noise: {attitude_deg: 0.5, velocity_m_s: 0.3, rates_deg_s: 1.0}, drift: {wz: 0.05}}
  - {kind: transmission, delay_s: 0.0084, jitter_s: 0.0084, loss: 0.1}
"""


def test_errors_of_plant_air_and_measurement_act_as_in_process_and_in_the_check(
    ros: Ros, tmp_path: Path
) -> None:
    path = tmp_path / "disturbed.yaml"
    path.write_text(DISTURBED, encoding="utf-8")
    bag = fly(ros, tmp_path / "run", {"scenario": str(path)})
    joints = bag.of(topics.JOINT_STATES)
    assert len(joints) >= 0.3 * 20
    assert set(joints[0].name) == set(bag.plant.joint_names)
    recording = RecordedRun(bag.folder)
    run = recording.run()
    assert {"wind_z", "error_qx", "error_wz"} <= set(run.disturbance_names)
    assert run.disturbance.tobytes() == simulate(bag.scenario).disturbance.tobytes()
    assert check(recording).equal


def test_a_plant_and_a_controller_of_ones_own_run_as_in_process(ros: Ros, tmp_path: Path) -> None:
    """And every step of the reference is previewed."""
    bag = fly(ros, tmp_path / "run", {"scenario": cart_file(tmp_path)})
    run = simulate(bag.scenario)
    assert not bag.of(topics.JOINT_STATES)
    names = (*run.telemetry_names, "solve_time", "status")
    assert tuple(bag.of(topics.TELEMETRY)[0].name) == names
    previews = [read_preview(m, bag.grid, run.tracked_names) for m in bag.of(topics.REFERENCE_PREVIEW)]
    values = {k0 + i: row for k0, rows in previews for i, row in enumerate(rows)}
    previewed = np.array([values[k] for k in range(len(run.states))])
    assert previewed.tobytes() == run.reference.tobytes()


def test_a_plant_that_leaves_its_model_ends_the_run(ros: Ros, tmp_path: Path) -> None:
    slow = CART.replace("dt_s: 0.01", "dt_s: 0.9").replace("frequency_hz: 2.0", "frequency_hz: 0.1")
    path = cart_file(tmp_path, slow.replace("0.5\n", "90.0\n"))
    ros.node("controller", {"scenario": path, "controller.gain": 90.0})
    _, plant = ros.start({"scenario": path}, "reference", "plant")
    ros.spin_until(lambda: plant.done)
    assert plant.run.outcome is Outcome.DIVERGED
    assert plant.close() == 1

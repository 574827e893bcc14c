# SPDX-License-Identifier: Apache-2.0
"""A run over ROS in lockstep is the in-process run, bit for bit, with any plant."""

from pathlib import Path
from typing import Any

import numpy as np
from own_slots import CART, cart_file
from recordings import with_previews, write_run
from ros_fixtures import JOINT_STATE, Ros, Spectator

from skydiver_utc.analysis.controller_check import check
from skydiver_utc.analysis.recorded_run import RecordedRun
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.loop.outcome import Outcome
from skydiver_utc.loop.run import Run
from skydiver_utc.messages import read_named, read_outcome, read_preview, read_state, run_id_of
from skydiver_utc.nodes import topics
from skydiver_utc.parameters import load_scenario

pytest_plugins = ("ros_fixtures",)


def fly(ros: Ros, given: dict[str, object], *types: topics.Topic) -> tuple[Any, Spectator]:
    """All messages of a run of three nodes."""
    spectator = ros.add(Spectator(ros.context, *types))
    *_, plant = ros.start(given | {"wait_for_recorder": True}, "reference", "controller", "plant")
    received = spectator.received
    ros.spin_until(
        lambda: (
            plant.done
            and received[topics.OUTCOME]
            and all(len(received[t]) == plant.k + 1 for t in (topics.STATE, topics.SETPOINT, topics.CLOCK))
            and all(
                len(received[t]) == plant.k
                for t in (topics.COMMAND, topics.APPLIED_COMMAND, topics.TELEMETRY)
            )
        )
    )
    return plant, spectator


def assert_named(messages: list[object], names: tuple[str, ...], values: np.ndarray) -> None:
    assert np.array([read_named(message, names) for message in messages]).tobytes() == values.tobytes()


def assert_equal(plant: Any, spectator: Spectator, run: Run) -> None:
    received, names = spectator.received, run.plant.control_names
    states = [read_state(message, run.plant.state_names) for message in received[topics.STATE]]
    assert np.array(states).tobytes() == run.states.tobytes()
    assert_named(received[topics.COMMAND], names, run.commands)
    assert_named(received[topics.APPLIED_COMMAND], names, run.applied)
    assert_named(received[topics.SETPOINT], run.tracked_names, run.reference)
    assert tuple(received[topics.TELEMETRY][0].name) == (*run.telemetry_names, "solve_time", "status")
    telemetry = [list(message.position)[:-2] for message in received[topics.TELEMETRY]]
    assert np.array(telemetry).tobytes() == run.telemetry.tobytes()
    clocks = [plant.grid.step_of(message.clock) for message in received[topics.CLOCK]]
    assert clocks == list(range(len(run.states)))
    outcome = read_outcome(received[topics.OUTCOME][0].data)
    assert outcome["outcome"] == run.outcome.value
    assert outcome["states"] == len(run.states)
    assert outcome["run_id"] == plant.run_id == run_id_of(received[topics.SCENARIO][0].data)
    assert plant.close() == 0


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
    plant, spectator = fly(ros, {"scenario": str(path)})
    run = simulate(load_scenario(str(path)))
    assert_equal(plant, spectator, run)
    assert_named(spectator.received[topics.DISTURBANCE], run.disturbance_names, run.disturbance)
    assert {"wind_z", "error_qx", "error_wz"} <= set(run.disturbance_names)

    joints = spectator.received[topics.JOINT_STATES]
    assert len(joints) >= 0.3 * 20
    assert set(joints[0].name) == set(run.plant.joint_names)

    folder = write_run(tmp_path / "run", run, with_previews(run))
    recording = RecordedRun(folder)
    assert recording.run().disturbance.tobytes() == run.disturbance.tobytes()
    assert check(recording).equal


def test_a_plant_and_a_controller_of_ones_own_run_as_in_process(ros: Ros, tmp_path: Path) -> None:
    """And every step of the reference is previewed."""
    path = cart_file(tmp_path)
    plant, spectator = fly(ros, {"scenario": path}, JOINT_STATE)
    run = simulate(load_scenario(path))
    assert_equal(plant, spectator, run)
    assert not spectator.received[topics.JOINT_STATES]
    previews = [
        read_preview(m, plant.grid, run.tracked_names) for m in spectator.received[topics.REFERENCE_PREVIEW]
    ]
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

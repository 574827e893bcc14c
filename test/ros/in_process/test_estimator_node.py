# SPDX-License-Identifier: Apache-2.0
"""The estimator node: bit-equal flights, and where it begins."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import invoke
from recorded import Bag, fly
from ros_fixtures import KINDS, Ros, overrides
from runs import cart

from skydiver_utc.analysis.controller_check import check
from skydiver_utc.analysis.recorded_run import RecordedRun
from skydiver_utc.estimators.consistency import JUDGEMENT, VERDICTS, consistency
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.estimator_node import EstimatorNode
from skydiver_utc.nodes.lifecycle import NotNeededError
from skydiver_utc.parameters import override, to_yaml

pytest_plugins = ("ros_fixtures",)

FILTER = {
    "kind": "unscented_kalman_filter",
    "sensors": {
        "ruler": {"of": ["place"], "rate_Hz": 10.0, "noise": 0.02, "delay_s": 0.1, "loss": 0.2},
        "encoder": {"of": ["speed"], "rate_Hz": 20.0, "noise": 0.1},
    },
    "initial_deviation": {"place": 0.2, "speed": 0.2},
    "process_noise": {"speed": 0.3},
}


class LosesOne(EstimatorNode):
    """Loses the command of step 20, once."""

    lost = False

    def on_command(self, message: Any) -> None:
        if self.lost or self.grid.step_of(message.header.stamp) != 20:
            super().on_command(message)
        else:
            self.lost = True


class Flight:
    """A recorded flight of a cart."""

    def __init__(self, ros: Ros, folder: Path, **settings: object) -> None:
        self.scenario = override(cart(), {"controller": {"kind": "lqr"}, "estimator": FILTER, **settings})
        (folder / "cart.yaml").write_text(to_yaml(self.scenario), encoding="utf-8")
        self.ros, self.folder = ros, folder / "run"
        self.given = {"scenario": str(folder / "cart.yaml")}
        self.recorder = ros.node("recorder", self.given | {"out": str(self.folder)})
        waiting = self.given | {"wait_for_recorder": True}
        self.estimator, *_ = ros.start(waiting, "estimator", "controller", "reference")
        self.plant = ros.node("plant", waiting | {"command_timeout_s": 0.3, "command_retries": 100})

    def recorded(self) -> RecordedRun:
        self.ros.spin_until(lambda: self.recorder.finished and not self.recorder.not_in_bag())
        assert self.recorder.close() == 0
        return RecordedRun(self.folder)


@pytest.mark.parametrize(("node", "duration_s"), [(EstimatorNode, 12.0), (LosesOne, 4.0)])
def test_a_flight_on_sensors_equals_the_simulation(
    ros: Ros, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, node: type[EstimatorNode], duration_s: float
) -> None:
    """The longer one has more than the 200 innovations that are judged."""
    monkeypatch.setitem(KINDS, "estimator", node)
    flight = Flight(ros, tmp_path, duration_s=duration_s)
    recorded, run = flight.recorded().run(), simulate(flight.scenario)
    assert recorded.commands.tobytes() == run.commands.tobytes()
    assert recorded.telemetry_names == run.telemetry_names
    assert recorded.telemetry.tobytes() == run.telemetry.tobytes()
    innovations = run.telemetry[:, [run.telemetry_names.index("innovation_encoder_speed")]]
    wanted = consistency(innovations[np.isfinite(innovations[:, 0])][-200:])
    last = Bag(flight.folder).of(topics.ESTIMATOR_TELEMETRY)[-1]
    found = dict(zip(last.name, last.position, strict=True))
    judged = [found[f"{name}_encoder"] for name in JUDGEMENT]
    assert judged == [wanted.mean, wanted.low, wanted.high, VERDICTS.index(wanted.verdict)]
    assert wanted.verdict in str(flight.estimator.health().values["nis_encoder"])


def test_an_estimator_that_comes_into_a_run_begins_there(ros: Ros, tmp_path: Path) -> None:
    flight = Flight(ros, tmp_path)
    ros.spin_until(lambda: flight.plant.k > 30)
    ros.remove(flight.estimator)
    ros.node("estimator", flight.given)
    recorded = flight.recorded()
    (change,) = recorded.run().changes
    assert (change.node, change.step > 30, change.control) == ("estimator", True, None)
    checked = check(recorded)
    assert checked.equal
    assert checked.different_estimates == 0


def test_an_estimator_of_ones_own_is_given_the_measured_state(ros: Ros, tmp_path: Path) -> None:
    noise = {"kind": "measurement_error", "noise": {"place": 0.05}}
    flight = Flight(ros, tmp_path, estimator={"kind": "own_slots:Averaged"}, disturbances=[noise])
    assert flight.recorded().run().commands.tobytes() == simulate(flight.scenario).commands.tobytes()


def test_an_estimator_is_not_needed_where_the_scenario_has_none(ros: Ros) -> None:
    with pytest.raises(NotNeededError, match="fast_turn_unknown_dynamics"):
        ros.node("estimator", {"scenario": "fast_turn_unknown_dynamics"})


@pytest.mark.long
def test_a_skydiver_s_flight_on_sensors_equals_the_simulation_and_its_check(ros: Ros, tmp_path: Path) -> None:
    """Measurements that come late or not at all included."""
    folder = tmp_path / "run"
    given = overrides(
        0.5,
        scenario="fast_turn_gyro_accelerometer",
        estimator__sensors__gyroscope__delay_s=0.02,
        estimator__sensors__gyroscope__loss=0.2,
    )
    bag = fly(ros, folder, given, "estimator")
    rates = bag.of(topics.sensor_topic("gyroscope", "Imu"))
    assert 0 < len(rates) < len(bag.of(topics.sensor_topic("accelerometer", "Imu"))) == 25
    assert rates[0].linear_acceleration_covariance[0] == -1.0
    assert np.isfinite([rates[0].angular_velocity.x, rates[0].angular_velocity.z]).all()
    estimates, (*_, last) = bag.of(topics.ESTIMATE), bag.of(topics.ESTIMATOR_TELEMETRY)
    judged = dict(zip(last.name, last.position, strict=True))
    assert judged["nis_low_accelerometer"] < 3.0 < judged["nis_high_accelerometer"]
    assert VERDICTS[int(judged["verdict_accelerometer"])] == "consistent"
    np.testing.assert_allclose(
        np.sqrt(estimates[-1].twist.covariance[35]), judged["deviation_wz"], rtol=1e-12
    )
    pose = np.reshape(estimates[-1].pose.covariance, (6, 6))
    turn = sum(judged[f"deviation_attitude_{axis}"] ** 2 for axis in "xyz")
    np.testing.assert_allclose(np.trace(pose[3:, 3:]), turn, rtol=1e-12)
    checked = invoke("replay", folder, "--check", "--json")
    assert checked.exit_code == 0, checked.output
    assert json.loads(checked.output)["equal"]

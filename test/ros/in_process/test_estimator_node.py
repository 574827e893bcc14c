# SPDX-License-Identifier: Apache-2.0
"""The estimator node: bit-equal flights, what it keeps through a change of the controller, and where it begins."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import invoke
from recorded import fly
from ros_fixtures import Ros, Spectator, overrides
from runs import cart

from skydiver_utc.estimators.consistency import JUDGEMENT, VERDICTS, consistency
from skydiver_utc.loop.build import build_estimator
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.loop.estimation import Estimation, estimate_at
from skydiver_utc.loop.plant_steps import PlantSteps
from skydiver_utc.messages import read_named
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.estimator_node import EstimatorNode
from skydiver_utc.nodes.lifecycle import NotNeededError
from skydiver_utc.parameters import Scenario, override, to_yaml

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
    """A cart with all nodes but the recorder, in one process."""

    def __init__(
        self, ros: Ros, folder: Path, node: type[EstimatorNode] = EstimatorNode, **settings: object
    ) -> None:
        self.scenario: Scenario = override(
            cart(), {"duration_s": 4.0, "controller": {"kind": "lqr"}, **settings}
        )
        path = folder / "cart.yaml"
        path.write_text(to_yaml(self.scenario), encoding="utf-8")
        self.ros, self.given = ros, {"scenario": str(path)}
        types = (topics.STATE, topics.ESTIMATE)
        joints = [topic.of_type(topics.STATE_TYPES["joint_state"]) for topic in types]
        self.spectator = ros.add(Spectator(ros.context, *joints))
        waiting = self.given | {"wait_for_recorder": True}
        ros.node("reference", self.given)
        self.controller = ros.node("controller", waiting)
        self.estimator = ros.add(node(ros.context, waiting))
        self.plant = ros.node("plant", self.given | {"command_timeout_s": 0.3, "command_retries": 100})

    def until_the_end(self) -> None:
        of_steps = (topics.COMMAND, topics.ESTIMATE, topics.ESTIMATOR_TELEMETRY)
        self.ros.spin_until(
            lambda: self.plant.done and all(len(self.received(t)) >= self.plant.k for t in of_steps)
        )

    def received(self, topic: topics.Topic) -> list[Any]:
        return self.spectator.received[topic]

    def values(self, topic: topics.Topic, names: Sequence[str]) -> Any:
        """By step; of a message that came twice, the last one."""
        rows = {self.plant.grid.step_of(m.header.stamp): read_named(m, names) for m in self.received(topic)}
        return np.array([rows[k] for k in sorted(rows)])

    def commands(self) -> Any:
        return self.values(topics.COMMAND, ("force",))

    def estimates(self) -> Any:
        return self.values(topics.ESTIMATE, ("place", "speed"))

    def computed(self, *begins: int) -> Any:
        """The estimates of the plant's own measurements under the recorded commands."""
        steps = PlantSteps(self.scenario)
        steps.begin()
        measured = []
        for command in self.commands():
            measured.append(steps.measured)
            steps.step(command)
        estimations = {
            k: Estimation(build_estimator(self.scenario, steps.plant), steps.plant, steps.disturbance)
            for k in begins
        }
        return estimate_at(estimations, 0, measured, self.commands())


@pytest.mark.parametrize(("node", "duration_s"), [(EstimatorNode, 12.0), (LosesOne, 4.0)])
def test_a_flight_on_sensors_equals_the_simulation(
    ros: Ros, tmp_path: Path, node: type[EstimatorNode], duration_s: float
) -> None:
    """The longer one has more than the 200 innovations that are judged."""
    flight = Flight(ros, tmp_path, node, estimator=FILTER, duration_s=duration_s)
    flight.until_the_end()
    run = simulate(flight.scenario)
    assert flight.commands().tobytes() == run.commands.tobytes()
    names = run.telemetry_names
    first = names.index("estimate_place")
    assert flight.estimates().tobytes() == run.telemetry[:, first : first + 2].tobytes()
    innovations = run.telemetry[:, [names.index("innovation_encoder_speed")]]
    wanted = consistency(innovations[np.isfinite(innovations[:, 0])][-200:])
    last = flight.received(topics.ESTIMATOR_TELEMETRY)[-1]
    found = dict(zip(last.name, last.position, strict=True))
    judged = [found[f"{name}_encoder"] for name in JUDGEMENT]
    assert judged == [wanted.mean, wanted.low, wanted.high, VERDICTS.index(wanted.verdict)]
    assert wanted.verdict in str(flight.estimator.health().values["nis_encoder"])


def test_an_estimator_that_comes_into_a_run_begins_there(ros: Ros, tmp_path: Path) -> None:
    flight = Flight(ros, tmp_path, estimator=FILTER)
    ros.spin_until(lambda: flight.plant.k > 30)
    ros.remove(flight.estimator)
    ros.node("estimator", flight.given)
    flight.until_the_end()
    change = json.loads(flight.received(topics.CHANGES)[0].data)
    assert (change["node"], change["step"] > 30, change["control"]) == ("estimator", True, None)
    assert flight.estimates().tobytes() == flight.computed(0, change["step"]).tobytes()


def test_an_estimator_of_ones_own_is_given_the_measured_state(ros: Ros, tmp_path: Path) -> None:
    noise = {"kind": "measurement_error", "noise": {"place": 0.05}}
    flight = Flight(ros, tmp_path, estimator={"kind": "own_slots:Averaged"}, disturbances=[noise])
    flight.until_the_end()
    assert flight.commands().tobytes() == simulate(flight.scenario).commands.tobytes()


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

# SPDX-License-Identifier: Apache-2.0
"""A page on a flight over ROS: the newest messages, and no part in the run."""

import signal
import threading

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.context import Context
from rclpy.node import Node
from ros_fixtures import Processes, Ros
from std_msgs.msg import String

from skydiver_utc.messages import StepGrid, fill_named, fill_odometry
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.observed_run import ObservedRun
from skydiver_utc.parameters import ParameterError, load_scenario, to_yaml
from skydiver_utc.view.ros_flight import RosFlight

pytest_plugins = ("ros_fixtures",)
K = 40


@pytest.fixture
def context(domain):
    """A context on a domain of its own."""
    made = Context()
    rclpy.init(context=made, domain_id=domain)
    yield made
    rclpy.shutdown(context=made)


def test_the_newest_state_and_controls_are_shown_once_the_plant_counts_steps(context):
    scenario = load_scenario("slow_turn_pose_only")
    node, done = Node("plant", namespace="anna", context=context), threading.Event()
    published = (
        topics.SCENARIO,
        topics.DIAGNOSTICS,
        topics.STATE,
        topics.APPLIED_COMMAND,
        topics.TELEMETRY,
    )
    publishers = {topic.name: node.create_publisher(topic.type, topic.name, topic.qos) for topic in published}
    publishers["scenario"].publish(String(data=to_yaml(scenario)))
    subscribed_early = []

    def fly():
        """Diagnostics of a plant that has begun, after a while of one that has not; with each the same step."""
        for count in range(10_000):
            step = K if count > 20 else -1
            text = "soon" if count % 5 == 4 else str(step)  # of a plant that is none of ours
            if step < 0:
                subscribed_early.append(publishers["state"].get_subscription_count())
            status = DiagnosticStatus(name="anna/plant", values=[KeyValue(key="step", value=text)])
            publishers["/diagnostics"].publish(DiagnosticArray(status=[status]))
            grid, state = StepGrid(scenario.stamp_ns(0), scenario.dt_ns), topics.STATE.type()
            grid.set_stamp(state.header.stamp, K)
            fill_odometry(
                state, np.array([0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -50.0, 0.0, 0.0, 2.0])
            )
            publishers["state"].publish(state)
            applied = topics.APPLIED_COMMAND.type()
            applied.name = ["Cm_damp_yaw", "k_right", "k_left", "alpha"]
            fill_named(applied, np.array([1.0, 2.0, 3.0, 0.5]))
            publishers["applied_command"].publish(applied)
            telemetry = topics.TELEMETRY.type()
            telemetry.name = ["std_alpha", "solve_time"]
            publishers["controller/telemetry"].publish(fill_named(telemetry, np.array([0.1, 0.002])))
            if done.wait(0.05):
                return

    thread = threading.Thread(target=fly)
    thread.start()
    try:
        viewed = ObservedRun("anna", 60.0, context)
        flight = RosFlight(viewed)
        while flight.now().applied[3] != 0.5 or np.isnan(flight.now().solve_time_s):
            flight.advance(0.01)
        now = flight.now()
        viewed.close()
    finally:
        done.set()
        thread.join()
        node.destroy_node()
    assert now.time_s == pytest.approx(K * scenario.dt_s)
    assert (now.state[2], now.state[12]) == (9.0, 2.0)
    assert (now.deviations[3], now.solve_time_s) == (0.1, 0.002)
    assert len(flight.plant.shape_poses(now.state, now.applied)) == len(flight.plant.shapes)
    assert set(subscribed_early) == {0}


def test_a_signal_ends_the_page(ros: Ros, processes: Processes) -> None:
    page = processes.python("view", "-m", "skydiver_utc", "view", "--ros", "nobody")
    partner = ros.partner()
    ros.spin_until(lambda: ("view", "/nobody") in partner.get_node_names_and_namespaces())
    page.signal(signal.SIGINT)
    assert page.wait() == 0


def test_a_namespace_without_a_flight_is_named(context):
    with pytest.raises(ParameterError, match="nobody"):
        ObservedRun("nobody", 0.3, context)

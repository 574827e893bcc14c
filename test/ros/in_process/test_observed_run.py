# SPDX-License-Identifier: Apache-2.0
"""A page on a flight over ROS: the newest messages, and no part in the run."""

import signal
import threading

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from ros_fixtures import Processes, Ros, spinning
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from skydiver_utc.messages import StepGrid, fill_state
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.observed_run import ObservedRun
from skydiver_utc.parameters import ParameterError, load_scenario, to_yaml
from skydiver_utc.view.ros_flight import RosFlight

pytest_plugins = ("ros_fixtures",)
K = 40


def test_the_newest_messages_are_shown_once_the_plant_counts_steps(ros: Ros) -> None:
    """Before that a plant that waits for its subscribers would take the page for one of them."""
    scenario, plant = load_scenario("slow_turn_pose_only"), ros.partner("plant")
    states = plant.publisher(topics.STATE)
    controls, names = plant.publisher(topics.APPLIED_COMMAND), ["Cm_damp_yaw", "k_right", "k_left", "alpha"]
    telemetry = plant.publisher(topics.TELEMETRY)
    plant.publisher(topics.SCENARIO).publish(String(data=to_yaml(scenario)))
    begun, early = threading.Event(), []

    def fly() -> None:
        """With diagnostics of a plant that has begun, or not, or that is none of ours, always the same step."""
        step = K if begun.is_set() else -1
        early.append(step < 0 and states.get_subscription_count())
        for text in (str(step), "soon"):
            status = DiagnosticStatus(name="skydiver/plant", values=[KeyValue(key="step", value=text)])
            plant.publisher(topics.DIAGNOSTICS).publish(DiagnosticArray(status=[status]))
        state = fill_state(topics.STATE.type(), np.array([0, 0, 9, 0, 0, 0, 1, 0, 0, -50, 0, 0, 2.0]))
        StepGrid(scenario.stamp_ns(0), scenario.dt_ns).set_stamp(state.header.stamp, K)
        states.publish(state)
        controls.publish(JointState(name=names, position=[1.0, 2.0, 3.0, 0.5]))
        telemetry.publish(JointState(name=["std_alpha", "solve_time"], position=[0.1, 0.002]))

    plant.create_timer(0.05, fly)
    threading.Timer(1.0, begun.set).start()
    with spinning(ros):
        viewed = ObservedRun("skydiver", 60.0, ros.context)
        flight = RosFlight(viewed)
        while flight.now().applied[3] != 0.5 or "solve_time" not in flight.now().telemetry:
            flight.advance(0.01)
        now = flight.now()
        viewed.close()
    assert now.time_s == pytest.approx(K * scenario.dt_s)
    assert (now.state[2], now.state[12]) == (9.0, 2.0)
    assert (flight.signals.deviations(now)[3], now.telemetry["solve_time"]) == (0.1, 0.002)
    assert len(flight.plant.shape_poses(now.state, now.applied)) == len(flight.plant.shapes)
    assert not any(early)


@pytest.mark.processes
def test_a_signal_ends_the_page(ros: Ros, processes: Processes) -> None:
    page = processes.python("view", "-m", "skydiver_utc", "view", "--ros", "nobody")
    partner = ros.partner()
    ros.spin_until(lambda: ("view", "/nobody") in partner.get_node_names_and_namespaces())
    page.signal(signal.SIGINT)
    assert page.wait() == 0


def test_a_namespace_without_a_flight_is_named(ros: Ros) -> None:
    with pytest.raises(ParameterError, match="nobody"):
        ObservedRun("nobody", 0.3, ros.context)
    with pytest.raises(ParameterError, match="two words"):
        ObservedRun("two words", 0.3, ros.context)

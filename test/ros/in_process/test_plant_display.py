# SPDX-License-Identifier: Apache-2.0
"""What the plant node publishes for displays, and that it costs nothing without them."""

from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from own_slots import cart_file
from ros_fixtures import Ros, overrides

from skydiver_utc.body.segments import build_body
from skydiver_utc.loop.build import build_plant
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.loop.plant_steps import PlantSteps
from skydiver_utc.messages import StepGrid
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.plant_display import PlantDisplay
from skydiver_utc.parameters import load_scenario

pytest_plugins = ("ros_fixtures",)
DISPLAYED = (topics.ROBOT_DESCRIPTION, topics.JOINT_STATES, topics.MARKERS, topics.TRANSFORMS)
FRAMES = ("body", "base_link")


def components(point: object) -> list[float]:
    return [getattr(point, name) for name in "xyzw" if hasattr(point, name)]


def pose(transform: Any) -> list[float]:
    return components(transform.translation) + components(transform.rotation)


def test_urdf_joints_markers_and_transforms_show_the_flight(ros: Ros) -> None:
    """At 25 Hz; the URDF, placed by Pinocchio with transform and joint angles, has its links where the markers are."""
    pinocchio = pytest.importorskip("pinocchio", reason="needs the wheel `pin`")
    given = overrides(0.3)
    spectator = ros.partner()
    received = {topic: spectator.receive(topic) for topic in DISPLAYED}
    plant, *_ = ros.start(given, "plant", "controller", "reference")
    ros.spin_until(lambda: plant.done)
    run = simulate(load_scenario("fast_turn_unknown_dynamics", {"duration_s": 0.3}))
    steps = range(0, len(run.states), 10)
    ros.spin_until(lambda: all(len(received[topic]) >= len(steps) for topic in DISPLAYED[1:]))
    assert [plant.grid.step_of(m.header.stamp) for m in received[topics.JOINT_STATES]] == list(steps)
    frames = {name: [m for m in received[topics.TRANSFORMS] if m.child_frame_id == name] for name in FRAMES}
    model = pinocchio.buildModelFromXML(
        received[topics.ROBOT_DESCRIPTION][0].data, pinocchio.JointModelFreeFlyer()
    )
    data, q = model.createData(), np.zeros(model.nq)
    flown = PlantSteps(run.scenario)
    held = [flown.applied]
    for command in run.commands:
        flown.step(command)
        held.append(flown.applied)
    centres = build_body(run.scenario.plant.subject).centre
    for i, k in enumerate(steps):
        *shapes, lines = received[topics.MARKERS][i].markers
        joints = received[topics.JOINT_STATES][i]
        assert {marker.header.frame_id for marker in (*shapes, lines)} == {"world"}
        ends = np.array([components(point) for point in lines.points]).reshape(-1, 2, 3)
        forces = run.plant.shape_forces(run.states[k], held[k])
        np.testing.assert_allclose(np.cross(ends[:, 1] - ends[:, 0], forces), 0.0, atol=1e-9)
        np.testing.assert_array_equal(pose(frames["body"][i].transform), run.states[k, :7])
        q[:7] = pose(frames["base_link"][i].transform)
        q[[model.joints[model.getJointId(name)].idx_q for name in joints.name]] = joints.position
        pinocchio.framesForwardKinematics(model, data, q)
        for shape, marker, centre in zip(run.plant.shapes, shapes, centres, strict=True):
            link = data.oMf[model.getFrameId(shape.name)]
            found = link.translation + link.rotation @ centre
            np.testing.assert_allclose(found, components(marker.pose.position), rtol=0, atol=1e-9)


def test_a_plant_without_a_body_advertises_none_of_it(ros: Ros, tmp_path: Path) -> None:
    plant = ros.node("plant", {"scenario": cart_file(tmp_path)})
    assert not any(plant.count_publishers(f"/skydiver/{topic.name}") for topic in DISPLAYED)


def test_markers_can_be_left_out(ros: Ros) -> None:
    plant = ros.node("plant", overrides(0.1, markers=False))
    assert not plant.count_publishers("/skydiver/markers")
    assert plant.count_publishers("/skydiver/joint_states")


def test_with_tf2_msgs_a_step_s_transforms_are_one_message(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a type that stands for tf2_msgs/TFMessage, of which PyPI has no wheel."""
    of_tf = replace(topics.TRANSFORMS, name="/tf", type=SimpleNamespace)
    monkeypatch.setattr(topics, "TRANSFORMS", of_tf)
    sent: dict[str, list[Any]] = defaultdict(list)
    scenario = load_scenario("fast_turn_unknown_dynamics")
    node: Any = SimpleNamespace(
        grid=StepGrid(scenario.stamp_ns(0), scenario.dt_ns),
        scenario=scenario,
        settings=SimpleNamespace(markers=False),
        advertise=lambda topic: SimpleNamespace(
            publish=sent[topic.name].append, get_subscription_count=lambda: topic is of_tf
        ),
    )
    plant = build_plant(scenario)
    PlantDisplay(node, plant).publish(0, plant.initial_state(), plant.initial_applied())
    (message,) = sent["/tf"]
    assert [transform.child_frame_id for transform in message.transforms] == list(FRAMES)
    assert not sent["joint_states"]

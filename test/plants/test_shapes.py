# SPDX-License-Identifier: Apache-2.0
"""The ellipsoids that a display draws carry the masses and moments of the body that flies."""

import numpy as np
from scipy.spatial.transform import Rotation
from skydivers import joint_angles

from skydiver_utc import load_scenario
from skydiver_utc.body.posture import configuration
from skydiver_utc.body.segments import SEGMENTS, build_body
from skydiver_utc.plants.skydiver.skydiver import SkydiverPlant


def test_solid_ellipsoids_have_the_moments_of_the_body():
    scenario = load_scenario("bank_recovery")
    plant, body, alpha = SkydiverPlant(scenario.plant, scenario.dt_s), build_body(scenario.plant.subject), 0.7
    state, applied = plant.initial_state(), plant.initial_applied()
    state[:3] = 3.0, -2.0, 1000.0
    attitude = Rotation.from_euler("ZYX", [0.4, -0.3, 1.1])
    state[3:7], applied[3] = attitude.as_quat(), alpha

    poses = plant.shape_poses(state, applied)
    assert [shape.name for shape in plant.shapes] == [segment.name for segment in SEGMENTS]
    assert np.allclose(body.mass @ poses[:, :3] / body.total_mass, state[:3], atol=1e-9)
    total = np.zeros((3, 3))
    for shape, pose, mass in zip(plant.shapes, poses, body.mass, strict=True):
        squares, turned = shape.half_axes**2, Rotation.from_quat(pose[3:]).as_matrix()
        arm = pose[:3] - state[:3]
        total += turned @ np.diag(mass / 5 * (squares.sum() - squares)) @ turned.T
        total += mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    world, placed = attitude.as_matrix(), configuration(body, joint_angles(scenario, alpha))
    assert np.allclose(world.T @ total @ world, placed.inertia, atol=1e-9)
    mid_hip = state[:3] - world @ placed.centre_of_mass
    assert np.allclose(plant.joint_angles(applied), joint_angles(scenario, alpha).ravel())
    assert np.allclose(plant.robot_pose(state, applied), [*mid_hip, *state[3:7]], atol=1e-9)


def test_the_forces_on_the_segments_add_up_to_the_acceleration():
    scenario = load_scenario("fast_turn_unknown_dynamics", {"plant.initial.yaw_rate_deg_s": 60.0})
    plant = SkydiverPlant(scenario.plant, scenario.dt_s)
    state, applied = plant.initial_state(), np.array([3.0, 0.05, -0.1, 0.2, 0.0])
    dt = 1e-5
    following, model = np.empty(13), plant.model_of_step(dt)
    model.bound(4, 4).step(state, applied[:4], following)

    def velocity(x):
        return Rotation.from_quat(x[3:7]).apply(x[7:10])

    acceleration = (velocity(following) - velocity(state)) / dt
    weight = plant.constants.mass * np.array([0.0, 0.0, -plant.constants.gravity])

    forces = plant.shape_forces(state, applied)

    assert forces.shape == (len(plant.shapes), 3)
    np.testing.assert_allclose(forces.sum(axis=0) + weight, plant.constants.mass * acceleration, atol=0.05)

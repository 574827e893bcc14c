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

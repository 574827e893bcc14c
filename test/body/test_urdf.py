# SPDX-License-Identifier: Apache-2.0
"""The URDF read by Pinocchio, beside `body/`."""

import numpy as np
import pytest

from skydiver_utc.body.posture import configuration, joint_angle_names, joint_ranges
from skydiver_utc.body.segments import SEGMENTS, build_body
from skydiver_utc.body.urdf import urdf
from skydiver_utc.parameters import load_scenario

pinocchio = pytest.importorskip("pinocchio", reason="needs the wheel `pin`")


@pytest.mark.parametrize("subject", ["paper", "heavy"])
def test_places_masses_and_inertia_are_those_of_the_body(subject):
    subject = load_scenario("fast_turn_unknown_dynamics", {"plant.subject": subject}).plant.subject
    body, names = build_body(subject), joint_angle_names()
    lower, upper = (limits.ravel() for limits in joint_ranges(subject.joint_limits))
    model = pinocchio.buildModelFromXML(urdf(subject), pinocchio.JointModelFreeFlyer())
    data = model.createData()
    joints = [model.joints[model.getJointId(name)] for name in names]
    at = [joint.idx_q for joint in joints]
    np.testing.assert_array_equal(model.lowerPositionLimit[at], lower)
    np.testing.assert_array_equal(model.upperPositionLimit[at], upper)
    rng = np.random.default_rng(1)
    for _ in range(20):
        angles = rng.uniform(lower, upper)
        q = pinocchio.neutral(model)
        q[at] = angles
        pinocchio.framesForwardKinematics(model, data, q)
        pinocchio.ccrba(model, data, q, np.zeros(model.nv))
        expected = configuration(body, angles.reshape(15, 3))
        for i, segment in enumerate(SEGMENTS):
            place = data.oMf[model.getFrameId(segment.name)]
            mid_hip_to_joint = expected.proximal[i] + expected.centre_of_mass
            np.testing.assert_allclose(place.translation, mid_hip_to_joint, rtol=0, atol=1e-9)
            np.testing.assert_allclose(place.rotation, expected.rotation[i], rtol=0, atol=1e-9)
        assert data.Ig.mass == pytest.approx(body.total_mass, rel=1e-12)
        np.testing.assert_allclose(data.com[0], expected.centre_of_mass, rtol=0, atol=1e-9)
        np.testing.assert_allclose(data.Ig.inertia, expected.inertia, rtol=0, atol=1e-9)

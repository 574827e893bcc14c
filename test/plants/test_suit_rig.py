# SPDX-License-Identifier: Apache-2.0
"""The suit rig against the fluid dynamics that it is taken from: Dietz et al., AIAA 2011-2589."""

import numpy as np
import pytest
from skydivers import joint_angles, skydiver

from skydiver_utc.body.posture import configuration
from skydiver_utc.body.segments import SEGMENTS, build_body
from skydiver_utc.parameters.loading import config_folder
from skydiver_utc.parameters.yaml_io import read_yaml

# Effective drag areas [m2], front, side, axial, of a jumper with rig, and of the whole body in its box.
PUBLISHED = {
    ("upper_trunk", "mid_trunk"): (0.398, 0.273, 0.076),
    ("lower_trunk",): (0.051, 0.023, 0.015),
    ("head",): (0.024, 0.021, 0.007),
    ("thigh",): (0.066, 0.074, 0.012),
    ("shank", "foot"): (0.105, 0.091, 0.0),
    ("upper_arm",): (0.022, 0.013, 0.006),
    ("forearm", "hand"): (0.021, 0.015, 0.002),
}
WHOLE_BODY_IN_THE_BOX = 0.612
SUIT = read_yaml(config_folder() / "suits" / "rig.yaml")
TORSO = ("upper_trunk", "mid_trunk")


@pytest.mark.parametrize("kinds", PUBLISHED)
def test_the_areas_are_the_published_ones(kinds):
    areas = np.sum([SUIT["drag_areas_m2"][kind] for kind in kinds], axis=0)
    published = np.array(PUBLISHED[kinds])
    as_published = np.array([kinds != TORSO, True, True])
    np.testing.assert_allclose(areas[as_published], published[as_published], atol=1e-9)


def test_the_torso_s_front_makes_up_the_whole_body():
    """In posture box, broadside: 0.704 m2 with the torso as published, 0.612 m2 with the torso of the suit."""
    reference = {"mass_kg": SUIT["reference_mass_kg"], "height_m": SUIT["reference_height_m"], "suit": "rig"}
    scenario = skydiver(posture="box", **{f"subject__{name}": value for name, value in reference.items()})
    body = build_body(scenario.plant.subject)
    turned = configuration(body, joint_angles(scenario)).rotation
    share = turned[:, 2, :] ** 2
    assert np.einsum("ik,ik->", share, body.drag_area) == pytest.approx(WHOLE_BODY_IN_THE_BOX, abs=1e-3)
    torso = [row for row, segment in enumerate(SEGMENTS) if segment.kind in TORSO]
    body.drag_area[torso, 2] *= PUBLISHED[TORSO][0] / body.drag_area[torso, 2].sum()
    assert np.einsum("ik,ik->", share, body.drag_area) == pytest.approx(0.704, abs=1e-3)

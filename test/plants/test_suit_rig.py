# SPDX-License-Identifier: Apache-2.0
"""Suits against fluid dynamics, Dietz et al., AIAA 2011-2589: the rig, and the normal force of a single limb."""

import numpy as np
import pytest
from skydivers import joint_angles, model_of, skydiver

from skydiver_utc.body.posture import configuration
from skydiver_utc.body.segments import SEGMENTS, build_body
from skydiver_utc.parameters.loading import config_folder
from skydiver_utc.parameters.yaml_io import read_yaml
from skydiver_utc.plants.skydiver.model import GEOMETRY_SIZE, INERTIA_AT, SEGMENT_COUNT
from skydiver_utc.plants.skydiver.steady import HeldBody

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


# Share of the broadside normal force at each incidence [deg] from broadside: as found in the data of a flight
# simulator's parachutist.
FLUID_DYNAMICS = {
    30: {"thigh": 0.81, "lower leg": 0.86, "upper arm": 0.94, "forearm": 1.05},
    45: {"thigh": 0.65, "lower leg": 0.83, "upper arm": 0.73, "forearm": 0.95},
    60: {"thigh": 0.49, "lower leg": 0.57, "upper arm": 0.63, "forearm": 0.64},
}
SCENARIO = skydiver()
BODY = build_body(SCENARIO.plant.subject)
MODEL = model_of(SCENARIO)._replace(gravity=0.0)


def normal_force(kind, incidence_deg):
    """Force along the limb's dorsal axis [N] at 55 m/s; the limb is alone, at the centre of mass, untilted."""
    limb = next(i for i, segment in enumerate(SEGMENTS) if segment.kind == kind)
    geometry = np.zeros(GEOMETRY_SIZE)
    for axis in range(3):
        geometry[(3 + axis) * SEGMENT_COUNT + limb] = BODY.drag_area[limb, axis]
    geometry[INERTIA_AT : INERTIA_AT + 3] = 1.0
    falling = HeldBody(MODEL, np.zeros(4), geometry).straight_down(55.0, np.deg2rad(incidence_deg))
    return MODEL.mass * falling[2]


@pytest.mark.parametrize("kind", ["upper_arm", "forearm", "thigh", "shank"])
def test_force_is_that_of_the_drag_area_broadside_and_a_share_in_the_band_tilted(kind):
    front = SCENARIO.plant.subject.suit.drag_areas_m2[kind][0]
    broadside = 0.5 * SCENARIO.plant.air.density_kg_m3 * 55.0**2 * front
    assert normal_force(kind, 0) == pytest.approx(broadside, rel=1e-9)
    for incidence, band in FLUID_DYNAMICS.items():
        assert min(band.values()) <= normal_force(kind, incidence) / broadside <= max(band.values())

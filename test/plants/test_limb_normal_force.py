# SPDX-License-Identifier: Apache-2.0
"""The normal force of a single limb against its incidence, through the kernel, against fluid dynamics."""

import numpy as np
import pytest
from skydivers import model_of, skydiver

from skydiver_utc.body.segments import SEGMENTS, build_body
from skydiver_utc.plants.skydiver.model import GEOMETRY_SIZE, INERTIA_AT, SEGMENT_COUNT
from skydiver_utc.plants.skydiver.steady import HeldBody

# Share of the broadside normal force at each incidence [deg] from broadside: Dietz et al., AIAA 2011-2589, as found
# in the data of a flight simulator's parachutist.
FLUID_DYNAMICS = {
    30: {"thigh": 0.81, "lower leg": 0.86, "upper arm": 0.94, "forearm": 1.05},
    45: {"thigh": 0.65, "lower leg": 0.83, "upper arm": 0.73, "forearm": 0.95},
    60: {"thigh": 0.49, "lower leg": 0.57, "upper arm": 0.63, "forearm": 0.64},
}
LIMBS = ("upper_arm", "forearm", "thigh", "shank")
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


@pytest.mark.parametrize("kind", LIMBS)
def test_force_is_that_of_the_drag_area_broadside_and_a_share_in_the_band_tilted(kind):
    front = SCENARIO.plant.subject.suit.drag_areas_m2[kind][0]
    broadside = 0.5 * SCENARIO.plant.air.density_kg_m3 * 55.0**2 * front
    assert normal_force(kind, 0) == pytest.approx(broadside, rel=1e-9)
    for incidence, band in FLUID_DYNAMICS.items():
        assert min(band.values()) <= normal_force(kind, incidence) / broadside <= max(band.values())

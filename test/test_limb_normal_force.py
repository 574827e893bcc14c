"""The normal force of a single limb against its incidence, through the kernel, against fluid dynamics."""

import numpy as np
import pytest

from skydiver_utc.body.segments import SEGMENTS, build_body
from skydiver_utc.parameters import load_scenario
from skydiver_utc.plant.dynamics import invert_inertia, state_derivative
from skydiver_utc.plant.model import GEOMETRY_SIZE, INERTIA_AT, SEGMENT_COUNT, build_model

# Share of the broadside normal force at each incidence [deg] from broadside: Dietz et al., AIAA 2011-2589, as found
# in the data of a flight simulator's parachutist.
FLUID_DYNAMICS = {
    30: {"thigh": 0.81, "lower leg": 0.86, "upper arm": 0.94, "forearm": 1.05},
    45: {"thigh": 0.65, "lower leg": 0.83, "upper arm": 0.73, "forearm": 0.95},
    60: {"thigh": 0.49, "lower leg": 0.57, "upper arm": 0.63, "forearm": 0.64},
}
LIMBS = ("upper_arm", "forearm", "thigh", "shank")
SCENARIO = load_scenario("bank_recovery")
BODY = build_body(SCENARIO.subject)
MODEL = build_model(SCENARIO)._replace(gravity=0.0)


def normal_force(kind, incidence_deg):
    """Force along the limb's dorsal axis [N] at 55 m/s; the limb is alone, at the centre of mass, untilted."""
    limb = next(i for i, segment in enumerate(SEGMENTS) if segment.kind == kind)
    geometry, inverse, derivative = np.zeros(GEOMETRY_SIZE), np.empty(6), np.empty(13)
    for axis in range(3):
        geometry[(3 + axis) * SEGMENT_COUNT + limb] = BODY.drag_area[limb, axis]
    geometry[INERTIA_AT : INERTIA_AT + 3] = 1.0
    invert_inertia(geometry, inverse)
    incidence = np.deg2rad(incidence_deg)
    state = np.zeros(13)
    state[6] = 1.0
    state[7], state[9] = 55.0 * np.sin(incidence), -55.0 * np.cos(incidence)
    state_derivative(MODEL, geometry, inverse, np.zeros(4), state, derivative)
    return MODEL.mass * derivative[9]


@pytest.mark.parametrize("kind", LIMBS)
@pytest.mark.parametrize("incidence", FLUID_DYNAMICS)
def test_share_of_broadside_lies_in_the_band(kind, incidence):
    band = FLUID_DYNAMICS[incidence].values()
    assert min(band) <= normal_force(kind, incidence) / normal_force(kind, 0) <= max(band)


@pytest.mark.parametrize("kind", LIMBS)
def test_broadside_force_is_that_of_the_drag_area(kind):
    front = SCENARIO.subject.suit.drag_areas_m2[kind][0]
    dynamic_pressure = 0.5 * SCENARIO.air.density_kg_m3 * 55.0**2
    assert normal_force(kind, 0) == pytest.approx(dynamic_pressure * front, rel=1e-9)

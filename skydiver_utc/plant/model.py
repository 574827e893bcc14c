"""What the equations of motion need, laid out for the kernels."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.body.posture import Configuration, configuration, pattern_direction, posture_angles
from skydiver_utc.body.segments import Body, build_body
from skydiver_utc.parameters import Scenario

Array = NDArray[np.float64]

GRAVITY_M_S2 = 9.80665
# Numbers per posture: three coordinates and six entries of the drag-area matrix for each of the 16 segments,
# then the six entries of the inertia (xx, yy, zz, xy, xz, yz).
SEGMENT_COUNT = 16
INERTIA_AT = 9 * SEGMENT_COUNT
GEOMETRY_SIZE = INERTIA_AT + 6
_SYMMETRIC = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


class PlantModel(NamedTuple):
    """Constants of one skydiver in one air, in SI units.

    geometry (n, 150) rows of `pack_geometry` at equally spaced pattern angles, from alpha_first [rad] on
    control_min, control_max (4,)
    """

    geometry: Array
    alpha_first: float
    nodes_per_rad: float
    mass: float
    gravity: float
    half_density: float
    damping_roll: float
    damping_pitch: float
    damping_volume: float
    hand_force: float
    hand_arm: float
    control_min: Array
    control_max: Array
    alpha_slew: float
    dt: float


def build_model(scenario: Scenario) -> PlantModel:
    """The plant of a scenario, with its posture tabulated over the pattern angle's range."""
    body = build_body(scenario.subject)
    plant = scenario.plant
    alphas = np.linspace(*plant.limits.alpha, plant.pattern_nodes)
    neutral, direction = posture_angles(scenario.posture), pattern_direction(scenario.pattern)
    rows = [pack_geometry(body, configuration(body, neutral + alpha * direction)) for alpha in alphas]
    return PlantModel(
        geometry=np.array(rows),
        alpha_first=float(alphas[0]),
        nodes_per_rad=(plant.pattern_nodes - 1) / float(alphas[-1] - alphas[0]),
        mass=body.total_mass,
        gravity=GRAVITY_M_S2,
        half_density=0.5 * scenario.air.density_kg_m3,
        damping_roll=plant.damping.Cm_damp_roll,
        damping_pitch=plant.damping.Cm_damp_pitch,
        damping_volume=0.5 * plant.damping.reference_area_m2 * plant.damping.reference_length_m**2,
        hand_force=plant.hands.K_N,
        hand_arm=plant.hands.lx_m,
        control_min=np.array(plant.limits.minimum),
        control_max=np.array(plant.limits.maximum),
        alpha_slew=plant.limits.alpha_rate * scenario.dt_s,
        dt=scenario.dt_s,
    )


def pack_geometry(body: Body, posture: Configuration) -> Array:
    """One posture as a row (150,): what the aerodynamics and the equations of motion read."""
    drag = np.einsum("ijk,ik,ilk->ijl", posture.rotation, body.drag_area, posture.rotation)
    blocks = [posture.centre[:, axis] for axis in range(3)]
    blocks += [drag[:, i, j] for i, j in _SYMMETRIC]
    blocks.append(np.array([posture.inertia[i, j] for i, j in _SYMMETRIC]))
    return np.concatenate(blocks)

"""What the equations of motion need, laid out for the kernels."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.body.movement import Movement, movement
from skydiver_utc.body.posture import Configuration, configuration, motion
from skydiver_utc.body.segments import Body, build_body
from skydiver_utc.parameters import Scenario

Array = NDArray[np.float64]

GRAVITY_M_S2 = 9.80665
# Numbers per posture: three coordinates and six entries of the drag-area matrix for each of the 16 segments,
# the six entries of the inertia (xx, yy, zz, xy, xz, yz), and the angular momentum of the limbs for a unit rate of
# the pattern angle.
SEGMENT_COUNT = 16
INERTIA_AT = 9 * SEGMENT_COUNT
SWING_AT = INERTIA_AT + 6
GEOMETRY_SIZE = SWING_AT + 3
_SYMMETRIC = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


class PlantModel(NamedTuple):
    """Constants of one skydiver in one air, in SI units.

    geometry (n, 153) rows of `posture_row` at equally spaced pattern angles, from alpha_first [rad] on
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
    alpha_acceleration: float
    limb_reaction: bool
    dt: float


def build_model(scenario: Scenario) -> PlantModel:
    """The plant of a scenario, with its posture tabulated over the pattern angle's range."""
    body = build_body(scenario.subject)
    plant = scenario.plant
    alphas = np.linspace(*plant.limits.alpha, plant.pattern_nodes)
    moves = movement(scenario.posture, scenario.pattern)
    rows = [posture_row(body, moves, alpha) for alpha in alphas]
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
        alpha_acceleration=plant.limbs.alpha_acceleration,
        limb_reaction=plant.limbs.reaction,
        dt=scenario.dt_s,
    )


def posture_row(body: Body, moves: Movement, alpha: float) -> Array:
    """The row (153,) of the geometry table at a pattern angle [rad]."""
    angles = moves.angles(alpha)
    placed = configuration(body, angles)
    return pack_geometry(body, placed, swing(body, placed, *motion(body, placed, angles, moves.slope(alpha))))


def pack_geometry(body: Body, posture: Configuration, swing_per_rate: Array) -> Array:
    """One posture as a row (153,): positions, drag areas, inertia, and the limbs' momentum for a unit rate."""
    drag = np.einsum("ijk,ik,ilk->ijl", posture.rotation, body.drag_area, posture.rotation)
    blocks = [posture.centre[:, axis] for axis in range(3)]
    blocks += [drag[:, i, j] for i, j in _SYMMETRIC]
    blocks.append(np.array([posture.inertia[i, j] for i, j in _SYMMETRIC]))
    return np.concatenate([*blocks, swing_per_rate])


def swing(body: Body, placed: Configuration, velocity: Array, turning: Array) -> Array:
    """Angular momentum (3,) about the centre of mass, in pelvis axes, of limbs in motion (`motion`)."""
    spin = np.einsum("ijk,ik,ilk,il->ij", placed.rotation, body.inertia, placed.rotation, turning)
    total: Array = (spin + body.mass[:, None] * np.cross(placed.centre, velocity)).sum(axis=0)
    return total

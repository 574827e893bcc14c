# SPDX-License-Identifier: Apache-2.0
"""Numbers of the equations of motion, laid out for the kernels."""

from typing import NamedTuple

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.body.movement import Movement, movement
from skydiver_utc.body.posture import inertia_of, limb_momentum, place
from skydiver_utc.body.segments import Body, build_body
from skydiver_utc.jit import kernel
from skydiver_utc.parameters import SkydiverSettings

GRAVITY_M_S2 = 9.80665
# Numbers per posture: three coordinates and six entries of the drag-area matrix for each of the 16 segments,
# the six entries of the inertia (xx, yy, zz, xy, xz, yz), and the angular momentum of the limbs for a unit rate of
# the pattern angle.
SEGMENT_COUNT = 16
INERTIA_AT = 9 * SEGMENT_COUNT
SWING_AT = INERTIA_AT + 6
GEOMETRY_SIZE = SWING_AT + 3
# Rows of a step's scratch; drift: velocities of segments by limb motion; kept: the geometry's pattern angle, or NaN.
_WORK_ROWS = ("geometry", "inverse", "drift", "load", "slope", "probe", "following", "kept")
_SYMMETRIC = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


class PlantModel(NamedTuple):
    """Constants of one skydiver in one air, in SI units.

    geometry (n, 153) rows of `posture_row` at equally spaced pattern angles, from alpha_first [rad] on
    hand_force component along the body's z (dorsal) of the force on a hand for a unit coefficient [N]
    hand_arm y of the left hand, -y of the right one [m]: the hands' moment is r x F
    control_min, control_max (4,)
    work: scratch, which keeps the geometry of a step for the next; a model with another table needs one of its own
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
    work: Array


def build_model(settings: SkydiverSettings, dt_s: float, moves: Movement | None = None) -> PlantModel:
    """The numbers of a skydiver, with the posture tabulated over the pattern angle's range.

    `moves` is the movement of the settings, if there is one already.
    """
    body, ratios = dressed_body(settings), settings.ratios
    alphas = np.linspace(*settings.limits.alpha, settings.pattern_nodes)
    moves = moves or movement(settings.posture, settings.pattern, ratios.pattern)
    rows = [posture_row(body, moves, alpha) for alpha in alphas]
    return PlantModel(
        geometry=np.array(rows),
        alpha_first=float(alphas[0]),
        nodes_per_rad=(settings.pattern_nodes - 1) / float(alphas[-1] - alphas[0]),
        mass=ratios.mass / ratios.inertia * body.total_mass,
        gravity=GRAVITY_M_S2,
        half_density=0.5 * settings.air.density_kg_m3,
        # The yaw coefficient is a control: its ratio is that of the volume, which the other two do not have.
        damping_roll=settings.damping.Cm_damp_roll * (ratios.roll_damping / ratios.yaw_damping),
        damping_pitch=settings.damping.Cm_damp_pitch * (ratios.pitch_damping / ratios.yaw_damping),
        damping_volume=ratios.yaw_damping
        * (0.5 * settings.damping.reference_area_m2 * settings.damping.reference_length_m**2),
        hand_force=settings.hands.K_N if settings.hands.force == "dorsal" else -settings.hands.K_N,
        hand_arm=settings.hands.lx_m,
        control_min=np.array(settings.limits.minimum),
        control_max=np.array(settings.limits.maximum),
        alpha_slew=settings.limits.alpha_rate * dt_s,
        alpha_acceleration=settings.limbs.alpha_acceleration,
        limb_reaction=settings.limbs.reaction,
        dt=dt_s,
        work=np.full((len(_WORK_ROWS), GEOMETRY_SIZE), np.nan),
    )


def dressed_body(settings: SkydiverSettings) -> Body:
    """The subject's body with the ratios of inertia and drag area; its masses are those of the inertia."""
    body, ratios = build_body(settings.subject), settings.ratios
    return body._replace(
        mass=ratios.inertia * body.mass,
        inertia=ratios.inertia * body.inertia,
        drag_area=ratios.drag_area * body.drag_area,
    )


def posture_row(body: Body, moves: Movement, alpha: float) -> Array:
    """The row (153,) of the geometry table at a pattern angle [rad]."""
    row = np.empty(GEOMETRY_SIZE)
    pack_geometry(body, moves.angles(alpha), moves.slope(alpha), row)
    return row


def held_row(body: Body, angles: Array) -> Array:
    """The row (153,) of joint angles (15, 3) [rad] that do not move."""
    row = np.empty(GEOMETRY_SIZE)
    pack_geometry(body, angles, np.zeros_like(angles), row)
    return row


@kernel
def pack_geometry(body: Body, angles: Array, slope: Array, out: Array) -> None:
    """One posture as a row (153,): positions, drag areas, inertia, and the limbs' momentum for a unit rate.

    angles (15, 3) [rad] of the joints, slope (15, 3) their change per change of the pattern angle
    """
    n = SEGMENT_COUNT
    rotation, inertia, unused = np.empty((n, 3, 3)), np.empty((3, 3)), np.empty(3)
    proximal, centre = np.empty((n, 3)), np.empty((n, 3))
    place(body, angles, rotation, proximal, centre, unused)
    inertia_of(body, rotation, centre, inertia)
    limb_momentum(body, angles, slope, rotation, proximal, centre, out[SWING_AT:])
    for row in range(6):
        j, k = _SYMMETRIC[row]
        out[INERTIA_AT + row] = inertia[j, k]
        for i in range(n):
            area = 0.0
            for m in range(3):
                area += rotation[i, j, m] * body.drag_area[i, m] * rotation[i, k, m]
            out[(3 + row) * n + i] = area
    for axis in range(3):
        for i in range(n):
            out[axis * n + i] = centre[i, axis]

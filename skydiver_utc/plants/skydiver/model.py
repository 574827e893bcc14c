# SPDX-License-Identifier: Apache-2.0
"""Numbers of the equations of motion, laid out for the kernels."""

from typing import NamedTuple

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.body.movement import Movement, movement
from skydiver_utc.body.posture import configuration, in_body_axes, limb_momentum
from skydiver_utc.body.segments import Body, build_body
from skydiver_utc.parameters import SkydiverSettings

GRAVITY_M_S2 = 9.80665
# Numbers per posture: three coordinates and six entries of the drag-area matrix for each of the 16 segments,
# the six entries of the inertia (xx, yy, zz, xy, xz, yz), and the angular momentum of the limbs for a unit rate of
# the pattern angle.
SEGMENT_COUNT = 16
INERTIA_AT = 9 * SEGMENT_COUNT
SWING_AT = INERTIA_AT + 6
GEOMETRY_SIZE = SWING_AT + 3
# Rows of a step's scratch: geometry, inverse, drift (velocities of segments by limb motion), load, slope, probe,
# following, and kept (the pattern angle of the geometry, or NaN).
_WORK_ROWS = 8
# Rows and columns of xx, yy, zz, xy, xz, yz.
_SYMMETRIC = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)


class PlantModel(NamedTuple):
    """Constants of one skydiver in one air, in SI units.

    geometry (n, 153) rows of `posture_rows` at equally spaced pattern angles, from alpha_first [rad] on
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
    dt: float
    work: Array


def build_model(settings: SkydiverSettings, dt_s: float, moves: Movement | None = None) -> PlantModel:
    """The numbers of a skydiver, with the posture tabulated over the pattern angle's range.

    `moves` is the movement of the settings, if there is one already.
    """
    body, ratios = dressed_body(settings), settings.ratios
    alphas = np.linspace(*settings.limits.alpha, settings.pattern_nodes)
    moves = moves or movement(settings.posture, settings.pattern, ratios.pattern)
    return PlantModel(
        geometry=posture_rows(body, moves, alphas),
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
        dt=dt_s,
        work=np.full((_WORK_ROWS, GEOMETRY_SIZE), np.nan),
    )


def dressed_body(settings: SkydiverSettings) -> Body:
    """The subject's body with the ratios of inertia and drag area; its masses are those of the inertia."""
    body, ratios = build_body(settings.subject), settings.ratios
    return body._replace(
        mass=ratios.inertia * body.mass,
        inertia=ratios.inertia * body.inertia,
        drag_area=ratios.drag_area * body.drag_area,
    )


def posture_rows(body: Body, moves: Movement, alphas: Array) -> Array:
    """The rows (n, 153) of the geometry table at pattern angles (n,) [rad]."""
    return geometry_rows(body, moves.angles(alphas), moves.slope(alphas))


def held_row(body: Body, angles: Array) -> Array:
    """The row (153,) of joint angles (15, 3) [rad] that do not move."""
    return geometry_rows(body, angles, np.zeros_like(angles))


def geometry_rows(body: Body, angles: Array, slope: Array) -> Array:
    """Postures as rows (..., 153): positions, drag areas, inertia, and the limbs' momentum for a unit rate.

    angles (..., 15, 3) [rad] of the joints, slope (..., 15, 3) their change per change of the pattern angle
    """
    placed = configuration(body, angles)
    areas = in_body_axes(placed.rotation, body.drag_area)[(..., *_SYMMETRIC)]
    by_segment = np.concatenate((placed.centre, areas), axis=-1)
    return np.concatenate(
        (
            np.swapaxes(by_segment, -1, -2).reshape(*angles.shape[:-2], INERTIA_AT),
            placed.inertia[(..., *_SYMMETRIC)],
            limb_momentum(body, angles, slope, placed),
        ),
        axis=-1,
    )

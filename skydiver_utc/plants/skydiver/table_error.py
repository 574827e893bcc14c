# SPDX-License-Identifier: Apache-2.0
"""The error of the plant's table over the pattern angle between its nodes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.arrays import Array
from skydiver_utc.body.movement import Movement
from skydiver_utc.parameters import ParameterError, PosturePath, SkydiverSettings
from skydiver_utc.plants.skydiver.dynamics import posture_geometry
from skydiver_utc.plants.skydiver.model import (
    GEOMETRY_SIZE,
    INERTIA_AT,
    SEGMENT_COUNT,
    SWING_AT,
    PlantModel,
    dressed_body,
    posture_row,
)

# A tenth of what half a degree, the tolerance of measured joint angles, moves a hand; and of a body's 10 kg m2 as
# small a part as that is of its size.
LARGEST_PLACE_M = 5e-4
LARGEST_INERTIA_KG_M2 = 5e-3
# At how many places each suspicion is followed before a run.
_SUSPECTS = 6


class TableError(NamedTuple):
    """Largest errors: place of a segment [m], inertia [kg m2], limbs' momentum for a unit rate of alpha [kg m2]."""

    place: float
    inertia: float
    swing: float

    @property
    def too_large(self) -> bool:
        """Whether the table is too coarse to be flown; swing has no bound, as it has kinks at a path's postures."""
        return self.place > LARGEST_PLACE_M or self.inertia > LARGEST_INERTIA_KG_M2

    def __str__(self) -> str:
        return (
            f"{1e3 * self.place:.2g} mm in the place of a segment, {self.inertia:.2g} kg m2 in the inertia and"
            f" {self.swing:.2g} kg m2 in the limbs' momentum per alpha rate"
        )


def refuse_coarse_table(settings: SkydiverSettings, model: PlantModel, moves: Movement) -> None:
    """Refuse a path that is too quick for the nodes of the table, by its worst places (`ParameterError`)."""
    if not isinstance(settings.pattern, PosturePath):
        return
    error = table_error(settings, model, moves, _SUSPECTS)
    if error.too_large:
        raise ParameterError(
            f"plant.pattern_nodes = {len(model.geometry)} is too few for pattern {settings.pattern.name}: between"
            f" nodes its table is off by {error}; raise plant.pattern_nodes, or set the postures farther apart"
        )


def table_error(
    settings: SkydiverSettings, model: PlantModel, moves: Movement, suspects: int | None = None
) -> TableError:
    """Errors of the table halfway between its nodes and at the postures of a path: everywhere, or at suspects."""
    body = dressed_body(settings)
    nodes = np.linspace(*settings.limits.alpha, len(model.geometry))
    alphas = np.concatenate([0.5 * (nodes[1:] + nodes[:-1]), _keyframes_within(settings)])
    if suspects is not None:
        alphas = alphas[_suspects(model, moves, nodes, alphas, suspects)]
    row, largest = np.empty(GEOMETRY_SIZE), np.zeros(GEOMETRY_SIZE)
    for alpha in alphas:
        posture_geometry(model, alpha, row)
        np.maximum(largest, np.abs(row - posture_row(body, moves, alpha)), out=largest)
    return TableError(
        place=float(largest[: 3 * SEGMENT_COUNT].max()),
        inertia=float(largest[INERTIA_AT:SWING_AT].max()),
        swing=float(largest[SWING_AT:].max()),
    )


def _keyframes_within(settings: SkydiverSettings) -> Array:
    """Pattern angles of a path's postures inside the range of alpha: they may lie unseen between two nodes."""
    first, last = settings.limits.alpha
    keyframes = settings.pattern.keyframes if isinstance(settings.pattern, PosturePath) else ()
    return np.array([k.alpha for k in keyframes if first < k.alpha < last])


def _suspects(
    model: PlantModel, moves: Movement, nodes: Array, alphas: Array, count: int
) -> NDArray[np.intp]:
    """Which of the pattern angles (n,) to look at, from joint angles alone, of which all are known at little cost.

    Those where the angles themselves would be missed most were they in the table; those where they turn most from
    node to node, as sines of angles are no cubics; and the first and the last stretch, where the table's cubics are
    off their centre.
    """
    at_nodes, exact = moves.angles(nodes), moves.angles(alphas).reshape(len(alphas), -1)
    joint_angles = np.zeros_like(model.geometry)
    joint_angles[:, : exact.shape[1]] = at_nodes.reshape(len(nodes), -1)
    tabulated, row = model._replace(geometry=joint_angles), np.empty(GEOMETRY_SIZE)
    missed = np.empty(len(alphas))
    for i, alpha in enumerate(alphas):
        posture_geometry(tabulated, alpha, row)
        missed[i] = np.abs(row[: exact.shape[1]] - exact[i]).sum()
    turned = np.abs(np.diff(at_nodes, axis=0)).sum(axis=(1, 2))
    ends = np.array([0, len(turned) - 1])
    return np.unique(np.concatenate([ends, np.argsort(missed)[-count:], np.argsort(turned)[-count:]]))

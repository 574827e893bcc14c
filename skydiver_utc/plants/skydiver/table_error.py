# SPDX-License-Identifier: Apache-2.0
"""The error of the plant's table over the pattern angle between its nodes."""

from typing import NamedTuple

import numpy as np

from skydiver_utc.body.movement import Movement
from skydiver_utc.parameters import ParameterError, PosturePath, SkydiverSettings
from skydiver_utc.plants.skydiver.dynamics import posture_geometry
from skydiver_utc.plants.skydiver.model import (
    INERTIA_AT,
    SEGMENT_COUNT,
    SWING_AT,
    PlantModel,
    dressed_body,
    posture_rows,
)

# A tenth of what half a degree, the tolerance of measured joint angles, moves a hand; and of a body's 10 kg m2 as
# small a part as that is of its size.
LARGEST_PLACE_M = 5e-4
LARGEST_INERTIA_KG_M2 = 5e-3


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
    """Refuse a path that is too quick for the nodes of the table (`ParameterError`)."""
    if not isinstance(settings.pattern, PosturePath):
        return
    error = table_error(settings, model, moves)
    if error.too_large:
        raise ParameterError(
            f"plant.pattern_nodes = {len(model.geometry)} is too few for pattern {settings.pattern.name}: between"
            f" nodes its table is off by {error}; raise plant.pattern_nodes, or set the postures farther apart"
        )


def table_error(settings: SkydiverSettings, model: PlantModel, moves: Movement) -> TableError:
    """Errors of the table halfway between its nodes and at the postures of a path, which may lie between two nodes."""
    body, (first, last) = dressed_body(settings), settings.limits.alpha
    nodes = np.linspace(first, last, len(model.geometry))
    keyframes = settings.pattern.keyframes if isinstance(settings.pattern, PosturePath) else ()
    between = [k.alpha for k in keyframes if first < k.alpha < last]
    alphas = np.concatenate([0.5 * (nodes[1:] + nodes[:-1]), between])
    exact = posture_rows(body, moves, alphas)
    tabulated = np.empty_like(exact)
    for alpha, row in zip(alphas, tabulated, strict=True):
        posture_geometry(model, alpha, row)
    largest = np.abs(tabulated - exact).max(axis=0)
    return TableError(
        place=float(largest[: 3 * SEGMENT_COUNT].max()),
        inertia=float(largest[INERTIA_AT:SWING_AT].max()),
        swing=float(largest[SWING_AT:].max()),
    )

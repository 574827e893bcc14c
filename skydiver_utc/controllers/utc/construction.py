# SPDX-License-Identifier: Apache-2.0
"""From settings to the numbers and functions that UTC works with."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.limits import by_name
from skydiver_utc.controllers.roll_out import Dynamics, RollOut
from skydiver_utc.controllers.utc.dynamics import incremental
from skydiver_utc.controllers.utc.horizon_outputs import HorizonOutputs
from skydiver_utc.controllers.utc.law import Law
from skydiver_utc.controllers.utc.settings import UtcSettings, matrix
from skydiver_utc.plants.protocol import Plant
from skydiver_utc.unscented.sigma_points import weights

# After how many horizons, and steps at least, an innovation that does not shrink counts as not reached.
_PATIENCE, _LEAST_PATIENCE = 10, 50
# Products of squares of a larger range would overflow.
_LARGEST_RANGE = 1e50


def controls_of(block: str, given: Mapping[str, float], plant: Plant) -> Array:
    """Controls (m,) of a block of the settings, the initial ones where it names none. Raises ValueError."""
    values = by_name(block, given, plant, plant.initial_control())
    for c in np.flatnonzero(~((plant.minimum <= values) & (values <= plant.maximum))):
        raise ValueError(
            f"{block}.{plant.control_names[c]} is {values[c]:g}, outside the limits {plant.minimum[c]:g} .."
            f" {plant.maximum[c]:g} of the control: change one"
        )
    return values


def initial_covariance(settings: UtcSettings, limits: Array, controls: tuple[str, ...]) -> Array:
    """Pu (m, m) at the start, without coupling. Raises ValueError."""
    if settings.Pu is not None:
        variances = matrix("Pu", settings.Pu, controls)
        if not (np.diag(variances) > 0.0).all():
            raise ValueError(
                "Pu has a variance of zero: that control would never be tried; give it a small one"
            )
        return variances
    spans = limits[1] - limits[0]
    if not (spans < _LARGEST_RANGE).all():
        raise ValueError("Pu is needed: the range of a control is infinite, or too large to take it from")
    # A control whose bounds are equal never moves: any variance does.
    return np.diag((0.1 * np.where(spans > 0.0, spans, 1.0)) ** 2)


def law_of(
    settings: UtcSettings, plant: Plant, of: HorizonOutputs, limits: Array, inside: Dynamics | None, Pu: Array
) -> tuple[Law, RollOut]:
    """The arrays of the law, which `resume` fills, and the roll-out that shares them. Raises ValueError.

    limits (3, m); inside: dynamics of a point; Pu (m, m) at the start
    """
    m, L, steps = len(plant.control_names), len(of.P_err), settings.steps
    points, floor = 2 * m + 1, settings.covariance_floor
    at = RollOut(plant.model, len(plant.output_names), steps, of.selected, limits, (points, m), inside)
    R = at.outputs.shape[1]
    drawn = inside is None or (inside.function is incremental and settings.dynamics.saved == "drawn")  # type: ignore[union-attr]
    law = Law(
        steps=np.array(steps),
        points=at.points,
        of_roll_out=at.outputs,
        weights=weights(m, settings.W0),
        floor=1e-9 * float(np.diag(Pu).min()) if floor is None else floor,
        kept_share=1.0 - settings.forgetting_factor,
        limits=limits,
        P_err=of.P_err,
        Qu=np.empty((m, m)),
        nominal=of.nominal,
        tracked=len(of.tracked),
        per_step=len(of.names),
        tangent=settings.aim == "tangent",
        angles=of.angles,
        of_control=settings.innovation == "control",
        outputs=np.zeros((points, L)),
        saved=at.points if drawn else at.first,
        offset=np.zeros(L),
        reference=of.reference,
        predicted=np.zeros(L),
        innovation=np.zeros(L),
        control=at.applied,
        Pu=Pu.copy(),
        repaired_Pu=np.empty((m, m)),
        gain=np.zeros((m, L)),
        unmoved=np.empty(len(of.names), dtype=np.bool_),
        alive=np.ones(points),
        spread=np.empty(1),
        watch=np.empty(2 + L),
        patience=max(_LEAST_PATIENCE, _PATIENCE * steps[-1]),
        singly=np.empty(1, dtype=np.bool_),
        root=np.empty((m, m)),
        following=np.empty((m, m)),
        vectors=np.empty((m + 1, m)),
        left=np.empty(points),
        U=np.empty(m),
        Y=np.zeros(L),
        at=np.empty(L),
        C_y=np.empty((L, L)),
        found=np.empty((1, R)),
        rest=np.empty((1, 1)),
    )
    return law, at


def plain(value: Any) -> Any:
    """Arrays of NumPy as numbers and rows, which settings hold."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, dict):
        return {name: plain(item) for name, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, list | tuple) else value

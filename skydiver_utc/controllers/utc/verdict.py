# SPDX-License-Identifier: Apache-2.0
"""Whether a step of UTC can reach its reference."""

from typing import Any

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.jit import kernel

# Below this share of P_err what controls move of an output, squared, moves nothing in any time that counts.
LEAST_EFFECT = 1e-6
# An innovation beyond this many sqrt(P_err) is large.
LARGE = 3.0
# An innovation that has shrunk neither by this share nor by 3 sqrt(P_err) within `patience` steps has come to a halt.
LEAST_PROGRESS = 1e-2


@kernel
def without_effect(law: Any, Pu: Array, C_uy: Array) -> bool:
    """Whether some output is moved by no control at any step of the horizon; `unmoved` becomes 1 for those, else 0."""
    found = False
    for k in range(law.per_step):
        law.unmoved[k] = 1.0
        for t in range(k, law.per_step * law.steps.shape[0], law.per_step):
            for a in range(len(Pu)):
                if Pu[a, a] > 0.0:
                    # Pu shrinks on a bound, the range of a control does not.
                    span = law.limits[1, a] - law.limits[0, a]
                    reach = span * span if np.isfinite(span) else Pu[a, a]
                    if not (C_uy[a, t] / Pu[a, a]) ** 2 * reach <= LEAST_EFFECT * law.P_err[t, t]:
                        law.unmoved[k] = 0.0
        found = found or law.unmoved[k] > 0.0
    return found


@kernel
def not_reached(law: Any) -> bool:
    """Whether a large innovation has shrunk no more for `patience` steps, beside a reference that stands still.

    Covariances between controls may then lead against bounds only, so that the controls are tried singly until the
    reference moves.
    """
    size, moved, watch = 0.0, False, law.watch
    for k in range(law.per_step * law.steps.shape[0]):
        unit = np.sqrt(law.P_err[k, k])
        size = max(size, abs(law.innovation[k]) / unit)
        moved = moved or abs(law.reference[k] - watch[2 + k]) > LARGE * unit
    if moved:
        for k in range(law.reference.shape[0]):
            watch[2 + k] = law.reference[k]
    if moved or size <= LARGE or size < watch[0] - min(LEAST_PROGRESS * watch[0], LARGE):
        watch[0], watch[1] = size, 0.0
    else:
        watch[1] += 1.0
    if moved:
        law.singly[0] = 0.0
    elif watch[1] > law.patience:
        law.singly[0] = 1.0
    return bool(watch[1] > law.patience)

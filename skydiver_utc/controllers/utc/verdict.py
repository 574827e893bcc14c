# SPDX-License-Identifier: Apache-2.0
"""Whether a step of UTC can reach its reference."""

import numpy as np

from skydiver_utc.arrays import Array, Flags
from skydiver_utc.jit import kernel

# Below this share of P_err what controls move of an output, squared, moves nothing in any time that counts.
LEAST_EFFECT = 1e-6
# An innovation beyond this many sqrt(P_err) is large.
LARGE = 3.0
# An innovation that has shrunk neither by this share nor by 3 sqrt(P_err) within `patience` steps has come to a halt.
LEAST_PROGRESS = 1e-2


@kernel
def without_effect(Pu: Array, C_uy: Array, P_err: Array, limits: Array, size: int, unmoved: Flags) -> bool:
    """Whether some output is moved by no control at any step of the horizon; `unmoved` says which.

    size: how many of the outputs are of the roll-out
    """
    found, per_step = False, len(unmoved)
    for k in range(per_step):
        unmoved[k] = True
        for t in range(k, size, per_step):
            for a in range(len(Pu)):
                if Pu[a, a] > 0.0:
                    # Pu shrinks on a bound, the range of a control does not.
                    span = limits[1, a] - limits[0, a]
                    reach = span * span if span < np.inf else Pu[a, a]
                    share = C_uy[a, t] / Pu[a, a]
                    if not share * share * reach <= LEAST_EFFECT * P_err[t, t]:
                        unmoved[k] = False
        found = found or unmoved[k]
    return found


@kernel
def not_reached(
    innovation: Array, reference: Array, P_err: Array, size: int, patience: int, watch: Array, singly: Flags
) -> bool:
    """Whether a large innovation has shrunk no more for `patience` steps, beside a reference that stands still.

    Covariances between controls may then lead against bounds only, so that the controls are tried singly until the
    reference moves.
    """
    largest, moved = 0.0, False
    for k in range(size):
        unit = np.sqrt(P_err[k, k])
        largest = max(largest, abs(innovation[k]) / unit)
        moved = moved or abs(reference[k] - watch[2 + k]) > LARGE * unit
    if moved:
        for k in range(reference.shape[0]):
            watch[2 + k] = reference[k]
    if moved or largest <= LARGE or largest < watch[0] - min(LEAST_PROGRESS * watch[0], LARGE):
        watch[0], watch[1] = largest, 0.0
    else:
        watch[1] += 1.0
    if moved:
        singly[0] = False
    elif watch[1] > patience:
        singly[0] = True
    return bool(watch[1] > patience)

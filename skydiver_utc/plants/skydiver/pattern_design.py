# SPDX-License-Identifier: Apache-2.0
"""Movement patterns by optimisation: the most of one acceleration for the least of others and of swinging limbs."""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.body.posture import ANGLES, configuration, joint_ranges
from skydiver_utc.body.segments import JOINTS, build_body
from skydiver_utc.parameters import ParameterError, Scenario
from skydiver_utc.plants.skydiver.model import build_model, limb_momentum
from skydiver_utc.plants.skydiver.pattern_kinds import PAIRED, PatternKind
from skydiver_utc.plants.skydiver.trim import Trim, in_posture

Array = NDArray[np.float64]

_LARGEST_COMPONENT = 0.55
# Kept from the joint limits, so that rounding in a file does not pass them.
_MARGIN = 1e-6


def design_pattern(
    kind: PatternKind, scenario: Scenario, trim: Trim, rng: np.random.Generator, starts: int = 4
) -> Array:
    """Unit direction (15, 3) in joint space of a pattern of this kind, found from several random starts.

    With it the trimmed posture stays within the joint limits over the whole range of alpha.
    """
    from scipy.optimize import NonlinearConstraint, minimize

    body, model = build_body(scenario.plant.subject), build_model(scenario.plant, scenario.dt_s)
    costs, swing_costs = kind.acceleration_costs, kind.swing_costs

    def cost(free: Array) -> float:
        direction = _direction(kind, free)
        total: float = 0.0
        for alpha, weight in kind.judged:
            held = in_posture(body, model, trim.angles + alpha * direction)
            a = held.straight_down(trim.speed, trim.pitch)
            linear = costs[0] * a[0] ** 2 + costs[1] * a[1] ** 2 + costs[2] * a[2] ** 2
            total += linear - weight * a[kind.wanted]
            total += costs[3] * a[3] ** 2 + costs[4] * a[4] ** 2 + costs[5] * a[5] ** 2
        total /= len(kind.judged)
        h = limb_momentum(body, configuration(body, trim.angles), trim.angles, direction)
        total += swing_costs[0] * h[0] ** 2 + swing_costs[1] * h[1] ** 2 + swing_costs[2] * h[2] ** 2
        return float(total)

    reach = _reach(kind, scenario, trim)

    def square_norm(free: Array) -> Array:
        return np.array([(_direction(kind, free) ** 2).sum()])

    unit_norm = NonlinearConstraint(square_norm, 1.0, 1.0)
    found = [
        minimize(
            cost,
            np.clip(0.3 * rng.normal(size=len(reach)), -reach, reach),
            bounds=list(zip(-reach, reach, strict=True)),
            constraints=unit_norm,
            method="SLSQP",
            options={"maxiter": 500, "ftol": 1e-9},
        )
        for _ in range(starts)
    ]
    best = min((one for one in found if one.success), key=lambda one: float(one.fun), default=None)
    if best is None:
        raise ParameterError(
            f"no {kind.name} pattern was found for posture {scenario.plant.posture.name}: try another seed"
        )
    direction = _direction(kind, best.x)
    return direction / np.linalg.norm(direction)


def _reach(kind: PatternKind, scenario: Scenario, trim: Trim) -> Array:
    """Largest size of each free component for which both sides stay within their ranges at every alpha."""
    lower, upper = joint_ranges(scenario.plant.subject.joint_limits)
    room = np.minimum(upper - trim.angles, trim.angles - lower) / max(map(abs, scenario.plant.limits.alpha))
    rows = [*kind.midline, *((f"left_{joint}", column) for joint, column in PAIRED)]
    free = np.array([room[JOINTS.index(joint), column] for joint, column in rows])
    return np.clip(free - _MARGIN, 0.0, _LARGEST_COMPONENT)


def _direction(kind: PatternKind, free: Array) -> Array:
    direction = np.zeros((len(JOINTS), len(ANGLES)))
    for (joint, column), value in zip(kind.midline, free, strict=False):
        direction[JOINTS.index(joint), column] = value
    for (joint, column), value in zip(PAIRED, free[len(kind.midline) :], strict=True):
        direction[JOINTS.index(f"left_{joint}"), column] = value
        direction[JOINTS.index(f"right_{joint}"), column] = kind.right_side * value
    return direction

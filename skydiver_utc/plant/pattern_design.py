"""A turning pattern by optimisation: the most yaw for the least roll, pitch, slide and swing of the limbs."""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.body.posture import ANGLES, joint_ranges
from skydiver_utc.body.segments import JOINTS, build_body
from skydiver_utc.parameters import ParameterError, Scenario
from skydiver_utc.plant.model import build_model
from skydiver_utc.plant.trim import FallingBody, Trim

Array = NDArray[np.float64]

# A pattern and its negative are mirror images: opposite on the two sides, no flexion on the midline.
_MIDLINE = tuple((joint, column) for joint in ("lumbar", "thorax") for column in (1, 2))
_PAIRED = (
    *(("shoulder", column) for column in range(3)),
    ("elbow", 0),
    ("elbow", 2),
    *(("hip", column) for column in range(3)),
    ("knee", 0),
    ("knee", 2),
)
# Pattern angles at which the pattern is judged, with the weight of its yaw acceleration there.
_JUDGED = ((0.5, 0.6), (1.0, 0.6), (1.5, 1.8))
# Costs of squared accelerations along x, y and about x, y against yaw acceleration.
_COST_OF_X, _COST_OF_Y, _COST_OF_ROLL, _COST_OF_PITCH = 0.05, 0.03, 0.6, 1.2
# Costs of the squared angular momentum about x and z of limbs that move at 1 rad/s of the pattern: a pattern that
# swings turns the body the wrong way whenever it starts.
_COST_OF_SWING_X, _COST_OF_SWING_Z = 0.9, 3.0
_LARGEST_COMPONENT = 0.55
# Kept from the joint limits, so that rounding in a file does not pass them.
_MARGIN = 1e-6


def design_turn(scenario: Scenario, trim: Trim, rng: np.random.Generator, starts: int = 4) -> Array:
    """Unit direction (15, 3) in joint space that turns left, found from several random starts.

    With it the trimmed posture stays within the joint limits over the whole range of alpha.
    """
    from scipy.optimize import NonlinearConstraint, minimize

    falling = FallingBody(build_body(scenario.subject), build_model(scenario), trim.pitch)

    def cost(free: Array) -> float:
        direction = _direction(free)
        total: float = 0.0
        for alpha, weight in _JUDGED:
            a = falling.acceleration(trim.angles + alpha * direction, trim.speed)
            total += _COST_OF_X * a[0] ** 2 + _COST_OF_Y * a[1] ** 2 - weight * a[5]
            total += _COST_OF_ROLL * a[3] ** 2 + _COST_OF_PITCH * a[4] ** 2
        swing = falling.swing(trim.angles, direction)
        total /= len(_JUDGED)
        total += _COST_OF_SWING_X * swing[0] ** 2 + _COST_OF_SWING_Z * swing[2] ** 2
        return float(total)

    reach = _reach(scenario, trim)
    size = len(_MIDLINE) + len(_PAIRED)

    def square_norm(free: Array) -> Array:
        return np.array([(_direction(free) ** 2).sum()])

    unit_norm = NonlinearConstraint(square_norm, 1.0, 1.0)
    found = [
        minimize(
            cost,
            np.clip(0.3 * rng.normal(size=size), -reach, reach),
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
            f"no turning pattern was found for posture {scenario.posture.name}: try another seed"
        )
    direction = _direction(best.x)
    return direction / np.linalg.norm(direction)


def _reach(scenario: Scenario, trim: Trim) -> Array:
    """Largest size of each free component for which both sides stay within their ranges at every alpha."""
    lower, upper = joint_ranges(scenario.subject.joint_limits)
    room = np.minimum(upper - trim.angles, trim.angles - lower) / max(map(abs, scenario.plant.limits.alpha))
    rows = [*_MIDLINE, *((f"left_{joint}", column) for joint, column in _PAIRED)]
    free = np.array([room[JOINTS.index(joint), column] for joint, column in rows])
    return np.clip(free - _MARGIN, 0.0, _LARGEST_COMPONENT)


def _direction(free: Array) -> Array:
    direction = np.zeros((len(JOINTS), len(ANGLES)))
    for (joint, column), value in zip(_MIDLINE, free, strict=False):
        direction[JOINTS.index(joint), column] = value
    for (joint, column), value in zip(_PAIRED, free[len(_MIDLINE) :], strict=True):
        direction[JOINTS.index(f"left_{joint}"), column] = value
        direction[JOINTS.index(f"right_{joint}"), column] = -value
    return direction

# SPDX-License-Identifier: Apache-2.0
"""Movement patterns by optimisation: the most of one acceleration for the least of others and of swinging limbs."""

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.body.posture import ANGLES, joint_ranges, joint_rows, pattern_direction
from skydiver_utc.body.segments import JOINTS, Body, build_body
from skydiver_utc.parameters import MovementPattern, ParameterError, Scenario
from skydiver_utc.plants.skydiver.model import SWING_AT, PlantModel, build_model, geometry_rows
from skydiver_utc.plants.skydiver.pattern_kinds import PAIRED, PatternKind
from skydiver_utc.plants.skydiver.steady import HeldBody, straight_down
from skydiver_utc.plants.skydiver.trim import DECIMALS, Trim

_LARGEST_COMPONENT = 0.55
# Kept from the joint limits, so that rounding in a file does not pass them.
_MARGIN = 1e-6
# Of a component, to both sides, for the slope of the cost.
_STEP = 1e-5


def design_pattern(
    kind: PatternKind,
    scenario: Scenario,
    trim: Trim,
    rng: np.random.Generator,
    starts: int = 4,
    known: MovementPattern | None = None,
) -> Array:
    """Unit direction (15, 3) in joint space of a pattern of this kind, the best found from several random starts.

    With it the trimmed posture stays within the joint limits over the whole range of alpha. A known pattern is one
    more start.
    """
    from scipy.optimize import NonlinearConstraint, minimize

    body, model = build_body(scenario.plant.subject), build_model(scenario.plant, scenario.dt_s)
    basis, reach = _basis(kind), _reach(kind, scenario, trim)
    squares, cost = (basis**2).sum(axis=(1, 2)), _Cost(kind, body, model, trim)
    steps = _STEP * np.concatenate([basis, -basis, np.zeros_like(basis[:1])])

    def cost_and_slope(free: Array) -> tuple[float, Array]:
        above, below, here = np.split(cost(np.tensordot(free, basis, 1) + steps), (len(free), 2 * len(free)))
        return float(here[0]), (above - below) / (2.0 * _STEP)

    unit_norm = NonlinearConstraint(
        lambda free: squares @ free**2, 1.0, 1.0, jac=lambda free: 2.0 * squares * free
    )
    guesses = [rng.uniform(-reach, reach) for _ in range(starts)]
    if known is not None:
        guesses.append(np.tensordot(basis, pattern_direction(known), 2) / squares)
    found = [
        minimize(
            cost_and_slope,
            np.clip(guess, -reach, reach),
            jac=True,
            bounds=list(zip(-reach, reach, strict=True)),
            constraints=unit_norm,
            method="SLSQP",
            options={"maxiter": 500, "ftol": 1e-9},
        )
        for guess in guesses
    ]
    best = min((one for one in found if one.success), key=lambda one: float(one.fun), default=None)
    if best is None:
        raise ParameterError(
            f"no {kind.name} pattern was found for posture {scenario.plant.posture.name}: try another seed"
        )
    direction: Array = np.tensordot(best.x, basis, 1)
    return direction


def designed_pattern(
    kind: PatternKind,
    scenario: Scenario,
    trim: Trim,
    seed: int,
    name: str,
    known: MovementPattern | None = None,
) -> MovementPattern:
    """The designed pattern with its source, rounded as in a file."""
    plant, subject = scenario.plant, scenario.plant.subject
    direction = design_pattern(kind, scenario, trim, np.random.default_rng(seed), known=known)
    starts = f", with pattern {known.name} as one of the starts" if known else ""
    return MovementPattern(
        name=name,
        description=kind.description,
        source=(
            f"Designed by skydiver-utc pattern design --kind {kind.name} for posture {plant.posture.name}, subject"
            f" {subject.name}, suit {subject.suit.name}, seed {seed}{starts}: {kind.aim}, within the joint limits"
            f" {subject.joint_limits.name}"
        ),
        components=joint_rows(direction.round(DECIMALS)),
    )


def _reach(kind: PatternKind, scenario: Scenario, trim: Trim) -> Array:
    """Largest size of each free component for which both sides stay within their ranges at every alpha."""
    lower, upper = joint_ranges(scenario.plant.subject.joint_limits)
    room = np.minimum(upper - trim.angles, trim.angles - lower) / max(map(abs, scenario.plant.limits.alpha))
    rows = [*kind.midline, *((f"left_{joint}", column) for joint, column in PAIRED)]
    free = np.array([room[JOINTS.index(joint), column] for joint, column in rows])
    return np.clip(free - _MARGIN, 0.0, _LARGEST_COMPONENT)


def _basis(kind: PatternKind) -> Array:
    """The direction (n, 15, 3) of a unit of each free component: of the trunk, then of both limbs of a pair."""
    basis = np.zeros((len(kind.midline) + len(PAIRED), len(JOINTS), len(ANGLES)))
    for i, (joint, column) in enumerate(kind.midline):
        basis[i, JOINTS.index(joint), column] = 1.0
    for i, (joint, column) in enumerate(PAIRED, len(kind.midline)):
        basis[i, JOINTS.index(f"left_{joint}"), column] = 1.0
        basis[i, JOINTS.index(f"right_{joint}"), column] = kind.right_side
    return basis


class _Cost:
    """The cost of directions of a kind of pattern, for a body in its straight fall."""

    def __init__(self, kind: PatternKind, body: Body, model: PlantModel, trim: Trim) -> None:
        self._kind, self._body, self._model, self._angles = kind, body, model, trim.angles
        self._falling = straight_down(trim.speed, trim.pitch)
        self._alphas, self._weights = np.array(kind.judged).T

    def __call__(self, directions: Array) -> Array:
        """Costs (n,) of directions (n, 15, 3)."""
        # Limbs swing in the neutral posture.
        alphas = np.append(self._alphas, 0.0)
        angles = self._angles + np.multiply.outer(alphas, directions)
        rows = geometry_rows(self._body, angles, np.broadcast_to(directions, angles.shape))
        total = np.zeros(len(directions))
        for axis, cost in self._kind.swing_costs.items():
            total += cost * rows[-1, :, SWING_AT + axis] ** 2
        for weight, at_alpha in zip(self._weights / len(self._weights), rows[:-1], strict=True):
            accelerations = np.array([self._held(row).accelerations_in(self._falling) for row in at_alpha])
            total -= weight * accelerations[:, self._kind.wanted]
            for axis, cost in self._kind.acceleration_costs.items():
                total += cost / len(self._weights) * accelerations[:, axis] ** 2
        return total

    def _held(self, row: Array) -> HeldBody:
        return HeldBody(self._model, np.zeros(4), row)

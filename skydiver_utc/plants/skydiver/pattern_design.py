# SPDX-License-Identifier: Apache-2.0
"""Movement patterns by optimisation: the most of one acceleration for the least of others and of swinging limbs."""

from typing import NamedTuple

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.body.posture import ANGLES, joint_ranges, joint_rows, pattern_direction
from skydiver_utc.body.segments import JOINTS, Body, build_body
from skydiver_utc.jit import address, call, kernel, program
from skydiver_utc.parameters import MovementPattern, ParameterError, Scenario
from skydiver_utc.plants.skydiver.dynamics import STATE_SIZE, invert_inertia, state_derivative
from skydiver_utc.plants.skydiver.model import GEOMETRY_SIZE, SWING_AT, PlantModel, build_model, pack_geometry
from skydiver_utc.plants.skydiver.pattern_kinds import PAIRED, PatternKind
from skydiver_utc.plants.skydiver.steady import straight_down
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
    squares, numbers = (basis**2).sum(axis=(1, 2)), _numbers(kind, body, model, trim)

    def cost(free: Array) -> tuple[float, Array]:
        slope = np.empty(len(free))
        return cost_and_slope(numbers, basis, free, slope), slope

    unit_norm = NonlinearConstraint(
        lambda free: squares @ free**2, 1.0, 1.0, jac=lambda free: 2.0 * squares * free
    )
    guesses = [rng.uniform(-reach, reach) for _ in range(starts)]
    if known is not None:
        guesses.append(np.tensordot(basis, pattern_direction(known), 2) / squares)
    found = [
        minimize(
            cost,
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


class _Numbers(NamedTuple):
    """Numbers of the cost of a pattern: a kind of pattern and a body in its straight fall.

    judged pattern angles [rad] with the weight of the wanted acceleration at each; falling (13,) the state, neutral
    (15, 3) [rad] the posture; pack, derivative: addresses of `pack_geometry` and `state_derivative`
    """

    wanted: int
    judged: Array
    weights: Array
    acceleration_costs: Array
    swing_costs: Array
    body: Body
    model: PlantModel
    falling: Array
    neutral: Array
    pack: int
    derivative: int


def _numbers(kind: PatternKind, body: Body, model: PlantModel, trim: Trim) -> _Numbers:
    judged, weights = np.array(kind.judged).T.copy()
    acceleration_costs, swing_costs = (
        np.zeros_like(trim.residual),
        np.zeros_like(model.geometry[0, SWING_AT:]),
    )
    for costs, given in ((acceleration_costs, kind.acceleration_costs), (swing_costs, kind.swing_costs)):
        costs[list(given)] = list(given.values())
    falling, angles, row = straight_down(trim.speed, trim.pitch), trim.angles, np.empty(GEOMETRY_SIZE)
    return _Numbers(
        kind.wanted,
        judged,
        weights,
        acceleration_costs,
        swing_costs,
        body,
        model,
        falling,
        angles,
        address(pack_geometry, body, angles, angles, row),
        address(state_derivative, model, row, np.empty(6), np.empty(4), falling, falling),
    )


@program
def cost_and_slope(numbers: _Numbers, basis: Array, free: Array, slope: Array) -> float:
    """Cost of the pattern with the free components (n,), and into slope (n,) its derivatives by them."""
    n = len(free)
    direction, probe, values = (
        np.zeros_like(numbers.neutral),
        np.empty_like(numbers.neutral),
        np.empty(2 * n + 1),
    )
    for i in range(n):
        for j in range(len(direction)):
            for k in range(3):
                direction[j, k] += free[i] * basis[i, j, k]
    for i in range(2 * n + 1):
        side = 0.0 if i == 2 * n else (_STEP if i < n else -_STEP)
        for j in range(len(direction)):
            for k in range(3):
                probe[j, k] = direction[j, k] + side * basis[i % n, j, k]
        values[i] = _cost(numbers, probe)
    for i in range(n):
        slope[i] = (values[i] - values[n + i]) / (2.0 * _STEP)
    return values[2 * n]  # type: ignore[no-any-return]


@kernel
def _cost(numbers: _Numbers, direction: Array) -> float:
    geometry, inverse, derivative = np.empty(GEOMETRY_SIZE), np.empty(6), np.empty(STATE_SIZE)
    angles, at_rest = np.empty_like(numbers.neutral), np.zeros(4)
    total, judged = 0.0, len(numbers.judged)
    for i in range(judged + 1):
        # Limbs swing in the neutral posture.
        alpha = numbers.judged[i] if i < judged else 0.0
        for j in range(len(angles)):
            for k in range(3):
                angles[j, k] = numbers.neutral[j, k] + alpha * direction[j, k]
        call(numbers.pack, (numbers.body, angles, direction, geometry))
        if i < judged:
            invert_inertia(geometry, inverse)
            call(numbers.derivative, (numbers.model, geometry, inverse, at_rest, numbers.falling, derivative))
            total -= numbers.weights[i] * derivative[7 + numbers.wanted] / judged
            for j in range(6):
                total += numbers.acceleration_costs[j] * derivative[7 + j] ** 2 / judged
    for j in range(3):
        total += numbers.swing_costs[j] * geometry[SWING_AT + j] ** 2
    return total

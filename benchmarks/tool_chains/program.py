# SPDX-License-Identifier: Apache-2.0
"""The nonlinear program that each tool chain solves at a decision: that of the package's `gauss_newton`.

With y_j the yaw rate after j model steps and U (B, 4) one control per block, in `skydiver_utc/controllers/horizon.py`:
minimise J of U under the controls' bounds and the rate limit of alpha, which moves evenly over a block.
"""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import casadi as ca
import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.horizon import Horizon, HorizonCost, cost_of
from skydiver_utc.controllers.settings import GaussNewtonSettings
from skydiver_utc.parameters import ParameterError, Scenario
from skydiver_utc.plants.protocol import Plant
from skydiver_utc.plants.skydiver.model import PlantModel
from skydiver_utc.plants.skydiver.skydiver import SkydiverPlant
from skydiver_utc.references.protocol import Reference


@dataclass(frozen=True)
class Structure:
    """What is built and compiled once for all costs: the model, N model steps in B blocks."""

    steps: int
    blocks: int
    fingerprint: str
    model: PlantModel = field(compare=False, repr=False)

    @property
    def hold(self) -> int:
        """Model steps in a block."""
        return self.steps // self.blocks


class Program(NamedTuple):
    """A structure with its numbers: control periods in a model step, horizon and costs of the scenario."""

    structure: Structure
    periods: int
    horizon: Horizon
    cost: HorizonCost

    @property
    def minimum(self) -> Array:
        """Least control (4,)."""
        return self.horizon.limits[0]

    @property
    def maximum(self) -> Array:
        """Largest control (4,)."""
        return self.horizon.limits[1]

    @property
    def change(self) -> float:
        """Largest change of alpha from block to block [rad]."""
        return float(self.horizon.limits[2, 3]) * self.horizon.block_periods


class Solution(NamedTuple):
    """A sequence (B, 4), the iterations it took, and whether the solver says that it is one."""

    sequence: Array
    iterations: int
    found: bool


# solve(state (10,), control applied last (4,), reference (N,), sequence to start from (B, 4))
Solve = Callable[[Array, Array, Array, Array], Solution]


def program(scenario: Scenario, plant: Plant, reference: Reference) -> Program:
    """The program of a skydiver's scenario whose controller is of kind gauss_newton and tracks the yaw rate."""
    p = scenario.controller
    if (
        not isinstance(p, GaussNewtonSettings)
        or not isinstance(plant, SkydiverPlant)
        or reference.outputs != ("yaw_rate",)
    ):
        raise ParameterError(
            f"scenario {scenario.name}: the tool chains need controller.kind gauss_newton and a skydiver's yaw rate "
            "to track"
        )
    model = plant.constants
    structure = Structure(p.horizon_steps, p.blocks, _fingerprint(model), model)
    return Program(structure, p.step_periods, Horizon(p, plant, reference.outputs, 1), cost_of(p, plant))


def effort(U: ca.MX, applied: ca.MX, costs: ca.MX) -> ca.MX:
    """The part of J that is a cost on controls U (4, B) and their changes; costs (12,) is `costs_of`."""
    before = ca.horzcat(applied, U[:, :-1])
    control, change, rest = costs[:4], costs[4:8], costs[8:]
    blocks = U.shape[1]
    total = ca.mtimes(control.T, (U - ca.repmat(rest, 1, blocks)) ** 2)
    total += ca.mtimes(change.T, (U - before) ** 2)
    return ca.sum2(total) / blocks


def costs_of(cost: HorizonCost) -> Array:
    """Costs on controls, costs on changes, rest, in a row (12,)."""
    return np.concatenate([cost.control, cost.change, cost.nominal])


def _fingerprint(model: PlantModel) -> str:
    digest = hashlib.sha256()
    for value in model._replace(work=np.empty(0)):  # scratch, different each time
        digest.update(np.asarray(value, dtype=np.float64).tobytes())
    return digest.hexdigest()

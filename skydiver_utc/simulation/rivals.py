"""The controllers that UTC is compared with, bound to the skydiver; `tracked` is where its rate is in the state."""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control.gauss_newton import GaussNewtonController
from skydiver_utc.control.horizon import Horizon, HorizonCost
from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.control.linear_quadratic import Equilibrium, LinearQuadraticController, design
from skydiver_utc.control.path_integral import PathIntegralController, Sampling
from skydiver_utc.parameters import (
    CostParameters,
    GaussNewtonParameters,
    HorizonParameters,
    LqrParameters,
    MppiParameters,
)
from skydiver_utc.plant.model import PlantModel
from skydiver_utc.plant.reduced import REDUCED_SIZE, belly_to_earth, linearised_step, reduced, reduced_rate_at
from skydiver_utc.simulation.rollout import SkydiverRollOut

Array = NDArray[np.float64]


def build_lqr(
    parameters: LqrParameters, model: PlantModel, limits: ControlLimits, initial: Array, tracked: int
) -> LinearQuadraticController:
    """The regulator about the straight fall with the yaw damping at rest."""
    cost = horizon_cost(parameters, limits)
    trim = belly_to_earth(model)
    A, B = linearised_step(model, trim, cost.rest)
    fall = Equilibrium(trim, cost.rest, A, B, np.eye(REDUCED_SIZE)[reduced_rate_at(tracked)])
    gains = design(fall, cost.control, cost.change, parameters.horizon_steps)
    return LinearQuadraticController(reduced, fall, gains, limits, initial)


def build_gauss_newton(
    parameters: GaussNewtonParameters, model: PlantModel, limits: ControlLimits, initial: Array, tracked: int
) -> GaussNewtonController:
    """Gauss-Newton steps on the plant's own prediction."""
    horizon, cost = horizon_of(parameters), horizon_cost(parameters, limits)
    roll_out = SkydiverRollOut(model, horizon, tracked)
    return GaussNewtonController(roll_out, limits, horizon, cost, initial, parameters.iterations)


def build_mppi(
    parameters: MppiParameters,
    model: PlantModel,
    limits: ControlLimits,
    initial: Array,
    tracked: int,
    seed: int,
) -> PathIntegralController:
    """Path integrals over the plant's own prediction."""
    horizon, cost = horizon_of(parameters), horizon_cost(parameters, limits)
    deviation = np.array(parameters.deviations) * (limits.maximum - limits.minimum)
    sampling = Sampling(parameters.samples, deviation, parameters.temperature, seed)
    roll_out = SkydiverRollOut(model, horizon, tracked)
    return PathIntegralController(roll_out, limits, horizon, cost, sampling, initial)


def horizon_of(parameters: HorizonParameters) -> Horizon:
    """The grid of the horizon."""
    return Horizon(parameters.horizon_steps, parameters.blocks, parameters.step_periods)


def horizon_cost(parameters: CostParameters, limits: ControlLimits) -> HorizonCost:
    """Costs per range turned into costs per unit of each control."""
    squared_range = (limits.maximum - limits.minimum) ** 2
    return HorizonCost(
        control=np.array(parameters.control_costs) / squared_range,
        change=np.array(parameters.change_costs) / squared_range,
        rest=np.array(parameters.rest),
    )

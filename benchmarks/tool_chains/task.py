"""The task that each tool chain is given: track the yaw rate over N steps, bounds and slew rate kept."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.parameters import Scenario, UtcParameters
from skydiver_utc.plant.model import PlantModel, build_model

Array = NDArray[np.float64]

# decide(state (10,), control applied now (4,), reference at steps 1 .. N (N,)) -> control (4,)
Decide = Callable[[Array, Array, Array], Array]


@dataclass(frozen=True, eq=False)
class Task:
    """Least squares of the yaw rate's error over P_err and of the controls' changes over their variances in Qu.

    The weights are thus UTC's own; the change of alpha is bounded by its slew rate.
    """

    model: PlantModel
    steps: int
    P_err: float
    change_weights: Array

    @property
    def changes(self) -> Array:
        """Largest change of each control in a step (4,); inf where there is no limit."""
        return np.array([np.inf, np.inf, np.inf, self.model.alpha_slew])


def task(scenario: Scenario) -> Task:
    """The task of a scenario that is flown by UTC."""
    p = scenario.controller
    assert isinstance(p, UtcParameters)
    variances = [p.variance_Cm_damp_yaw, p.variance_k_right, p.variance_k_left, p.variance_alpha]
    return Task(build_model(scenario), p.horizon_steps, p.P_err, 1.0 / (p.Qu_ratio * np.array(variances)))

"""From a scenario to the parts of its closed loop."""

from collections.abc import Iterable

import numpy as np

from skydiver_utc.control.delay import DelayCompensation
from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.control.open_loop import OpenLoop
from skydiver_utc.control.pose import PoseController
from skydiver_utc.control.protocol import Controller
from skydiver_utc.parameters import (
    GaussNewtonParameters,
    LqrParameters,
    MppiParameters,
    OpenLoopParameters,
    PoseControllerParameters,
    Scenario,
    UtcParameters,
    override,
)
from skydiver_utc.plant.model import build_model
from skydiver_utc.plant.skydiver import RATE_AT, SkydiverPlant
from skydiver_utc.reference.profiles import ChangingReference, ReferenceProfile
from skydiver_utc.simulation.flight import ParameterChange
from skydiver_utc.simulation.rivals import build_gauss_newton, build_lqr, build_mppi
from skydiver_utc.simulation.skydiver_utc_controller import SkydiverUtc


def build_plant(scenario: Scenario) -> SkydiverPlant:
    """The skydiver that falls."""
    return SkydiverPlant(scenario)


def build_reference(scenario: Scenario) -> ReferenceProfile:
    """What is wanted: a body rate or the pattern angle."""
    return ReferenceProfile(scenario)


def build_changed_reference(scenario: Scenario, changes: Iterable[ParameterChange]) -> ChangingReference:
    """What was wanted in a flight with these changes, in order of the steps; those of the reference count."""
    reference = ChangingReference(build_reference(scenario))
    for change in changes:
        if change.node == "reference":
            reference.follow(change.step, build_reference(override(scenario, change.of_scenario)))
    return reference


def build_controller(scenario: Scenario, delay_steps: int = 0) -> Controller:
    """The controller that the scenario names, with the plant as its model where it predicts.

    Its commands act `delay_steps` later than they answer: it decides on the state predicted for then.
    """
    controller = _controller(scenario)
    return (
        controller if delay_steps == 0 else DelayCompensation(controller, build_plant(scenario), delay_steps)
    )


def control_limits(scenario: Scenario) -> ControlLimits:
    """Bounds of the controls, and the largest change of alpha in a step."""
    limits = scenario.plant.limits
    slew = np.array([np.inf, np.inf, np.inf, limits.alpha_rate * scenario.dt_s])
    return ControlLimits(np.array(limits.minimum), np.array(limits.maximum), slew)


def _controller(scenario: Scenario) -> Controller:
    limits = control_limits(scenario)
    plant = SkydiverPlant(scenario, build_model(scenario))
    parameters = scenario.controller
    initial = plant.initial_control()
    if isinstance(parameters, OpenLoopParameters):
        return OpenLoop(parameters, limits, initial)
    tracked = RATE_AT[scenario.reference.signal]
    match parameters:
        case PoseControllerParameters():
            return PoseController(parameters, limits, initial, tracked)
        case LqrParameters():
            return build_lqr(parameters, plant.model, limits, initial, tracked)
        case GaussNewtonParameters():
            return build_gauss_newton(parameters, plant.model, limits, initial, tracked)
        case MppiParameters():
            return build_mppi(parameters, plant.model, limits, initial, tracked, scenario.seed)
        case UtcParameters():
            fall_rate = scenario.initial.fall_speed_m_s
            return SkydiverUtc(parameters, plant.model, limits, initial, tracked, fall_rate)

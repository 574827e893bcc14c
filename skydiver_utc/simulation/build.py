"""From a scenario to the parts of its closed loop."""

import numpy as np

from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.control.open_loop import OpenLoop
from skydiver_utc.control.pose import PoseController
from skydiver_utc.control.protocol import Controller
from skydiver_utc.parameters import OpenLoopParameters, PoseControllerParameters, Scenario
from skydiver_utc.plant.model import build_model
from skydiver_utc.plant.skydiver import RATE_AT, SkydiverPlant
from skydiver_utc.reference.profiles import ReferenceProfile
from skydiver_utc.simulation.skydiver_utc_controller import SkydiverUtc


def build_plant(scenario: Scenario) -> SkydiverPlant:
    """The skydiver that falls."""
    return SkydiverPlant(scenario)


def build_reference(scenario: Scenario) -> ReferenceProfile:
    """What is wanted: a body rate or the pattern angle."""
    return ReferenceProfile(scenario)


def build_controller(scenario: Scenario) -> Controller:
    """The controller that the scenario names, with the plant as its model where it predicts."""
    limits = ControlLimits(
        np.array(scenario.plant.limits.minimum),
        np.array(scenario.plant.limits.maximum),
        np.array([np.inf, np.inf, np.inf, scenario.plant.limits.alpha_rate * scenario.dt_s]),
    )
    plant = SkydiverPlant(scenario, build_model(scenario))
    parameters = scenario.controller
    if isinstance(parameters, OpenLoopParameters):
        return OpenLoop(parameters, limits, plant.initial_control())
    tracked = RATE_AT[scenario.reference.signal]
    if isinstance(parameters, PoseControllerParameters):
        return PoseController(parameters, limits, plant.initial_control(), tracked)
    return SkydiverUtc(
        parameters, plant.model, limits, plant.initial_control(), tracked, scenario.initial.fall_speed_m_s
    )

# SPDX-License-Identifier: Apache-2.0
"""From a scenario to the objects in the slots of its closed loop."""

from functools import lru_cache
from typing import Any

import numpy as np

from skydiver_utc.controllers.delay import DelayCompensation
from skydiver_utc.controllers.protocol import Controller
from skydiver_utc.disturbances.composed import Composed
from skydiver_utc.estimators.protocol import Estimator
from skydiver_utc.estimators.sensors import Sensors
from skydiver_utc.parameters import ParameterError, Scenario
from skydiver_utc.parameters.registry import factory
from skydiver_utc.plants.protocol import Plant
from skydiver_utc.references.protocol import Reference


def build_plant(scenario: Scenario) -> Plant:
    """The plant with which controller and estimator predict. Raises `ParameterError`, like all of these functions.

    Equal settings give the same object, which keeps no state: copy it before you change it.
    """
    return _plant(scenario.plant, scenario.dt_s)


def build_true_plant(scenario: Scenario) -> Plant:
    """The plant of the run."""
    return _plant(scenario.true_plant, scenario.dt_s)


@lru_cache(maxsize=8)
def _plant(settings: Any, dt_s: float) -> Plant:
    return _build("plant", settings, dt_s)


def model_beside(true_plant: Plant, scenario: Scenario) -> Plant:
    """The same as `build_plant`; the true plant itself where the scenario's `truth` changes nothing of it."""
    if not scenario.truth.model_extra:
        return true_plant
    model = build_plant(scenario)
    for names in ("state_names", "control_names", "output_names"):
        if getattr(model, names) != getattr(true_plant, names):
            raise ParameterError(f"truth changes the {names.replace('_', ' ')} of the plant: keep them")
    return model


def build_reference(scenario: Scenario) -> Reference:
    """The reference of a scenario."""
    return _build("reference", scenario.reference, scenario.dt_s)


def build_controller(
    scenario: Scenario, plant: Plant, reference: Reference, delay_steps: int = 0
) -> Controller:
    """The controller, with the plant's model where it predicts.

    Its commands act `delay_steps` later than they answer: it decides on the state predicted for then.
    """
    unknown = set(reference.outputs) - set(plant.output_names) - set(plant.control_names)
    if unknown:
        known = ", ".join(plant.output_names)
        raise ParameterError(
            f"the reference is for {', '.join(sorted(unknown))}: the plant has the outputs {known}"
        )
    controller = _build(
        "controller", scenario.controller, plant, reference.outputs, scenario.dt_s, scenario.seed
    )
    return controller if delay_steps == 0 else DelayCompensation(controller, plant, delay_steps)


def build_compiled_controller(
    scenario: Scenario, plant: Plant, reference: Reference, delay_steps: int = 0
) -> Controller:
    """The same; it has decided once, so that no step of a run waits for the compiler."""
    controller = build_controller(scenario, plant, reference, delay_steps)
    preview = reference.preview(0, controller.preview_steps + 1)
    controller.decide(plant.initial_state(), np.ascontiguousarray(preview, dtype=float))
    controller.reset()
    return controller


def preview_steps(scenario: Scenario) -> int:
    """`preview_steps` of the scenario's controller; where its settings or class tell them it is not built."""
    of_settings = getattr(scenario.controller, "preview_steps", None)
    if callable(of_settings):
        return int(of_settings(scenario.dt_s))
    of_class = getattr(factory("controller", scenario.controller.kind), "preview_steps", None)
    if isinstance(of_class, int):
        return of_class
    return build_controller(scenario, build_plant(scenario), build_reference(scenario)).preview_steps


def build_estimator(scenario: Scenario, plant: Plant) -> Estimator:
    """The estimator of a scenario."""
    return _build("estimator", scenario.estimator, plant, scenario.dt_s)


def build_sensors(scenario: Scenario, plant: Plant) -> Sensors | None:
    """The sensors of the plant that its estimator reads; None for one that is given the state."""
    given = getattr(scenario.estimator, "sensors", None)
    if given is None:
        return None
    return _made("estimator", scenario.estimator.kind, Sensors, given, plant, scenario.dt_s, scenario.seed)


def build_disturbances(scenario: Scenario, plant: Plant) -> Composed:
    """The disturbances in the order of the scenario, each with a seed of its own, as one; `plant` is the true one.

    Beside sensors, errors of the measured state are refused: nothing would read it.
    """
    parts = [
        _build("disturbance", settings, plant, scenario.dt_s, (scenario.seed, i))
        # From 1 on: a generator of (seed, 0) is that of the seed alone, which the controller has.
        for i, settings in enumerate(scenario.disturbances, 1)
    ]
    disturbance = Composed(parts, plant, scenario.dt_s)
    if disturbance.changes_measurements and getattr(scenario.estimator, "sensors", None) is not None:
        raise ParameterError(
            "disturbances: the estimator reads sensors and no measured state: give each sensor its noise, bias, delay"
            " and loss"
        )
    return disturbance


def _build(slot: str, settings: Any, *rest: object) -> Any:
    return _made(slot, settings.kind, factory(slot, settings.kind), settings, *rest)


def _made(slot: str, kind: str, make: Any, *given: object) -> Any:
    try:
        return make(*given)
    except ParameterError:
        raise
    except ValueError as error:
        raise ParameterError(f"{slot} {kind}: {error}") from error

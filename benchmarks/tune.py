# SPDX-License-Identifier: Apache-2.0
"""Tune a controller on the fast turn: ``python benchmarks/tune.py CONTROLLER``, the same search for each.

The scenario's skydiver is flown unless ``--skydiver`` names another one.

The first flight has the starting values. Half of the rest are drawn at random, each parameter log-uniform within
FACTOR of its start; the other half are drawn around the best so far, log-normal with a spread that falls by the
flight from a third of the way to FACTOR to a hundredth. Values are rounded to three digits and cut at the
parameter's bounds before they are flown. The objective is the RMSE after 2 s in deg/s, with ROLLED_OVER added for a
body that rolled over and DIVERGED in its place for a flight that did not end. Prints one line per setting that is
better than all before, and the parameters by dotted name, to write into the scenario. The tool chains (extra `bench`)
solve the program of `gauss_newton` and are tuned in its parameters; theirs go into tool_chains/tuned.yaml.
"""

import math
import time
from collections.abc import Iterator
from typing import NamedTuple

import click
import numpy as np
import tool_chains
from random_search import random_search

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.controllers.protocol import Controller
from skydiver_utc.loop.build import build_controller
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.loop.outcome import Outcome
from skydiver_utc.parameters import Scenario, leaves, load_scenario
from skydiver_utc.plants.protocol import Plant
from skydiver_utc.references.protocol import Reference

FACTOR = 30.0
FLIGHTS = 64
ROLLED_OVER, DIVERGED = 100.0, 1000.0
TASK = "fast_turn_pose_only"

Values = dict[str, float | int]  # by dotted name below `controller`; HANDS stands for both hands

HANDS = "hands"
_BOTH = ("k_right", "k_left")


def expanded(values: Values) -> Values:
    """The values with one for each hand."""
    found: Values = {}
    for name, value in values.items():
        parts = name.split(".")
        hands = _BOTH if HANDS in parts else ("",)
        found |= {".".join(hand if part == HANDS else part for part in parts): value for hand in hands}
    return found


def own(scenario: str, *names: str) -> Values:
    """A scenario's own values of its controller."""
    values = {
        leaf.name: leaf.value
        for leaf in leaves(load_scenario(scenario).controller)
        if isinstance(leaf.value, int | float)
    }
    return {name: values[next(iter(expanded({name: 0.0})))] for name in names}


class Subject(NamedTuple):
    """Whose controller is tuned, what of it from which start, and the tool chain that flies, if not the package."""

    scenario: str
    start: Values
    chain: str = ""

    def build(self, scenario: Scenario, plant: Plant, reference: Reference) -> Controller:
        """The controller that flies."""
        if not self.chain:
            return build_controller(scenario, plant, reference)
        from tool_chains.chains import controller_of  # an extra

        return controller_of(self.chain)(scenario, plant, reference)


_COSTS: Values = {
    "nominal.Cm_damp_yaw": 0.5,
    "cost.Cm_damp_yaw": 0.1,
    "cost.hands": 0.1,
    "cost.alpha": 0.01,
    "change_cost.Cm_damp_yaw": 1.0,
    "change_cost.hands": 1.0,
    "change_cost.alpha": 1.0,
}
_SAMPLES: Values = {
    "temperature": 0.01,
    "deviation.Cm_damp_yaw": 0.1,
    "deviation.hands": 0.02,
    "deviation.alpha": 0.03,
}
_POSE: Values = {"K_p": 1.5, "K_FF": 0.1, "Cm_damp_yaw": 0.5}
_UTC = (
    *("Pu.Cm_damp_yaw", "Pu.k_right", "Pu.k_left", "Pu.alpha"),
    *("coupling.k_right", "coupling.k_left", "coupling.alpha"),
    *("Qu_ratio", "P_err", "horizon_steps"),
)
_UNKNOWN, _PI = "fast_turn_unknown_dynamics", "fast_turn_pi_dynamics"
# This must lie inside the limits of the control, and UTC's horizon inside its own.
_DAMPING = "nominal.Cm_damp_yaw"
_HORIZON = (1.0, 500.0)
_HELD = Subject("fast_turn_gauss_newton_held", _COSTS | {"step_periods": 1})
_FIVE = Subject("fast_turn_gauss_newton", _COSTS | {"step_periods": 1})

SUBJECTS: dict[str, Subject] = {
    "pose": Subject(TASK, _POSE),
    "pose_feed_forward": Subject(TASK, _POSE | {"alpha_feed_forward_max": 1.0}),
    "lqr": Subject("fast_turn_lqr", _COSTS | {"horizon_steps": 100}),
    "gauss_newton_held": _HELD,
    "gauss_newton": _FIVE,
    **{f"{chain}_held": _HELD._replace(chain=chain) for chain in tool_chains.NAMES},
    **{chain: _FIVE._replace(chain=chain) for chain in tool_chains.NAMES},
    "mppi": Subject("fast_turn_mppi", _COSTS | {"step_periods": 1} | _SAMPLES),
    "utc_unknown_dynamics": Subject(_UNKNOWN, own(_UNKNOWN, *_UTC)),
    "utc_pi_dynamics": Subject(_PI, own(_PI, *_UTC, "dynamics.K_p", "dynamics.K_FF")),
}


def objective(subject: Subject, scenario: Scenario) -> float:
    """What is to be small: the RMSE of a flight, and what is added for one that went wrong."""
    flown = metrics(simulate(scenario, build=subject.build))
    if flown["outcome"] not in (Outcome.COMPLETED.value, Outcome.ROLLED_OVER.value):
        return DIVERGED
    return float(flown["rmse_deg_s"]) + ROLLED_OVER * (flown["outcome"] == Outcome.ROLLED_OVER.value)


def scenario_of(subject: Subject, values: Values, who: dict[str, object]) -> Scenario:
    """The fast turn with this controller and skydiver."""
    changes = {f"controller.{name}": value for name, value in expanded(values).items()}
    return load_scenario(subject.scenario, {**changes, **who})


def limits_of(scenario: Scenario, name: str) -> tuple[float, float]:
    """Least and largest value of one of the controller's parameters."""
    if name == _DAMPING:
        low, high = scenario.plant.limits.Cm_damp_yaw
        return low, high
    wanted = next(iter(expanded({name: 0.0})))
    (leaf,) = (leaf for leaf in leaves(scenario.controller) if leaf.name == wanted)
    low, high = _HORIZON if name == "horizon_steps" else (-math.inf, math.inf)
    return (
        low if leaf.minimum is None else leaf.minimum,
        high if leaf.maximum is None else leaf.maximum,
    )


def admitted(value: float, start: float | int, limits: tuple[float, float]) -> float | int:
    """A value as it is flown: three digits, whole where the start is, inside the parameter's bounds."""
    value = min(max(float(f"{value:.3g}"), limits[0]), limits[1])
    return round(value) if isinstance(start, int) else value


def search(
    subject: Subject, who: dict[str, object], flights: int, seed: int
) -> Iterator[tuple[Values, float]]:
    """Flown parameters with their objectives."""
    scenario = scenario_of(subject, subject.start, {})
    bounds = {name: limits_of(scenario, name) for name in subject.start}
    names = list(subject.start)
    start = np.log([subject.start[name] for name in names])

    def values(point: np.ndarray) -> Values:
        pairs = zip(names, np.exp(point), strict=True)
        return {n: admitted(v, subject.start[n], bounds[n]) for n, v in pairs}

    def flown(point: np.ndarray) -> float:
        return objective(subject, scenario_of(subject, values(point), who))

    for point, result in random_search(flown, start, math.log(FACTOR), flights, seed):
        yield values(point), result


@click.command(help=__doc__)
@click.argument("controller", type=click.Choice(list(SUBJECTS)))
@click.option("--skydiver", help="Who is flown, as plant.skydiver.")
@click.option("--flights", default=FLIGHTS, show_default=True, help="Flights in all.")
@click.option("--seed", default=1, show_default=True, help="Seed of the search.")
def main(controller: str, skydiver: str | None, flights: int, seed: int) -> None:
    subject, best, began = SUBJECTS[controller], math.inf, time.process_time()
    chosen: Values = subject.start
    who: dict[str, object] = {} if skydiver is None else {"plant.skydiver": skydiver}
    for flight, (values, result) in enumerate(search(subject, who, flights, seed)):
        if result < best:
            best, chosen = result, values
            print(f"# flight {flight}: {result:.4g} deg/s", flush=True)
    of = f" --skydiver {skydiver}" if skydiver else ""
    print(f"# python benchmarks/tune.py {controller} --flights {flights} --seed {seed}{of}")
    print(f"# objective {best:.4g} deg/s, {time.process_time() - began:.0f} s of CPU")
    print("controller:")
    for name, value in expanded(chosen).items():
        print(f"  {name}: {value}")


if __name__ == "__main__":
    main()

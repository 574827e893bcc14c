"""Tune a controller on the fast turn: ``python benchmarks/tune.py CONTROLLER``, the same search for each.

The first flight has the starting values. Half of the rest are drawn at random, each parameter log-uniform within
FACTOR of its start; the other half are drawn around the best so far, log-normal with a spread that falls by the
flight from a third of the way to FACTOR to a hundredth. Values are rounded to three digits and cut at the
parameter's bounds before they are flown. The objective is the RMSE after 2 s in deg/s, with ROLLED_OVER added for a
body that rolled over and DIVERGED in its place for a flight that did not end; with ``--turns all`` one setting
flies every turn of ``sweep.py``, and it is the root mean square of those, each counted as LOST at most. Prints one
line per setting that is better than all before, and the parameters to write into the scenario. The tool chains
(extra `bench`) solve the program of `gauss_newton` and are tuned in its parameters; theirs go into
tool_chains/tuned.yaml.
"""

import math
import time
from collections.abc import Iterator
from typing import NamedTuple

import click
import numpy as np
import tool_chains
from sweep import AMPLITUDES, FREQUENCIES, turn_of

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.control.protocol import Controller
from skydiver_utc.parameters import Leaf, Scenario, UtcParameters, leaves, load_scenario
from skydiver_utc.simulation.build import build_controller
from skydiver_utc.simulation.closed_loop import simulate
from skydiver_utc.simulation.outcome import Outcome

FACTOR = 30.0
FLIGHTS = 64
ROLLED_OVER, DIVERGED = 100.0, 1000.0
LOST = 20.0
TASK = "fast_turn_pose_only"

Values = dict[str, float | int]

_COSTS: Values = {
    "rest_Cm_damp_yaw": 0.5,
    "cost_Cm_damp_yaw": 0.1,
    "cost_hands": 0.1,
    "cost_alpha": 0.01,
    "change_cost_Cm_damp_yaw": 1.0,
    "change_cost_hands": 1.0,
    "change_cost_alpha": 1.0,
}
_POSE: Values = {"K_p": 1.5, "K_FF": 0.1, "Cm_damp_yaw": 0.5}
_UTC: Values = {
    "P_err": 1e-4,
    "Qu_ratio": 0.1,
    "variance_Cm_damp_yaw": 6.25,
    "variance_k_right": 0.01,
    "variance_k_left": 0.01,
    "variance_alpha": 0.01,
    "covariance_12": 0.74,
    "covariance_13": 0.74,
    "covariance_14": 0.56,
}
_BEYOND = load_scenario("fast_turn_beyond_the_paper").controller
_BEYOND_TUNED = (
    *_UTC,
    "horizon_steps",
    "k_hyst_s",
    "full_coupling_acceleration",
    "rest_Cm_damp_yaw",
    "P_rest_Cm_damp_yaw",
    "P_rest_hands",
)


class Subject(NamedTuple):
    """What is held, what is tuned from which start, and the tool chain that flies, where it is not the package."""

    held: dict[str, object]
    start: Values
    chain: str = ""

    def build(self, scenario: Scenario) -> Controller:
        """The controller that flies."""
        if not self.chain:
            return build_controller(scenario)
        from tool_chains.chains import controller_of  # an extra

        return controller_of(self.chain)(scenario)


_HELD = Subject({"kind": "gauss_newton", "horizon_steps": 20, "blocks": 1}, _COSTS | {"step_periods": 1})
_FIVE = Subject({"kind": "gauss_newton", "horizon_steps": 20, "blocks": 5}, _COSTS | {"step_periods": 1})

SUBJECTS: dict[str, Subject] = {
    "pose": Subject({"kind": "pose"}, _POSE),
    "pose_feed_forward": Subject({"kind": "pose"}, _POSE | {"alpha_feed_forward_max": 1.0}),
    "lqr": Subject({"kind": "lqr"}, _COSTS | {"horizon_steps": 100}),
    "gauss_newton_held": _HELD,
    "gauss_newton": _FIVE,
    **{f"{chain}_held": _HELD._replace(chain=chain) for chain in tool_chains.NAMES},
    **{chain: _FIVE._replace(chain=chain) for chain in tool_chains.NAMES},
    "mppi": Subject(
        {"kind": "mppi", "horizon_steps": 20, "blocks": 5, "samples": 64},
        _COSTS
        | {
            "step_periods": 1,
            "temperature": 0.01,
            "deviation_Cm_damp_yaw": 0.1,
            "deviation_hands": 0.02,
            "deviation_alpha": 0.03,
        },
    ),
    "utc_unknown_dynamics": Subject(
        {"kind": "utc", "alpha_dynamics": "unknown", "saved_control_reading": "drawn"},
        _UTC | {"horizon_steps": 20},
    ),
    "utc_pi_dynamics": Subject(
        {"kind": "utc", "alpha_dynamics": "incremental", "saved_control_reading": "first_step"},
        _UTC | {"horizon_steps": 5, "K_p": 1.5, "K_FF": 0.1},
    ),
    "utc_beyond_the_paper": Subject(
        {"kind": "utc", **{name: getattr(_BEYOND, name) for name in ("aim", "W0")}},
        {name: getattr(_BEYOND, name) for name in _BEYOND_TUNED},
    ),
}


TURNS: dict[str, list[Values]] = {
    "fast": [{}],
    "all": [turn_of(amplitude, frequency) for amplitude in AMPLITUDES for frequency in FREQUENCIES],
}


def objective(subject: Subject, values: Values, turns: list[Values]) -> float:
    """What is to be small."""
    errors = [error(subject, scenario_of(subject, values, turn)) for turn in turns]
    if len(turns) == 1:
        return errors[0]
    return math.sqrt(sum(min(one, LOST) ** 2 for one in errors) / len(errors))


def error(subject: Subject, scenario: Scenario) -> float:
    """RMSE of one flight, and what is added for one that went wrong."""
    flown = metrics(simulate(scenario, build=subject.build))
    if flown["outcome"] not in (Outcome.COMPLETED.value, Outcome.ROLLED_OVER.value):
        return DIVERGED
    return float(flown["rmse_deg_s"]) + ROLLED_OVER * (flown["outcome"] == Outcome.ROLLED_OVER.value)


def scenario_of(subject: Subject, values: Values, turn: Values) -> Scenario:
    """The fast turn with this controller, or another turn."""
    return load_scenario(TASK, {"controller": subject.held | values, **turn})


def admitted(value: float, start: float | int, leaf: Leaf) -> float | int:
    """A value as it is flown: three digits, whole where the start is, inside the parameter's bounds."""
    value = float(f"{value:.3g}")
    if leaf.minimum is not None:
        value = max(value, leaf.minimum)
    if leaf.maximum is not None:
        value = min(value, leaf.maximum)
    return round(value) if isinstance(start, int) else value


def search(subject: Subject, turns: list[Values], flights: int, seed: int) -> Iterator[tuple[Values, float]]:
    """Flown parameters with their objectives."""
    generator = np.random.default_rng(seed)
    scenario = scenario_of(subject, subject.start, {})
    bounds = {leaf.name: leaf for leaf in leaves(scenario)}
    if isinstance(scenario.controller, UtcParameters):
        # A rest that cannot be reached is refused.
        rest, (low, high) = "controller.rest_Cm_damp_yaw", scenario.plant.limits.Cm_damp_yaw
        bounds[rest] = bounds[rest]._replace(minimum=low, maximum=high)
    names = list(subject.start)
    start = np.log([subject.start[name] for name in names])
    reach = math.log(FACTOR)

    def values(point: np.ndarray) -> Values:
        pairs = zip(names, np.exp(point), strict=True)
        return {n: admitted(v, subject.start[n], bounds[f"controller.{n}"]) for n, v in pairs}

    best_point, best = start, math.inf
    random = 1 + (flights - 1) // 2
    for flight in range(flights):
        if flight == 0:
            point = start
        elif flight < random:
            point = start + generator.uniform(-reach, reach, len(names))
        else:
            spread = reach / 3.0 * 0.03 ** ((flight - random) / max(1, flights - random - 1))
            point = best_point + spread * generator.standard_normal(len(names))
        tried = values(point)
        result = objective(subject, tried, turns)
        if result < best:
            best_point, best = point, result
        yield tried, result


@click.command(help=__doc__)
@click.argument("controller", type=click.Choice(list(SUBJECTS)))
@click.option(
    "--turns", default="fast", show_default=True, type=click.Choice(list(TURNS)), help="What is flown."
)
@click.option("--flights", default=FLIGHTS, show_default=True, help="Flights in all.")
@click.option("--seed", default=1, show_default=True, help="Seed of the search.")
def main(controller: str, turns: str, flights: int, seed: int) -> None:
    subject, best, began = SUBJECTS[controller], math.inf, time.process_time()
    chosen = subject.start
    for flight, (values, result) in enumerate(search(subject, TURNS[turns], flights, seed)):
        if result < best:
            best, chosen = result, values
            print(f"# flight {flight}: {result:.4g} deg/s", flush=True)
    print(f"# python benchmarks/tune.py {controller} --turns {turns} --flights {flights} --seed {seed}")
    print(f"# objective {best:.4g} deg/s, {time.process_time() - began:.0f} s of CPU")
    print("controller:")
    for name, value in {**subject.held, **chosen}.items():
        print(f"  {name}: {value}")


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""The tool chains that fly, by name, and the costs that they were tuned to (`tuned.yaml`)."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from tune import TASK

from skydiver_utc.controllers.protocol import Controller
from skydiver_utc.loop.closed_loop import Build
from skydiver_utc.parameters import ParameterError, Scenario, load_scenario
from skydiver_utc.parameters.yaml_io import read_yaml
from skydiver_utc.plants.protocol import Plant
from skydiver_utc.references.protocol import Reference
from tool_chains import NAMES
from tool_chains.controller import ToolChainController
from tool_chains.ipopt import solve_by_ipopt
from tool_chains.program import Program, Solve, program
from tool_chains.real_time import solve_by_osqp
from tool_chains.with_do_mpc import solve_by_do_mpc

CHAINS: dict[str, Callable[[Program], Solve]] = dict(
    zip(NAMES, (solve_by_ipopt, solve_by_do_mpc, solve_by_osqp), strict=True)
)
_TUNED = Path(__file__).with_name("tuned.yaml")


class Tuned(NamedTuple):
    """A tool chain and the scenario that it flies."""

    chain: str
    scenario: Scenario


def controller_of(chain: str) -> Build:
    """What builds the controller of a scenario by a tool chain."""
    return controller_by(CHAINS[chain])


def controller_by(solver: Callable[[Program], Solve]) -> Build:
    """What builds the controller of a scenario by anything that solves its program."""

    def build(scenario: Scenario, plant: Plant, reference: Reference) -> Controller:
        wanted = program(scenario, plant, reference)
        return ToolChainController(wanted, solver(wanted), plant.initial_control())

    return build


def tuned(changes: dict[str, object] | None = None) -> dict[str, Tuned]:
    """All of `tuned.yaml` on the fast turn, checked as scenarios are, with other values under dotted names."""
    found = {}
    for name, entry in read_yaml(_TUNED).items():
        chain = entry.get("chain")
        if chain not in CHAINS or set(entry) != {"chain", "controller"}:
            raise ParameterError(
                f"{name} in {_TUNED.name} must hold a chain, one of {', '.join(CHAINS)}, and a controller"
            )
        controller = {"kind": "gauss_newton", **entry["controller"]}
        found[name] = Tuned(chain, load_scenario(TASK, {"controller": controller, **(changes or {})}))
    return found

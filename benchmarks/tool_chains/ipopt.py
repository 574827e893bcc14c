# SPDX-License-Identifier: Apache-2.0
"""CasADi and IPOPT: as most people write it, and as fast as we can set it up. Both solve to convergence."""

from functools import lru_cache

import casadi as ca
import numpy as np

from tool_chains.model import STATES, step
from tool_chains.program import Array, Program, Solution, Solve, Structure, costs_of, effort
from tool_chains.roll_out import held_control, linearised, roll_out

_QUIET = {"print_level": 0, "sb": "yes"}
# From the sequence before, so that the barrier may start low and the point near its bounds.
WARM = {"mu_init": 1e-6, "warm_start_init_point": "yes", "bound_push": 1e-6, "bound_frac": 1e-6}
_MOST_ITERATIONS = 100
TOLERANCE = 1e-6


def solve_by_ipopt(program: Program) -> Solve:
    """Single shooting: the sequence alone is variable, in shares of its ranges; functions compiled from C.

    Hessian by Gauss and Newton, which leaves the minimum where it is and costs no more than the gradient.
    """
    solver = _single_shooting(program.structure)
    minimum, width = program.minimum, program.maximum - program.minimum
    blocks = program.structure.blocks
    costs = np.append(costs_of(program.cost), program.periods)
    change = np.full(blocks, program.change)

    def solve(state: Array, now: Array, reference: Array, start: Array) -> Solution:
        held = np.append(now[3], np.zeros(blocks - 1))
        result = solver(
            x0=((start - minimum) / width).ravel(), lbx=0.0, ubx=1.0, lbg=held - change, ubg=held + change,
            p=np.concatenate([state, now, reference, costs, minimum, width]),
        )  # fmt: skip
        stats = solver.stats()
        shares = np.array(result["x"]).reshape(blocks, 4)
        return Solution(minimum + shares * width, int(stats["iter_count"]), bool(stats["success"]))

    return solve


@lru_cache(maxsize=8)
def _single_shooting(structure: Structure) -> ca.Function:
    blocks, steps = structure.blocks, structure.steps
    shares = ca.MX.sym("shares", 4 * blocks)
    given = ca.MX.sym("given", STATES + 4 + steps + 12 + 1 + 8)
    state, applied, reference, costs, periods, minimum, width = ca.vertsplit(
        given, np.cumsum([0, STATES, 4, steps, 12, 1, 4, 4]).tolist()
    )
    scale = ca.repmat(width, blocks, 1)
    U = ca.reshape(ca.repmat(minimum, blocks, 1) + shares * scale, 4, blocks)
    error = roll_out(structure)(state, applied, U, periods) - reference
    on_control = effort(U, applied, costs)
    cost = ca.sumsqr(error) / steps + on_control
    changes = (U[3, :] - ca.horzcat(0.0, U[3, :-1])).T
    rates, by_control = linearised(structure)(state, applied, U, periods)
    by_share = by_control * ca.repmat(scale.T, steps, 1)
    curvature, slope = ca.hessian(on_control, shares)
    gradient = 2.0 / steps * ca.mtimes(by_share.T, rates - reference) + slope
    hessian = 2.0 / steps * ca.mtimes(by_share.T, by_share) + curvature
    on_cost, on_changes = ca.MX.sym("on_cost"), ca.MX.sym("on_changes", blocks)
    same_cost = ca.sumsqr(rates - reference) / steps + on_control
    options = {
        "print_time": False,
        "show_eval_warnings": False,
        "calc_lam_p": False,
        "no_nlp_grad": True,
        "grad_f": ca.Function("grad_f", [shares, given], [same_cost, gradient]),
        "hess_lag": ca.Function("hess_lag", [shares, given, on_cost, on_changes], [ca.triu(on_cost * hessian)]),
    }  # fmt: skip
    ipopt = _QUIET | WARM | {"max_iter": _MOST_ITERATIONS, "tol": TOLERANCE}
    nlp = {"x": shares, "p": given, "f": cost, "g": changes}
    return ca.nlpsol("single_shooting", "ipopt", nlp, options | {f"ipopt.{k}": v for k, v in ipopt.items()})


def solve_by_opti(program: Program, expand: bool = False) -> Solve:
    """As most people write it: Opti, multiple shooting; `expand` writes it out in scalars."""
    structure, periods = program.structure, program.periods
    steps, hold, blocks = structure.steps, structure.hold, structure.blocks
    follow = step(structure.model)
    opti = ca.Opti()
    x, u = opti.variable(STATES, steps + 1), opti.variable(4, blocks)
    start, applied, wanted = opti.parameter(STATES), opti.parameter(4), opti.parameter(steps)
    opti.subject_to(x[:, 0] == start)
    for j in range(steps):
        b, inside = divmod(j, hold)
        before = applied if b == 0 else u[:, b - 1]
        held = held_control(u[:, b], before[3], inside, hold, periods)
        opti.subject_to(x[:, j + 1] == follow(x[:, j], held, structure.model.dt * periods))
        if inside == 0:
            opti.subject_to(opti.bounded(program.minimum, u[:, b], program.maximum))
            opti.subject_to(opti.bounded(-program.change, u[3, b] - before[3], program.change))
    tracking = ca.sumsqr(x[STATES - 1, 1:].T - wanted) / steps
    opti.minimize(tracking + effort(u, applied, ca.DM(costs_of(program.cost))))
    opti.solver("ipopt", {"print_time": False, "expand": expand}, _QUIET)
    warm = False

    def solve(state: Array, now: Array, reference: Array, sequence: Array) -> Solution:
        nonlocal warm
        opti.set_value(start, state)
        opti.set_value(applied, now)
        opti.set_value(wanted, reference)
        opti.set_initial(u, sequence.T)
        if not warm:
            opti.set_initial(x, np.repeat(state[:, None], steps + 1, axis=1))
        try:
            found = opti.solve()
        except RuntimeError:  # Opti's only word for what IPOPT could not solve
            warm = False
            return Solution(sequence, 0, False)
        iterations = int(opti.stats()["iter_count"])
        opti.set_initial(x, found.value(x))
        warm = True
        return Solution(np.array(found.value(u)).reshape(4, blocks).T, iterations, True)

    return solve

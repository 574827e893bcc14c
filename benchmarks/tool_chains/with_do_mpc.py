# SPDX-License-Identifier: Apache-2.0
"""do-mpc with one of its stages for each block: multiple shooting, IPOPT inside, solved to convergence."""

import warnings
from functools import lru_cache

import casadi as ca
import numpy as np

from tool_chains.ipopt import WARM
from tool_chains.model import STATES
from tool_chains.program import Array, Program, Solution, Solve, Structure, costs_of, effort
from tool_chains.roll_out import block, library_of

with warnings.catch_warnings():
    warnings.simplefilter("ignore", UserWarning)  # of extras that nothing here uses
    import do_mpc

_QUIET = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": 0}
# IPOPT's quasi-Newton: second derivatives of the model take longer than the iterations that they save.
_COMPILED = {"ipopt.hessian_approximation": "limited-memory"} | {f"ipopt.{k}": v for k, v in WARM.items()}


def solve_by_do_mpc(program: Program, compiled: bool = True) -> Solve:
    """With its functions compiled from C, or as its documentation shows."""
    stages, me = _stages(program.structure, compiled), object()
    numbers = np.concatenate([costs_of(program.cost), [program.periods, program.change]])

    def solve(state: Array, now: Array, reference: Array, start: Array) -> Solution:
        return stages.solve(me, numbers, state, now, reference, start)

    return solve


@lru_cache(maxsize=8)
def _stages(structure: Structure, compiled: bool) -> "_Stages":
    return _Stages(structure, compiled)


class _Stages:
    """An MPC of do-mpc, set up once; who asks for a solution brings the numbers, a newcomer starts afresh.

    The control before and the yaw rates of the block before are states of their own, so that the cost of a stage
    is a sum of squares of states and controls.
    """

    def __init__(self, structure: Structure, compiled: bool) -> None:
        self._blocks, self._hold = structure.blocks, structure.hold
        self._wanted, self._numbers = np.zeros((structure.blocks + 1, structure.hold)), np.zeros(14)
        self._asked_by: object = None
        model = do_mpc.model.Model("discrete", "MX" if compiled else "SX")
        x = model.set_variable("_x", "x", (STATES, 1))
        before = model.set_variable("_x", "before", (4, 1))
        model.set_variable("_x", "rates", (structure.hold, 1))
        u = model.set_variable("_u", "u", (4, 1))
        model.set_variable("_tvp", "wanted", (structure.hold, 1))
        numbers = model.set_variable("_p", "numbers", (14, 1))
        after, inside = block(structure)(x, before[3], u, numbers[12])
        model.set_rhs("x", after)
        model.set_rhs("before", u)
        model.set_rhs("rates", inside)
        model.setup()
        self._mpc = mpc = do_mpc.controller.MPC(model)
        mpc.settings.n_horizon = structure.blocks
        mpc.settings.t_step = structure.model.dt
        mpc.settings.store_full_solution = False
        mpc.settings.nlpsol_opts = _QUIET | (_COMPILED if compiled else {})
        u, before = model.u["u"], model.x["before"]
        costs, change = model.p["numbers"][:12], model.p["numbers"][13]
        error = ca.sumsqr(model.x["rates"] - model.tvp["wanted"]) / structure.steps
        mpc.set_objective(mterm=error, lterm=error + effort(u, before, costs) / structure.blocks)
        mpc.bounds["lower", "_u", "u"] = structure.model.control_min
        mpc.bounds["upper", "_u", "u"] = structure.model.control_max
        mpc.set_nl_cons("up", u[3] - before[3] - change, ub=0.0)
        mpc.set_nl_cons("down", before[3] - u[3] - change, ub=0.0)
        mpc.set_tvp_fun(self._tvp(mpc.get_tvp_template()))
        mpc.set_p_fun(self._p(mpc.get_p_template(1)))
        mpc.setup()
        if compiled:
            _compile(mpc)

    def solve(
        self, asker: object, numbers: Array, state: Array, now: Array, reference: Array, start: Array
    ) -> Solution:
        """See `Solve`; it takes the first start alone, and then starts from its own last solution."""
        mpc = self._mpc
        self._wanted[1:] = reference.reshape(self._blocks, self._hold)
        self._numbers[:] = numbers
        whole = np.concatenate([state, now, np.zeros(self._hold)])[:, None]
        if self._asked_by is not asker:
            self._start(whole, start)
            self._asked_by = asker
        mpc.make_step(whole)
        sequence = np.array([np.asarray(mpc.opt_x_num["_u", b, 0]).ravel() for b in range(self._blocks)])
        found = bool(mpc.solver_stats["success"])
        if not found:
            self._asked_by = None
        return Solution(sequence, int(mpc.solver_stats["iter_count"]), found)

    def _start(self, whole: Array, start: Array) -> None:
        mpc = self._mpc
        mpc.reset_history()
        mpc.x0, mpc.u0 = whole, start[0][:, None]
        mpc.set_initial_guess()
        mpc.flags["initial_run"] = False

    def _tvp(self, template):
        def now(_time: float):
            for b in range(self._blocks + 1):
                template["_tvp", b, "wanted"] = self._wanted[b]
            return template

        return now

    def _p(self, template):
        def now(_time: float):
            template["_p", 0] = self._numbers
            return template

        return now


def _compile(mpc: do_mpc.controller.MPC) -> None:
    """What do-mpc's `compile_nlp` does, with other flags, without its prints, and with no files left."""
    functions = [mpc.S.oracle(), *(mpc.S.get_function(name) for name in mpc.S.get_function())]
    with library_of("nlp", functions) as library:
        mpc.S = ca.nlpsol("compiled", "ipopt", library, mpc.settings.nlpsol_opts)

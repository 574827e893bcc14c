"""do-mpc with a discrete model, as its documentation shows."""

import casadi as ca
import do_mpc
import numpy as np

from tool_chains.model import STATES, step
from tool_chains.task import Array, Decide, Task


def decide_by_do_mpc(task: Task) -> Decide:
    """A nonlinear program by do-mpc (CasADi and IPOPT inside); the control before is a state of its own."""
    plant = do_mpc.model.Model("discrete")
    x = plant.set_variable("_x", "x", (STATES, 1))
    before = plant.set_variable("_x", "before", (4, 1))
    u = plant.set_variable("_u", "u", (4, 1))
    wanted = plant.set_variable("_tvp", "wanted")
    plant.set_rhs("x", step(task.model)(x, u))
    plant.set_rhs("before", u)
    plant.setup()
    mpc = do_mpc.controller.MPC(plant)
    mpc.settings.n_horizon = task.steps
    mpc.settings.t_step = task.model.dt
    mpc.settings.store_full_solution = False
    mpc.settings.nlpsol_opts = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": 0}
    error = (x[STATES - 1] - wanted) ** 2 / task.P_err
    change = ca.dot(task.change_weights, (u - before) ** 2)
    mpc.set_objective(mterm=error, lterm=error + change)
    mpc.bounds["lower", "_u", "u"] = task.model.control_min
    mpc.bounds["upper", "_u", "u"] = task.model.control_max
    mpc.set_nl_cons("slew_up", u[3] - before[3], ub=task.model.alpha_slew)
    mpc.set_nl_cons("slew_down", before[3] - u[3], ub=task.model.alpha_slew)
    template, given = mpc.get_tvp_template(), np.zeros(task.steps + 1)

    def reference_now(_time: float) -> object:
        for k in range(task.steps + 1):
            template["_tvp", k, "wanted"] = given[k]
        return template

    mpc.set_tvp_fun(reference_now)
    mpc.setup()
    started = False

    def decide(state: Array, now: Array, reference: Array) -> Array:
        nonlocal started
        given[0], given[1:] = state[STATES - 1], reference
        whole = np.concatenate([state, now])[:, None]
        if not started:
            mpc.x0, mpc.u0 = whole, now[:, None]
            mpc.set_initial_guess()
            started = True
        return np.asarray(mpc.make_step(whole)).ravel()

    return decide

"""CasADi and IPOPT as most people write it: Opti, multiple shooting, warm start by the solution before."""

import casadi as ca
import numpy as np

from tool_chains.model import STATES, step
from tool_chains.task import Array, Decide, Task


def decide_by_ipopt(task: Task, expand: bool = False) -> Decide:
    """A nonlinear program solved to convergence at each step; `expand` writes it out in scalars."""
    steps, model, follow = task.steps, task.model, step(task.model)
    opti = ca.Opti()
    x, u = opti.variable(STATES, steps + 1), opti.variable(4, steps)
    start, applied, wanted = opti.parameter(STATES), opti.parameter(4), opti.parameter(steps)
    cost = 0
    opti.subject_to(x[:, 0] == start)
    for k in range(steps):
        opti.subject_to(x[:, k + 1] == follow(x[:, k], u[:, k]))
        change = u[:, k] - (applied if k == 0 else u[:, k - 1])
        cost += (x[STATES - 1, k + 1] - wanted[k]) ** 2 / task.P_err
        cost += ca.dot(task.change_weights, change**2)
        opti.subject_to(opti.bounded(model.control_min, u[:, k], model.control_max))
        opti.subject_to(opti.bounded(-model.alpha_slew, change[3], model.alpha_slew))
    opti.minimize(cost)
    opti.solver("ipopt", {"print_time": False, "expand": expand}, {"print_level": 0, "sb": "yes"})
    warm = False

    def decide(state: Array, now: Array, reference: Array) -> Array:
        nonlocal warm
        opti.set_value(start, state)
        opti.set_value(applied, now)
        opti.set_value(wanted, reference)
        if not warm:
            opti.set_initial(x, np.repeat(state[:, None], steps + 1, axis=1))
            opti.set_initial(u, np.repeat(now[:, None], steps, axis=1))
        solution = opti.solve()
        opti.set_initial(solution.value_variables())
        warm = True
        return np.array(solution.value(u)).reshape(4, steps)[:, 0]

    return decide

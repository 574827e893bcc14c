# SPDX-License-Identifier: Apache-2.0
"""The actuators of the skydiver: bounds of the control, and the limbs on their way to a pattern angle."""

import math
from typing import NamedTuple

from skydiver_utc.arrays import Array
from skydiver_utc.jit import call, unfused


class Advance(NamedTuple):
    """Numbers of a step with the actuators in it.

    limits (2, 4) of the control; limbs (3,): step [s], largest change of alpha in a step [rad], largest acceleration of
    alpha [rad/s2]; without reaction alpha has no inertia
    step, model: addresses of the model's step and of its numbers; control (10,): scratch
    """

    limits: Array
    limbs: Array
    reaction: bool
    step: int
    model: int
    control: Array


@unfused
def advanced(state: Array, before: Array, command: Array, p: Advance, out: Array) -> None:
    """Write state (13,) and actuators (5,) one step later, under a command (4,)."""
    after = out[13:]
    actuated(command, before, p.limits, p.limbs, p.reaction, after)
    for i in range(len(before)):
        p.control[i], p.control[5 + i] = after[i], before[i]
    call(p.step, (state, p.control if p.reaction else p.control[:4], p.model, out))


@unfused
def actuated(
    command: Array, before: Array, limits: Array, limbs: Array, reaction: bool, after: Array
) -> None:
    """Write the actuators' next state (5,), control and rate of alpha [rad/s], under a command (4,): eq:lim.

    With reaction the rate changes evenly over the step, to the largest from which the rest can still be braked; the
    last steps halve the distance and then stop.
    """
    for c in range(len(command)):
        after[c] = min(max(command[c], limits[0, c]), limits[1, c])
    target, alpha, rate = after[3], before[3], before[4]
    dt, slew, most = limbs[0], limbs[1], limbs[2]
    if not reaction:
        after[3], after[4] = min(max(target, alpha - slew), alpha + slew), 0.0
        return
    distance = target - alpha - 0.5 * dt * rate
    braking = most * (math.sqrt(0.25 * dt * dt + 2.0 * abs(distance) / most) - 0.5 * dt)
    wanted = math.copysign(min(min(braking, abs(distance) / dt), slew / dt), distance)
    rate_after = min(max(wanted, rate - most * dt), rate + most * dt)
    reached = alpha + 0.5 * dt * (rate + rate_after)
    low, high = limits[0, 3], limits[1, 3]
    if not low <= reached <= high:
        reached = min(max(reached, low), high)
        rate_after = 2.0 * (reached - alpha) / dt - rate
    after[3], after[4] = reached, rate_after

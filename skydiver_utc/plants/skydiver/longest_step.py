# SPDX-License-Identifier: Apache-2.0
"""The longest step for which the integrator is stable, from the fastest damping that a skydiver can have."""

from typing import NamedTuple

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.plants.protocol import Model
from skydiver_utc.rotations import world_up

# Classical Runge-Kutta is stable to 2.785 on the negative real axis (Hairer and Wanner, Solving Ordinary Differential
# Equations II, IV.2). A seventh less, for falls that are faster than the straight one.
LARGEST_RATE_TIMES_STEP = 2.4
_AXES = ("roll", "pitch", "yaw")
# At most so many pattern angles are looked at.
_ALPHAS = 33
# Of the differences: speed [m/s], step [s].
_SPEED, _STEP_S = 50.0, 1e-6


class FastestDamping(NamedTuple):
    """The body axis whose rate is damped fastest, and how fast [1/s]."""

    axis: str
    rate: float

    def refuse_longer(self, dt_s: float) -> None:
        """Raise ValueError for a step [s] that the integrator does not take; the longest is rounded down."""
        if self.rate * dt_s > LARGEST_RATE_TIMES_STEP:
            longest = LARGEST_RATE_TIMES_STEP / self.rate
            unit = 10.0 ** (np.floor(np.log10(longest)) - 2)
            raise ValueError(
                f"dt = {dt_s:g} s is too long for the integrator: {self.axis} damping of {self.rate:.0f} 1/s needs"
                f" dt <= {np.floor(longest / unit) * unit:.3g} s"
            )


def fastest_damping(model: Model, initial: Array, alpha: float) -> FastestDamping:
    """Over the pattern angles, at the upper limit of Cm_damp_yaw, in the fall of an initial state (13,).

    Damping is proportional to the speed, here the initial or the terminal one, whichever is larger; the latter in the
    initial attitude and posture [rad], with the hands at the limits that pull down most.
    """
    constants = model.parameters._replace(dt=_STEP_S, work=np.full_like(model.parameters.work, np.nan))
    low, high = constants.control_min, constants.control_max
    step = model._replace(parameters=constants).bound(len(high), 4).step
    down = -world_up(initial)

    def accelerations(speed: float, rates: Array, controls: Array) -> Array:
        """Linear and angular ones (K, 6) in body axes, falling straight down with body rates (K, 3)."""
        states, following = np.tile(initial, (len(rates), 1)), np.empty((len(rates), len(initial)))
        states[:, 7:10], states[:, 10:13] = speed * down, rates
        for each in zip(states, controls, following, strict=True):
            step(*each)
        changed: Array = following[:, 7:] - states[:, 7:]
        return changed / _STEP_S

    # From 1 rad/s about each axis to its opposite, at each pattern angle.
    rates = np.tile(np.eye(3), (_ALPHAS, 1))
    held = np.zeros((len(rates), 4))
    held[:, 0], held[:, 3] = high[0], np.repeat(np.linspace(low[3], high[3], _ALPHAS), 3)
    changes = accelerations(_SPEED, rates, held) - accelerations(_SPEED, -rates, held)
    # The speed at which the drag, which grows with its square, is the pull.
    hands = np.array([[high[0], *most, alpha] for most in (low[1:3], high[1:3])])
    pull, net = (accelerations(speed, np.zeros((2, 3)), hands)[:, :3] @ down for speed in (0.0, _SPEED))
    terminal_speeds = _SPEED * np.sqrt(np.maximum(pull, 0.0) / (pull - net))
    changes = changes.reshape(_ALPHAS, 3, 6)
    values, vectors = np.linalg.eig(changes[:, :, 3:].transpose(0, 2, 1) / 2.0)
    fastest, i = np.unravel_index(np.argmax(np.abs(values)), values.shape)
    axis = _AXES[int(np.argmax(np.abs(vectors[fastest, :, i])))]
    speed = max(float(np.linalg.norm(initial[7:10])), *map(float, terminal_speeds))
    return FastestDamping(axis, float(np.abs(values[fastest, i])) * speed / _SPEED)

# SPDX-License-Identifier: Apache-2.0
"""Delay compensation around any controller: decide on the state predicted for when the command will act."""

from collections import deque

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.protocol import Controller, Decision
from skydiver_utc.plants.protocol import Plant


class DelayCompensation:
    """A controller whose command for the state at k acts from t_k+d on, d = `delay_steps`.

    The d commands decided before are those that act on [t_k, t_k+d): the model is driven by them from the state at
    k to k+d, and the inner controller decides there, with the reference from k+d on.
    """

    def __init__(self, inner: Controller, model: Plant, delay_steps: int) -> None:
        self._inner = inner
        self._model = model
        self._delay = delay_steps
        self._m = len(model.control_names)
        self.preview_steps = inner.preview_steps + delay_steps
        self.telemetry_names = inner.telemetry_names
        self._held: Array  # what the actuators hold before step k
        self._pending: deque[Array]  # commands for the steps k .. k+d-1
        self.reset()

    def reset(self) -> None:
        """Start again: the initial control acts until the first command does."""
        self._inner.reset()
        self._begin(self._model.initial_applied())

    def resume(self, control: Array) -> None:
        """Continue a run in which this control (m,) acts, its actuators at rest."""
        self._inner.resume(control)
        held = self._model.initial_applied()
        held[: len(control)] = control
        held[len(control) :] = 0.0
        self._begin(held)

    def decide(self, state: Array, preview: Array) -> Decision:
        """Decide at k + d; `preview` begins at k."""
        decision = self._inner.decide(self._ahead(state), preview[self._delay :])
        self._held = self._model.actuate(self._pending.popleft(), self._held)
        self._pending.append(decision.control.copy())
        return decision

    def _begin(self, held: Array) -> None:
        self._held = held
        self._pending = deque([held[: self._m].copy()] * self._delay)

    def _ahead(self, state: Array) -> Array:
        held = self._held
        for command in self._pending:
            state, held = self._model.advance(state, held, command)
        return state

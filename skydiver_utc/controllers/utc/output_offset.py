# SPDX-License-Identifier: Apache-2.0
"""Offset-free tracking: how far the plant's outputs are from those that the model predicts."""

from collections import deque

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.utc.horizon_outputs import HorizonOutputs
from skydiver_utc.plants.protocol import LEFT_ITS_DOMAIN, Plant


class OutputOffset:
    """Compares the measured outputs with the model's, driven from N steps ago by the controls decided since then.

    A model without error leaves it at zero, whatever the controls do.

    of: the outputs; steps (T,): where on the horizon they are taken; share of a difference that is taken up in a step
    value (L,): the offset, written in place
    past: the states measured and the controls decided at them since the start of the last horizon
    """

    def __init__(
        self, plant: Plant, of: HorizonOutputs, steps: tuple[int, ...], share: float, value: Array
    ) -> None:
        self._plant, self._of, self._steps = plant, of, steps
        self._share, self.value, self._size = share, value, of.size
        self.past: deque[tuple[Array, Array]] = deque(maxlen=steps[-1])

    def reset(self) -> None:
        """Forget what was measured."""
        self.past.clear()
        self.value[:] = 0.0

    def measure(self, state: Array) -> None:
        """Take up a measured state (n,), if it lies a horizon after the first one known."""
        if len(self.past) == self._steps[-1]:
            # What a model raises beyond its domain, and what is not finite, says nothing of the offset.
            try:
                difference = self._difference(state)
            except LEFT_ITS_DOMAIN:
                return
            if np.isfinite(difference).all():
                self.value[: self._size] += self._share * self._wrapped(difference - self.value[: self._size])

    def apply(self, state: Array, control: Array) -> None:
        """The control (m,) that was decided at a state (n,)."""
        self.past.append((state.copy(), control.copy()))

    def _difference(self, state: Array) -> Array:
        x, predicted = self.past[0][0].copy(), []
        for _, control in self.past:
            self._plant.bound_model.step(x, control, x)
            predicted.append(x.copy())
        measured = [*(at for at, _ in self.past), state][1:]
        both = np.array([measured, predicted])[:, np.array(self._steps) - 1]
        outputs = self._plant.outputs(both)[..., self._of.selected]
        return self._wrapped((outputs[0] - outputs[1]).ravel())

    def _wrapped(self, difference: Array) -> Array:
        return self._of.differences(difference, np.arange(self._size))

# SPDX-License-Identifier: Apache-2.0
"""A plant and a controller of a user's own, as small as can be: a cart on a spring, held by a proportional law."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from skydiver_utc.controllers.protocol import Decision, Status
from skydiver_utc.estimators.protocol import Estimator
from skydiver_utc.parameters.fields import SlotSettings, quantity
from skydiver_utc.plants.protocol import Plant

CART = """
name: cart
duration_s: 0.5
dt_s: 0.01
plant: {kind: "own_slots:Cart"}
reference: {kind: sine, output: position, amplitude: 0.2, frequency_hz: 2.0}
controller: {kind: "own_slots:Proportional", gain: 3.0}
"""


def cart_file(folder: Path, text: str = CART) -> str:
    """The scenario of the cart as a file; returns its path."""
    path = folder / "cart.yaml"
    path.write_text(text, encoding="utf-8")
    return str(path)


class Cart(Plant):
    """position'' = force - position, by explicit steps."""

    class Settings(SlotSettings):
        pass

    state_names = ("position", "speed")
    control_names = ("force", "brake")
    output_names = ("position",)
    minimum, maximum = np.array([-5.0, 0.0]), np.array([5.0, 1.0])
    rate = np.array([np.inf, np.inf])

    def __init__(self, settings: Settings, dt_s: float) -> None:
        self.dt_s = dt_s

    def initial_state(self) -> Any:
        return np.array([0.1, 0.0])

    def step(self, state: Any, before: Any, applied: Any) -> Any:
        force, brake = applied
        return state + self.dt_s * np.array([state[1], force - state[0] - brake * state[1]])

    def outputs(self, states: Any) -> Any:
        return states[..., :1]

    def fault(self, state: Any) -> str:
        return "" if abs(state[0]) < 100.0 else "the cart is gone"


class Proportional:
    """force = gain (reference - position), with a preview that it does not need."""

    class Settings(SlotSettings):
        gain: Annotated[float, quantity("1", "force per error", ge=0, le=100)] = 1.0

    preview_steps = 3
    telemetry_names = ("error",)

    def __init__(
        self, settings: Settings, plant: Plant, outputs: Sequence[str], dt_s: float, seed: int
    ) -> None:
        self._gain, self._start = settings.gain, plant.initial_control()
        self.reset()

    def reset(self) -> None:
        self._control = self._start.copy()

    def resume(self, control: Any) -> None:
        self._control = np.array(control)

    def decide(self, state: Any, preview: Any) -> Decision:
        """Half of the control before, half of the law: so that a warm start can be seen."""
        error = preview[0, 0] - state[0]
        wanted = np.array([self._gain * error, 0.25])
        self._control = 0.5 * self._control + 0.5 * wanted
        return Decision(self._control.copy(), np.array([error]), Status.SOLVED)


class Averaged(Estimator):
    """The mean of the measured state and the estimate before."""

    class Settings(SlotSettings):
        pass

    def __init__(self, settings: Settings, plant: Plant, dt_s: float) -> None:
        self.reset()

    def reset(self) -> None:
        self._estimate: Any = None

    def update(self, measurement: Any) -> Any:
        before = measurement if self._estimate is None else self._estimate
        self._estimate = 0.5 * (before + measurement)
        return self._estimate


class CartWithMishap(Cart):
    """A cart that is never where it should be."""

    def mishap(self, state: Any) -> str:
        return "it is off its place"


class Body(Cart):
    """A cart whose state comes as an Odometry."""

    state_names = ("x", "y", "z", "qx", "qy", "qz", "qw", "vx", "vy", "vz", "wx", "wy", "wz")
    state_message = "odometry"

    def initial_state(self) -> Any:
        return np.array([0.0] * 6 + [1.0] + [0.0] * 6)

    def step(self, state: Any, before: Any, applied: Any) -> Any:
        return state

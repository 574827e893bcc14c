# SPDX-License-Identifier: Apache-2.0
"""The interface of a plant to the closed loop, and the model with which a controller predicts."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from numba.core.errors import NumbaError

from skydiver_utc.arrays import Array
from skydiver_utc.jit import by_address, in_memory, is_jitted

# step(state (n,), control (m,), parameters, out (n,)) writes the state one step later; out may be the state.
Step = Callable[[Array, Array, Any, Array], None]
# outputs(state (n,), parameters, out (L,)) writes all outputs of the plant.
Outputs = Callable[[Array, Any, Array], None]


class Model(NamedTuple):
    """The plant as a controller predicts with it: the control is held over each step.

    step, outputs: kernels of module level, so that numba caches them
    parameters: the numbers that both take, a tuple of floats and arrays; other numbers need no new compilation
    """

    step: Step
    outputs: Outputs
    parameters: Any
    state_size: int

    def bound(self, controls: int, outputs: int) -> "BoundModel":
        """The functions with their parameters, for Python: step(state, control, out) and outputs(state, out)."""
        state, control, out = np.empty(self.state_size), np.empty(controls), np.empty(outputs)
        if is_jitted(self.step) and is_jitted(self.outputs):
            return BoundModel(
                by_address([(in_memory(self.step), self.parameters)], state, control, state),
                by_address([(in_memory(self.outputs), self.parameters)], state, out),
            )
        return BoundModel(
            lambda state, control, out: self.step(state, control, self.parameters, out),
            lambda state, out: self.outputs(state, self.parameters, out),
        )


class BoundModel(NamedTuple):
    """A model's functions that need no parameters any more."""

    step: Callable[[Array, Array, Array], None]
    outputs: Callable[[Array, Array], None]


# What a model's function raises that has left where it is defined: LinAlgError is a ValueError.
LEFT_ITS_DOMAIN = (ArithmeticError, ValueError, IndexError)
# What else one raises that was not written for its arguments.
MISTAKES = (AssertionError, AttributeError, LookupError, NameError, RuntimeError, TypeError, NumbaError)


def one_line(error: BaseException) -> str:
    """The first telling line of an error's text: numba's errors have many."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    # Numba's first lines name only the pass in which it happened.
    lines = [line for line in lines if not line.startswith("Failed in nopython mode")]
    telling = [line for line in lines if line.startswith(("No implementation", "Invalid use", "Unknown"))]
    return (telling or lines or [type(error).__name__])[0].rstrip(".:")


class SensorModel(NamedTuple):
    """A measurement of a plant.

    function(state (n,), control (c,), numbers, out (l,)): a kernel of module level like those of `Model`; control is
        that of the step that led to the state, as `Plant.step_control` gives it
    names: of the l numbers; unit: of all of them
    fields: where the numbers stand in a ROS message of type `message`, dotted; without, in a JointState by name
    in_air: the state's velocity is that relative to the air; without, that over ground
    """

    function: Callable[[Array, Array, Any, Array], None]
    numbers: Any
    names: tuple[str, ...]
    unit: str
    message: str = "JointState"
    fields: tuple[str, ...] = ()
    in_air: bool = False


class Reduced(NamedTuple):
    """An equilibrium z (n_r,) in the states that matter to a regulator, and how a state (n,) becomes these and back."""

    state: Array
    reduce: Callable[[Array], Array]
    expand: Callable[[Array], Array]


FORCE_M_PER_N = 0.004  # length of a drawn force


class Shape(NamedTuple):
    """An ellipsoid that a display draws for a part of a plant: its half axes (3,) [m] along the part's x, y, z."""

    name: str
    half_axes: Array


class Plant(ABC):
    """A plant in discrete time; made as `Class(settings, dt_s)`. It keeps no state of its own.

    state_names, control_names, output_names: n, m and L names; units: of those that have one, by name
    minimum, maximum, rate: limits of the control (m,) and of its change per second, inf where there is none
    state_message: the ROS message that carries the state, nav_msgs/Odometry (13 numbers) or sensor_msgs/JointState
    """

    state_names: tuple[str, ...]
    control_names: tuple[str, ...]
    output_names: tuple[str, ...]
    units: ClassVar[Mapping[str, str]] = {}
    minimum: Array
    maximum: Array
    rate: Array
    state_message: Literal["odometry", "joint_state"] = "joint_state"
    model: Model
    dt_s: float
    # Joints that a display shows, and their angles [rad] at what the actuators hold.
    joint_names: tuple[str, ...] = ()
    # Of S parts that a display draws; none where there is nothing to see.
    shapes: tuple[Shape, ...] = ()
    # Sensors of its own, by name, besides its states and outputs.
    sensors: Mapping[str, SensorModel] = {}

    @cached_property
    def bound_model(self) -> BoundModel:
        """The functions of `model` for Python."""
        return self.model.bound(len(self.control_names), len(self.output_names))

    def __getstate__(self) -> dict[str, Any]:
        """Of a plant that goes to another process: machine code stays behind, where its addresses hold."""
        return {
            name: value
            for name, value in self.__dict__.items()
            if not isinstance(getattr(type(self), name, None), cached_property)
        }

    @abstractmethod
    def initial_state(self) -> Array:
        """State (n,) at step 0."""

    def initial_control(self) -> Array:
        """Control (m,) before step 0: zero, or the limit nearest to it."""
        return np.clip(np.zeros(len(self.control_names)), self.minimum, self.maximum)

    def model_of_step(self, dt_s: float) -> Model:
        """The model with another step; raises ValueError where there is none."""
        raise ValueError(f"the model of this plant has a step of {self.dt_s:g} s only, not {dt_s:g} s")

    def reduced(self, control: Array) -> Reduced:
        """The equilibrium under a control (m,), the nearest to the initial state; raises ValueError without one."""
        from scipy.optimize import root

        following = np.empty(self.model.state_size)

        def change(state: Array) -> Array:
            self.bound_model.step(state, control, following)
            return following - state

        found = root(change, self.initial_state(), method="lm")
        if not (found.success and np.abs(change(found.x)).max() < 1e-6):
            raise ValueError(f"the plant has no equilibrium near its initial state under {control.tolist()}")
        return Reduced(found.x, lambda state: state, lambda z: z)

    def initial_applied(self) -> Array:
        """The actuators' state (a,) before step 0; its first m entries are the control."""
        return self.initial_control()

    def actuate(self, command: Array, applied: Array) -> Array:
        """The actuators' next state (a,) under a command (m,): bounds, then rates."""
        change = self.rate * self.dt_s
        bounded = np.minimum(np.maximum(command, self.minimum), self.maximum)
        return np.minimum(np.maximum(bounded, applied - change), applied + change)

    def step_control(self, before: Array, applied: Array) -> Array:
        """The control (c,) of the model for a step in which the actuators go from before (a,) to applied (a,)."""
        return applied[: len(self.control_names)]

    def step(self, state: Array, before: Array, applied: Array) -> Array:
        """State (n,) one step later, while the actuators go from before (a,) to applied (a,)."""
        following = np.empty(len(self.state_names))
        self.bound_model.step(state, self.step_control(before, applied), following)
        return following

    def advance(self, state: Array, before: Array, command: Array) -> tuple[Array, Array]:
        """State (n,) and the actuators' state (a,) one step later, under a command (m,)."""
        applied = self.actuate(command, before)
        return self.step(state, before, applied), applied

    def outputs(self, states: Array) -> Array:
        """All outputs (..., L) of states (..., n)."""
        found = np.empty((*states.shape[:-1], len(self.output_names)))
        rows = np.ascontiguousarray(states, dtype=float).reshape(-1, states.shape[-1])
        for state, y in zip(rows, found.reshape(-1, found.shape[-1]), strict=True):
            self.bound_model.outputs(state, y)
        return found

    def joint_angles(self, applied: Array) -> Array:
        """Angles of the joints by `joint_names` [rad]."""
        return np.empty(0)

    def shape_poses(self, state: Array, applied: Array) -> Array:
        """Centre [m] and attitude x y z w (S, 7) of each of the `shapes` in the world."""
        return np.empty((0, 7))

    def shape_forces(self, state: Array, applied: Array) -> Array:
        """Force [N] on each of the `shapes` in the world (S, 3); none (0, 3) where a display has none to draw."""
        return np.empty((0, 3))

    def robot_description(self) -> str:
        """The body as URDF, with the joints of `joint_names` and the root `base_link`; empty where there is none."""
        return ""

    def robot_pose(self, state: Array, applied: Array) -> Array:
        """Origin [m] and attitude x y z w (7,) of `base_link` in the world; none (0,) where there is no URDF."""
        return np.empty(0)

    def fault(self, state: Array) -> str:
        """Why the run cannot go on from a state, empty where it can."""
        return "" if np.isfinite(state).all() else "the state is not finite"

    def mishap(self, state: Array) -> str:
        """A mishap that does not end the run, in words; empty without one."""
        return ""

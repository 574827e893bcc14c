# SPDX-License-Identifier: Apache-2.0
"""Six textbook plants for docs/compared.md and the tests of UTC as a library.

The right-hand sides are written once: numba compiles them for the flight and for UTC, and CasADi evaluates the same
lines on symbols. Each plant's outputs are its y with derivatives added, (T d/dt + 1)^p y, with the lead T as a number
of the model; p is 0 where the control acts on y' or y'' is not part of the state.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from skydiver_utc import Model, Plant, kernel, runge_kutta


class Numbers(NamedTuple):
    """What the kernels take."""

    dt_s: float
    lead: float  # T [unit of time]


# ---- Two-link arm in the vertical plane, 1 kg and 1 m a link (Spong et al., Robot Modeling and Control).


@kernel
def arm(x, u, p, out):
    """Angles [rad] from the horizontal and of the elbow, and their rates; u: torques [Nm] of shoulder and elbow."""
    c, s = np.cos(x[1]), np.sin(x[1])
    inertia = 1.0 / 12.0
    d22 = 0.25 + inertia
    d12 = d22 + 0.5 * c
    d11 = 0.25 + 1.0 + 0.25 + c + 2.0 * inertia
    lower = 0.5 * 9.81 * np.cos(x[0] + x[1])
    first = u[0] + 0.5 * s * (2.0 * x[2] * x[3] + x[3] ** 2) - 1.5 * 9.81 * np.cos(x[0]) - lower
    second = u[1] - 0.5 * s * x[2] ** 2 - lower
    determinant = d11 * d22 - d12**2
    out[0], out[1] = x[2], x[3]
    out[2] = (d22 * first - d12 * second) / determinant
    out[3] = (d11 * second - d12 * first) / determinant


@kernel
def arm_step(x, u, p, out):
    runge_kutta(arm, x, u, p, p.dt_s, out)


@kernel
def arm_outputs(x, p, out):
    out[0] = x[0] + p.lead * x[2]
    out[1] = x[1] + p.lead * x[3]


# ---- Stirred tank reactor (Klatt and Engell 1993), with the numbers of do-mpc's example.


@kernel
def reactor(x, u, p, out):
    """Concentrations A and B [mol/l], reactor and jacket [deg C]; u: inflow [1/h], heat [kJ/h]; time in h."""
    k_ab = 1.287e12 * np.exp(-9758.3 / (x[2] + 273.15))  # and that of B to C
    k_ad = 9.043e9 * np.exp(-8560.0 / (x[2] + 273.15))
    to_jacket = 4032.0 * 0.215 * (x[2] - x[3])  # kJ/h
    heat = k_ab * x[0] * 4.2 - k_ab * x[1] * 11.0 - k_ad * x[0] ** 2 * 41.85  # kJ/(l h)
    out[0] = u[0] * (5.1 - x[0]) - k_ab * x[0] - k_ad * x[0] ** 2
    out[1] = -u[0] * x[1] + k_ab * x[0] - k_ab * x[1]
    out[2] = u[0] * (130.0 - x[2]) - heat / (0.9342 * 3.01) - to_jacket / (0.9342 * 3.01 * 10.01)
    out[3] = (u[1] + to_jacket) / (5.0 * 2.0)


@kernel
def reactor_step(x, u, p, out):
    runge_kutta(reactor, x, u, p, p.dt_s, out)


@kernel
def reactor_outputs(x, p, out):
    out[0] = x[1]


# ---- Ship: Nomoto's T and K of a Mariner class vessel with Norrbin's cubic damping (Fossen, Handbook of Marine Craft).


@kernel
def ship(x, u, p, out):
    """Heading [rad] and turn rate [rad/s]; u: rudder [rad]. The cubic term is calibrated: 1.2 deg/s at 35 deg."""
    out[0] = x[1]
    out[1] = (0.185 * u[0] - x[1] - 1.0e4 * x[1] ** 3) / 107.3


@kernel
def ship_step(x, u, p, out):
    runge_kutta(ship, x, u, p, p.dt_s, out)


@kernel
def ship_outputs(x, p, out):
    out[0] = x[0] + p.lead * x[1]


# ---- Four tanks in the non-minimum-phase setting P+ (Johansson 2000, The Quadruple-Tank Process).


@kernel
def tanks(x, u, p, out):
    """Levels [cm] of the lower and the upper two tanks; u: voltages of the pumps [V]."""
    f0 = 0.071 * np.sqrt(2.0 * 981.0 * np.maximum(x[0], 1e-3))
    f1 = 0.057 * np.sqrt(2.0 * 981.0 * np.maximum(x[1], 1e-3))
    f2 = 0.071 * np.sqrt(2.0 * 981.0 * np.maximum(x[2], 1e-3))
    f3 = 0.057 * np.sqrt(2.0 * 981.0 * np.maximum(x[3], 1e-3))
    out[0] = (f2 - f0 + 0.43 * 3.14 * u[0]) / 28.0
    out[1] = (f3 - f1 + 0.34 * 3.29 * u[1]) / 32.0
    out[2] = (0.66 * 3.29 * u[1] - f2) / 28.0
    out[3] = (0.57 * 3.14 * u[0] - f3) / 32.0


@kernel
def tanks_step(x, u, p, out):
    runge_kutta(tanks, x, u, p, p.dt_s, out)


@kernel
def tanks_outputs(x, p, out):
    out[0] = x[0]
    out[1] = x[1]


# ---- Cart-pole near upright: 1 kg, a 0.2 kg point at 0.5 m.


@kernel
def cart_pole(x, u, p, out):
    """Place of the cart [m], angle of the pole from upright [rad], their rates; u: force on the cart [N]."""
    s, c = np.sin(x[1]), np.cos(x[1])
    push = (u[0] + 0.2 * 0.5 * x[3] ** 2 * s) / 1.2
    turn = (9.81 * s - c * push) / (0.5 * (1.0 - 0.2 * c**2 / 1.2))
    out[0], out[1] = x[2], x[3]
    out[2] = push - 0.2 * 0.5 * turn * c / 1.2
    out[3] = turn


@kernel
def cart_pole_step(x, u, p, out):
    runge_kutta(cart_pole, x, u, p, p.dt_s, out)


@kernel
def cart_pole_outputs(x, p, out):
    """y: place of the pole's end, which accelerates with g times the angle near upright."""
    T = p.lead
    place, speed = x[0] + 0.5 * x[1], x[2] + 0.5 * x[3]
    out[0] = place + 3.0 * T * speed + 3.0 * T**2 * 9.81 * x[1] + T**3 * 9.81 * x[3]


# ---- Double integrator whose control arrives five steps late.


@kernel
def late_step(x, u, p, out):
    """Place [m], speed [m/s], five accelerations [m/s2] on their way; u: acceleration [m/s2]."""
    out[0] = x[0] + p.dt_s * x[1] + 0.5 * p.dt_s**2 * x[2]
    out[1] = x[1] + p.dt_s * x[2]
    for i in range(2, 6):
        out[i] = x[i + 1]
    out[6] = u[0]


@kernel
def late_outputs(x, p, out):
    out[0] = x[0] + p.lead * x[1]


class Textbook(NamedTuple):
    """A plant's kernels and numbers. Rates per unit of time, which is the hour for the reactor, else the second.

    derivative: its right-hand side, None where the step is given in itself
    state: near the equilibrium under `control`, where it starts
    order: p of the outputs
    """

    title: str
    derivative: Callable[..., None] | None
    step: Callable[..., None]
    outputs: Callable[..., None]
    order: int
    dt: float
    state: tuple[float, ...]
    control: tuple[float, ...]
    minimum: tuple[float, ...]
    maximum: tuple[float, ...]
    tracked: tuple[str, ...]
    rate: tuple[float, ...] | None = None


PLANTS: dict[str, Textbook] = {
    "arm": Textbook(
        "two-link arm", arm, arm_step, arm_outputs, 1, 0.02,
        (0.5, 0.5, 0.0, 0.0), (15.5637, 2.6502), (-60.0, -20.0), (60.0, 20.0), ("shoulder", "elbow"),
    ),
    "reactor": Textbook(
        "stirred tank reactor", reactor, reactor_step, reactor_outputs, 0, 0.005,
        (2.0, 0.9, 125.0, 120.0), (20.0, -2000.0), (5.0, -8500.0), (100.0, 0.0), ("C_b",),
    ),
    "ship": Textbook(
        "ship's heading", ship, ship_step, ship_outputs, 1, 2.0,
        (0.0, 0.0), (0.0,), (-0.61,), (0.61,), ("heading",), (0.0524,),
    ),
    "tanks": Textbook(
        "four tanks", tanks, tanks_step, tanks_outputs, 0, 15.0,
        (12.4, 13.2, 4.7, 5.0), (3.15, 3.15), (0.0, 0.0), (10.0, 10.0), ("level 1", "level 2"),
    ),
    "cart_pole": Textbook(
        "cart-pole", cart_pole, cart_pole_step, cart_pole_outputs, 3, 0.02,
        (0.0, 0.0, 0.0, 0.0), (0.0,), (-10.0,), (10.0,), ("pole's end",),
    ),
    "late": Textbook(
        "double integrator, five steps late", None, late_step, late_outputs, 1, 0.1,
        (0.0,) * 7, (0.0,), (-1.0,), (1.0,), ("place",),
    ),
}  # fmt: skip


class TextbookPlant(Plant):
    """One of `PLANTS` as a plant of the package; it starts at the equilibrium under its initial control."""

    def __init__(self, name: str, lead: float = 0.0) -> None:
        about = PLANTS[name]
        self.about, self.dt_s = about, about.dt
        self.state_names = tuple(f"x{i}" for i in range(len(about.state)))
        self.control_names = tuple(f"u{i}" for i in range(len(about.control)))
        self.output_names = about.tracked
        self.minimum, self.maximum = np.array(about.minimum), np.array(about.maximum)
        self.rate = np.full(len(about.control), np.inf) if about.rate is None else np.array(about.rate)
        self.model = Model(about.step, about.outputs, Numbers(about.dt, lead), len(about.state))
        self._state = np.array(about.state)
        self._state = self.reduced(self.initial_control()).state

    def initial_state(self) -> np.ndarray:
        """The equilibrium."""
        return self._state.copy()

    def initial_control(self) -> np.ndarray:
        """The control that holds it."""
        return np.array(self.about.control)


def symbolic_step(about: Textbook, x: list[Any], u: list[Any], numbers: Numbers) -> list[Any]:
    """One step of the plant on CasADi's symbols: its own lines, and Runge and Kutta's over them."""
    if about.derivative is None:
        return _written(about.step, x, u, numbers)

    def slope(at: list[Any]) -> list[Any]:
        return _written(about.derivative, at, u, numbers)

    def moved(by: float, along: list[Any]) -> list[Any]:
        return [value + by * change for value, change in zip(x, along, strict=True)]

    h = numbers.dt_s
    k1 = slope(x)
    k2 = slope(moved(0.5 * h, k1))
    k3 = slope(moved(0.5 * h, k2))
    k4 = slope(moved(h, k3))
    mean = [(a + 2.0 * b + 2.0 * c + d) / 6.0 for a, b, c, d in zip(k1, k2, k3, k4, strict=True)]
    return moved(h, mean)


def symbolic_outputs(about: Textbook, x: list[Any], numbers: Numbers) -> list[Any]:
    """The outputs on CasADi's symbols."""
    out: list[Any] = [0.0] * len(about.tracked)
    about.outputs.py_func(x, numbers, out)  # type: ignore[attr-defined]
    return out


def _written(kernel_of: Any, x: list[Any], u: list[Any], numbers: Numbers) -> list[Any]:
    out: list[Any] = [0.0] * len(x)
    kernel_of.py_func(x, u, numbers, out)
    return out

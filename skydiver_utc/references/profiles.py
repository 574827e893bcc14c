# SPDX-License-Identifier: Apache-2.0
"""Reference profiles for one output each: settings and formula together.

An amplitude is given in the unit of the output, or in degrees per second under the name with `_deg_s`. Before `start_s`
every profile is 0.
"""

import math
from abc import abstractmethod
from collections.abc import Callable
from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Field, model_validator
from typing_extensions import Self

from skydiver_utc.arrays import Array
from skydiver_utc.parameters.fields import quantity, text
from skydiver_utc.references.curve import Curve, CurveSettings

# Times are whole nanoseconds; products such as k * dt_s miss them by rounding.
_DIGITS = 9
_MOST_SINES = 1000
# The largest value of a random profile is found to pi^2 / (2 n^2) = 3e-4 of it.
_POINTS_OF_A_PERIOD = 128

Seconds = Annotated[float, quantity("s", "simulated time", ge=0, le=36000)]
Frequency = Annotated[float, quantity("Hz", "frequency", gt=0, le=1000)]
Phase = Annotated[float, quantity("deg", "phase at the start", ge=-360, le=360)]
Rise = Annotated[float, quantity("s", "time of each change by the amplitude; 0 is a jump", ge=0, le=36000)]
Hold = Annotated[float, quantity("s", "time at the amplitude", gt=0, le=36000)]
Output = Annotated[str, text("name of the tracked output of the plant")]
# Amplitude, angular frequency [rad/s] and phase [rad] of a sine.
Component = tuple[float, float, float]


class Shape(NamedTuple):
    """Value at a time since the start [s], largest absolute value, shortest period [s]."""

    value: Callable[[float], float]
    largest: float
    shortest_s: float = math.inf


class Profile(CurveSettings):
    """A curve of one output: a function of the time since the start."""

    output: Output = "yaw_rate"
    start_s: Seconds = 0.0

    @abstractmethod
    def shape(self) -> Shape:
        """The profile as a function of the time since the start."""

    def curve(self) -> Curve:
        shape = self.shape()

        def value(time_s: float) -> Array:
            since_s = time_s - self.start_s
            return np.array([shape.value(since_s) if round(since_s, _DIGITS) >= 0.0 else 0.0])

        return Curve((self.output,), np.array([shape.largest]), value, shape.shortest_s)


class Scaled(Profile):
    """A profile with an amplitude."""

    amplitude: Annotated[float, quantity("unit of the output", "amplitude", ge=-1e6, le=1e6)] = 0.0
    amplitude_deg_s: Annotated[
        float, quantity("deg/s", "amplitude of a rate, positive first to the left", ge=-3600, le=3600)
    ] = 0.0

    @model_validator(mode="after")
    def _one_amplitude(self) -> Self:
        if self.amplitude and self.amplitude_deg_s:
            raise ValueError("amplitude and amplitude_deg_s are both given: keep one")
        if not self.model_fields_set & {"amplitude", "amplitude_deg_s"}:
            raise ValueError("amplitude is missing: write it, or amplitude_deg_s")
        return self

    @property
    def size(self) -> float:
        """The amplitude in the unit of the output."""
        return self.amplitude or math.radians(self.amplitude_deg_s)


class Step(Scaled):
    """The amplitude from the start on."""

    kind: Literal["step"] = "step"

    def shape(self) -> Shape:
        return _lines((0.0, self.size))


class Ramp(Scaled):
    """A straight line to the amplitude, and then the amplitude."""

    kind: Literal["ramp"] = "ramp"
    rise_s: Annotated[float, quantity("s", "time to the amplitude", gt=0, le=36000)]

    def shape(self) -> Shape:
        return _lines((0.0, 0.0), (self.rise_s, self.size))


class Trapezoid(Scaled):
    """Up to the amplitude in `rise_s`, there for `hold_s`, and back to 0 in `rise_s`."""

    kind: Literal["trapezoid"] = "trapezoid"
    rise_s: Rise
    hold_s: Hold

    def shape(self) -> Shape:
        rise, down = self.rise_s, self.rise_s + self.hold_s
        return _lines((0.0, 0.0), (rise, self.size), (down, self.size), (down + rise, 0.0))


class Doublet(Scaled):
    """A trapezoid of the amplitude, at once followed by one of the opposite amplitude; all slopes are equal."""

    kind: Literal["doublet"] = "doublet"
    rise_s: Rise = 0.0
    hold_s: Hold

    def shape(self) -> Shape:
        size, rise, down = self.size, self.rise_s, self.rise_s + self.hold_s
        up = down + 2.0 * rise + self.hold_s
        return _lines(
            (0.0, 0.0), (rise, size), (down, size), (down + 2.0 * rise, -size), (up, -size), (up + rise, 0.0)
        )


class Sine(Scaled):
    """amplitude sin(2 pi frequency t + phase), eq:yr_com."""

    kind: Literal["sine"] = "sine"
    frequency_hz: Frequency
    phase_deg: Phase = 0.0

    def shape(self) -> Shape:
        return _sines([_sine(self.size, self.frequency_hz, self.phase_deg)])


class MultiSine(Scaled):
    """The sum of sines of one amplitude."""

    kind: Literal["multi_sine"] = "multi_sine"
    frequencies_hz: Annotated[
        tuple[Frequency, ...],
        quantity("Hz", "frequency of each sine"),
        Field(min_length=1, max_length=_MOST_SINES),
    ]
    phases_deg: Annotated[
        tuple[Phase, ...], quantity("deg", "phase of each sine at the start; without them 0")
    ] = ()

    @model_validator(mode="after")
    def _a_phase_each(self) -> Self:
        if self.phases_deg and len(self.phases_deg) != len(self.frequencies_hz):
            raise ValueError(
                f"phases_deg has {len(self.phases_deg)} entries, frequencies_hz {len(self.frequencies_hz)}:"
                " give one phase for each frequency"
            )
        return self

    def shape(self) -> Shape:
        phases = self.phases_deg or (0.0,) * len(self.frequencies_hz)
        return _sines([_sine(self.size, *pair) for pair in zip(self.frequencies_hz, phases, strict=True)])


class Random(Scaled):
    """Band-limited noise that starts from 0: sines of normally distributed amplitudes, scaled to the largest value.

    Their frequencies are the multiples of 1 / period_s in the band.
    After half a period the profile comes back reversed.
    """

    kind: Literal["random"] = "random"
    from_hz: Annotated[float, quantity("Hz", "lowest frequency", ge=0, le=1000)] = 0.0
    to_hz: Annotated[float, quantity("Hz", "highest frequency", gt=0, le=1000)]
    period_s: Annotated[float, quantity("s", "the profile repeats after this time", gt=0, le=72000)] = 120.0
    seed: Annotated[int, quantity("1", "seed of the amplitudes", ge=0, le=2**32 - 1)] = 0

    @model_validator(mode="after")
    def _has_sines(self) -> Self:
        count = len(self._multiples())
        if not 1 <= count <= _MOST_SINES:
            raise ValueError(
                f"{count} multiples of 1 / period_s lie between from_hz and to_hz: choose a band and a period_s with"
                f" 1 to {_MOST_SINES}"
            )
        return self

    def _multiples(self) -> range:
        first = max(1, math.ceil(round(self.from_hz * self.period_s, _DIGITS)))
        return range(first, math.floor(round(self.to_hz * self.period_s, _DIGITS)) + 1)

    def shape(self) -> Shape:
        multiples = self._multiples()
        amplitudes = np.random.default_rng(self.seed).normal(size=len(multiples))
        points = _POINTS_OF_A_PERIOD * max(multiples)
        spectrum = np.zeros(multiples.stop, dtype=np.complex128)
        spectrum[multiples.start :] = -0.5j * points * amplitudes
        scale = self.size / float(np.abs(np.fft.irfft(spectrum, points)).max())
        pairs = zip(amplitudes, multiples, strict=True)
        sines = _sines([_sine(scale * a, i / self.period_s, 0.0) for a, i in pairs])
        return sines._replace(largest=abs(self.size))


class Chirp(Scaled):
    """A sine whose frequency grows or falls linearly during `duration_s`, and then stays."""

    kind: Literal["chirp"] = "chirp"
    from_hz: Annotated[float, quantity("Hz", "frequency at the start", ge=0, le=1000)]
    to_hz: Annotated[float, quantity("Hz", "frequency at the end of the sweep", ge=0, le=1000)]
    duration_s: Annotated[float, quantity("s", "length of the sweep", gt=0, le=36000)]
    phase_deg: Phase = 0.0

    @model_validator(mode="after")
    def _turns(self) -> Self:
        if self.from_hz == self.to_hz == 0.0:
            raise ValueError("from_hz and to_hz are both 0: give one a frequency")
        return self

    def shape(self) -> Shape:
        amplitude, phase = self.size, math.radians(self.phase_deg)
        from_hz, to_hz, duration_s = self.from_hz, self.to_hz, self.duration_s

        def value(since_s: float) -> float:
            swept_s = min(since_s, duration_s)
            mean_hz = from_hz + 0.5 * (to_hz - from_hz) * swept_s / duration_s
            cycles = mean_hz * swept_s + to_hz * (since_s - swept_s)
            return amplitude * math.sin(2.0 * math.pi * cycles + phase)

        return Shape(value, abs(amplitude), 1.0 / max(from_hz, to_hz))


class Rotation(Profile):
    """The rate of a rotation by an angle: angle / duration (1 - cos(2 pi t / duration))."""

    kind: Literal["rotation"] = "rotation"
    angle_deg: Annotated[
        float,
        quantity("deg", "angle to turn through, positive to the left or head down", ge=-3600, le=3600),
    ]
    duration_s: Annotated[float, quantity("s", "length of the rotation", gt=0, le=600)]

    def shape(self) -> Shape:
        duration_s, mean = self.duration_s, math.radians(self.angle_deg) / self.duration_s

        def value(since_s: float) -> float:
            share = min(since_s / duration_s, 1.0)
            return mean * (1.0 - math.cos(2.0 * math.pi * share))

        return Shape(value, 2.0 * abs(mean), duration_s)


def _lines(*points: tuple[float, float]) -> Shape:
    """Straight lines through points (time, value); of two at one time the later one counts from then on."""
    times, values = np.array(points).T
    times = np.round(times, _DIGITS)
    return Shape(
        lambda since_s: float(np.interp(round(since_s, _DIGITS), times, values)), float(np.abs(values).max())
    )


def _sine(amplitude: float, frequency_hz: float, phase_deg: float) -> Component:
    """Amplitude, angular frequency [rad/s] and phase [rad]."""
    return float(amplitude), 2.0 * math.pi * frequency_hz, math.radians(phase_deg)


def _sines(sines: list[Component]) -> Shape:
    largest = sum(abs(amplitude) for amplitude, _, _ in sines)
    shortest_s = 2.0 * math.pi / max(rate for _, rate, _ in sines)

    def value(since_s: float) -> float:
        return sum([amplitude * math.sin(rate * since_s + phase) for amplitude, rate, phase in sines])

    return Shape(value, largest, shortest_s)

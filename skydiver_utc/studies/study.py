# SPDX-License-Identifier: Apache-2.0
"""Settings of a study: cases, what varies between their runs, how it is sampled, and when a run is a success."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from statistics import NormalDist
from typing import Annotated, Any, Literal

from pydantic import model_validator
from typing_extensions import Self

from skydiver_utc.parameters import ParameterError, Parameters, Scenario, load_scenario, quantity, text
from skydiver_utc.parameters.loading import load_named

_MOST = 1_000_000


class Bar(Parameters):
    """Where a measure is wanted: at least, at most, or between two numbers."""

    at_least: Annotated[float, quantity("of the measure", "smallest value wanted")] | None = None
    at_most: Annotated[float, quantity("of the measure", "largest value wanted")] | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        bars = [bar for bar in (self.at_least, self.at_most) if bar is not None]
        if not bars:
            raise ValueError("write at_least, at_most or both")
        if len(bars) == 2 and bars[0] > bars[1]:
            raise ValueError(f"at_least ({bars[0]:g}) must not be above at_most ({bars[1]:g})")
        return self

    def holds(self, value: float | None) -> bool:
        """Whether a value is there and within the bars."""
        return (
            value is not None
            and (self.at_least is None or value >= self.at_least)
            and (self.at_most is None or value <= self.at_most)
        )


class Variation(Parameters):
    """Settings that get one value, drawn for each run from the one distribution that is written.

    log_uniform: between two positive numbers; normal: mean and standard deviation; grid: one value after the other
    """

    settings: Annotated[tuple[str, ...], text("dotted names that all get the value")]
    times: Annotated[bool, text("the value is a factor on the scenario's own number")] = False
    unit: str = ""
    uniform: tuple[float, float] | None = None
    log_uniform: tuple[float, float] | None = None
    normal: tuple[float, float] | None = None
    choice: tuple[Any, ...] | None = None
    grid: tuple[Any, ...] | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        kinds = ("uniform", "log_uniform", "normal", "choice", "grid")
        written = [kind for kind in kinds if getattr(self, kind) is not None]
        if len(written) != 1:
            raise ValueError(f"write one of {', '.join(kinds)}, found {', '.join(written) or 'none'}")
        if not self.settings or not (self.values or written[0] not in ("choice", "grid")):
            raise ValueError(f"settings and {written[0]} need at least one entry")
        for low, high in (pair for pair in (self.uniform, self.log_uniform) if pair):
            if not low < high or (self.log_uniform and low <= 0.0):
                raise ValueError(f"{written[0]} needs two rising numbers, above 0 for log_uniform")
        if self.normal and self.normal[1] <= 0.0:
            raise ValueError("normal needs a mean and a standard deviation above 0")
        return self

    @property
    def values(self) -> tuple[Any, ...]:
        """The values of a choice or a grid, none of a continuous distribution."""
        return self.choice or self.grid or ()

    def at(self, share: float) -> Any:
        """The value that this share, above 0 and below 1, of all draws lies below."""
        if self.uniform:
            return self.uniform[0] + share * (self.uniform[1] - self.uniform[0])
        if self.log_uniform:
            return self.log_uniform[0] * (self.log_uniform[1] / self.log_uniform[0]) ** share
        if self.normal:
            return NormalDist(*self.normal).inv_cdf(share)
        return self.values[int(share * len(self.values))]


class StudyCase(Parameters):
    """A scenario with overrides; `runs` instead of the study's number."""

    scenario: str
    set: Annotated[dict[str, Any], text("overrides by dotted name")] = {}
    runs: Annotated[int, quantity("1", "runs", ge=1, le=_MOST)] | None = None


class Study(Parameters):
    """Many runs for one question.

    runs: samples in all (random), of each variation alone while the others keep the scenario's value (one_by_one),
    or the base number of a sampler of SALib (sobol, morris)
    set: overrides in every case; success: bars for metrics of a run that was completed; metrics: kept of each run
    """

    name: str
    title: str = ""
    description: str = ""
    seed: Annotated[int, quantity("1", "seed of every draw", ge=0, le=2**32 - 1)]
    sampler: Literal["random", "one_by_one", "sobol", "morris"] = "random"
    runs: Annotated[int, quantity("1", "samples", ge=1, le=_MOST)]
    set: Annotated[dict[str, Any], text("overrides by dotted name")] = {}
    cases: dict[str, StudyCase]
    vary: dict[str, Variation]
    success: dict[str, Bar]
    metrics: tuple[str, ...]

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name in ("cases", "vary", "metrics"):
            if not getattr(self, name):
                raise ValueError(f"{name} is empty: write at least one")
        if missing := set(self.success) - set(self.metrics):
            raise ValueError(f"success needs {', '.join(sorted(missing))}: add it to metrics")
        if self.by_salib and any(case.runs for case in self.cases.values()):
            raise ValueError(f"{self.sampler} needs the same runs in every case: take runs out of the cases")
        if self.by_salib and (grids := [name for name, one in self.vary.items() if one.grid]):
            raise ValueError(f"{self.sampler} draws all values: write choice instead of grid for {grids[0]}")
        return self

    @property
    def by_salib(self) -> bool:
        """Whether SALib draws the samples."""
        return self.sampler in ("sobol", "morris")

    def load(self) -> dict[str, Scenario]:
        """The scenario of each case. Raises `ParameterError`."""
        found = {}
        for name, case in self.cases.items():
            with self.naming(name):
                found[name] = load_scenario(case.scenario, {**self.set, **case.set})
        return found

    @contextmanager
    def naming(self, case: str) -> Iterator[None]:
        """An error of settings names this case, too."""
        try:
            yield
        except (ParameterError, ValueError) as error:
            raise ParameterError(f"{error} (case {case!r} of study {self.name})") from error

    def digest(self, scenarios: Mapping[str, Scenario]) -> str:
        """Digest of all that decides what a run with a number is; more runs of the same study keep it."""
        content = self.as_dict()
        for name in ("title", "description", *(() if self.by_salib else ("runs",))):
            del content[name]
        for case in content["cases"].values():
            del case["runs"]
        whole = [content, {name: scenario.as_dict() for name, scenario in scenarios.items()}]
        return hashlib.sha256(json.dumps(whole, sort_keys=True).encode()).hexdigest()


def load_study(name_or_path: str) -> Study:
    """The study of a name below ``config/studies`` or of a YAML file. Raises `ParameterError`."""
    return load_named(Study, "study", name_or_path)

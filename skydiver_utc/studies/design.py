# SPDX-License-Identifier: Apache-2.0
"""The values of each run of a study: a function of the study's seed and the run's number alone."""

import math
from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from skydiver_utc.parameters import ParameterError
from skydiver_utc.studies.study import Study, Variation


class Sample(NamedTuple):
    """Values by the names of the variations, and the scenario's seed; a variation that is not drawn has no value."""

    values: dict[str, Any]
    seed: int


class Design:
    """Samples 0, 1, ... of a study; run n is case n % C of sample n // C, so that all C cases meet the same samples."""

    def __init__(self, study: Study) -> None:
        self.study = study
        self.names, self.variations = list(study.vary), list(study.vary.values())
        # (samples, variations), where SALib draws them.
        self.table: Any = _by_salib(study) if study.by_salib else None

    def numbers(self) -> Iterator[int]:
        """Numbers of all runs, rising."""
        cases, each = self.study.cases.values(), len(self.names) if self.study.sampler == "one_by_one" else 1
        counts = [each * (case.runs or self.study.runs) for case in cases]
        if self.table is not None:
            counts = [len(self.table)] * len(cases)
        for sample in range(max(counts)):
            for c, count in enumerate(counts):
                if sample < count:
                    yield sample * len(cases) + c

    def case(self, number: int) -> str:
        """Name of the case of a run."""
        return list(self.study.cases)[number % len(self.study.cases)]

    def sample(self, number: int) -> Sample:
        """The sample of a run."""
        i = number // len(self.study.cases)
        generator = np.random.default_rng((self.study.seed, i))
        seed = int(generator.integers(2**32))
        shares = generator.random(len(self.names)).tolist() if self.table is None else self.table[i].tolist()
        drawn = range(len(self.names))
        if self.study.sampler == "one_by_one":
            i, factor = divmod(i, len(self.names))
            drawn = range(factor, factor + 1)
        values = {}
        for k in drawn:
            one = self.variations[k]
            if one.grid:
                i, place = divmod(i, len(one.grid))
                shares[k] = (place % len(one.grid) + 0.5) / len(one.grid)
            values[self.names[k]] = one.at(_inside(shares[k]))
        return Sample(values, seed)

    def settings(self, sample: Sample, own: Mapping[str, Any]) -> dict[str, Any]:
        """Overrides by dotted name that give a scenario, in plain data, the values of a sample."""
        found: dict[str, Any] = {"seed": sample.seed}
        for name, value in sample.values.items():
            one = self.study.vary[name]
            for setting in one.settings:
                found[setting] = value * number_at(own, setting) if one.times else value
        return found


def own_value(variation: Variation, own: Mapping[str, Any]) -> float | None:
    """The number of a scenario, in plain data, that a variation changes; 1 for a factor, None without a number."""
    if variation.times:
        return 1.0
    try:
        return number_at(own, variation.settings[0])
    except ParameterError:
        return None


def number_at(content: Mapping[str, Any], setting: str) -> float:
    """The number that a resolved scenario has at a setting; the plant's where `truth` says nothing else."""
    value: Any = content
    try:
        for part in setting.split("."):
            value = value[int(part) if isinstance(value, list) and part.isdecimal() else part]
    except (LookupError, TypeError):
        value = None
        if setting.startswith("truth."):
            return number_at(content, setting.replace("truth", "plant", 1))
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ParameterError(f"{setting} is no number of the scenario: write one as in plant.hands.K_N")
    return float(value)


def _inside(share: float) -> float:
    """A share above 0 and below 1."""
    return min(max(share, 1e-12), math.nextafter(1.0, 0.0))


def problem(study: Study) -> dict[str, Any]:
    """The variations as SALib knows them: shares between 0 and 1."""
    return {"num_vars": len(study.vary), "names": list(study.vary), "bounds": [[0.0, 1.0]] * len(study.vary)}


def salib(module: str) -> Any:
    """A module of SALib; raises `ParameterError` without it."""
    try:
        import SALib

        return import_module(f"{SALib.__name__}.{module}")
    except ModuleNotFoundError as error:
        raise ParameterError("this sampler needs SALib: pip install skydiver_utc[studies]") from error


def _by_salib(study: Study) -> Any:
    more = {"calc_second_order": False} if study.sampler == "sobol" else {}
    return salib(f"sample.{study.sampler}").sample(problem(study), study.runs, seed=study.seed, **more)

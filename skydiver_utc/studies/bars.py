# SPDX-License-Identifier: Apache-2.0
"""Bars for a measure of a run."""

from typing import Annotated

from pydantic import model_validator
from typing_extensions import Self

from skydiver_utc.parameters import Parameters, quantity


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

# SPDX-License-Identifier: Apache-2.0
"""Several references as one."""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import SerializeAsAny, field_validator

from skydiver_utc.arrays import Array
from skydiver_utc.parameters.conversion import slot_settings
from skydiver_utc.parameters.fields import SlotSettings, text
from skydiver_utc.parameters.registry import factory
from skydiver_utc.references.protocol import Reference


class Combined:
    """References of several outputs; those of the same output are added."""

    class Settings(SlotSettings):
        """The references, each a block as it would stand alone."""

        kind: Literal["combined"] = "combined"
        parts: Annotated[tuple[SerializeAsAny[SlotSettings], ...], text("the references, a block each")]

        @field_validator("parts", mode="before")
        @classmethod
        def _settings_of_parts(cls, parts: Any) -> Any:
            if not isinstance(parts, tuple) or not parts:
                raise ValueError("give a list of at least one reference")
            errors: list[str] = []
            found = [
                part if isinstance(part, SlotSettings) else slot_settings("reference", f"[{i}]", part, errors)
                for i, part in enumerate(parts)
            ]
            if any(isinstance(part, SlotSettings) and part.kind == "live" for part in found):
                errors.append("a live reference stands alone: take it out")
            if errors:
                raise ValueError("; ".join(errors))
            return tuple(found)

    def __init__(self, settings: Settings, dt_s: float) -> None:
        parts: list[Reference] = [factory("reference", part.kind)(part, dt_s) for part in settings.parts]
        self.outputs = tuple(dict.fromkeys(name for part in parts for name in part.outputs))
        self._parts = [(part, [self.outputs.index(name) for name in part.outputs]) for part in parts]
        self.amplitude: Array = np.zeros(len(self.outputs))
        for part, columns in self._parts:
            self.amplitude[columns] += part.amplitude

    def preview(self, k: int, count: int) -> Array:
        """The sums (count, l) at the steps k, k+1, ..."""
        values = np.zeros((count, len(self.outputs)))
        for part, columns in self._parts:
            values[:, columns] += part.preview(k, count)
        return values

# SPDX-License-Identifier: Apache-2.0
"""Messages that cannot be used: one sentence each, counted by kind."""

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from skydiver_utc.arrays import Array


class MessageError(ValueError):
    """A message is refused; `kind` is one word to count by, the text one sentence."""

    def __init__(self, kind: str, sentence: str) -> None:
        super().__init__(sentence)
        self.kind = kind


class Refusals:
    """Counts refused messages by kind and logs the first of each kind on each topic."""

    def __init__(self, warn: Callable[[str], object]) -> None:
        self._warn = warn
        self._logged: set[tuple[str, str]] = set()
        self.counts: Counter[str] = Counter()
        self.last = ""

    def add(self, topic: str, error: MessageError) -> None:
        """Count one refused message."""
        self.counts[error.kind] += 1
        self.last = f"{topic}: {error}"
        if (topic, error.kind) not in self._logged:
            self._logged.add((topic, error.kind))
            self._warn(f"refused a message on {topic}: {error} (further ones are only counted)")

    def summary(self) -> str:
        """The counts as text, empty when nothing was refused."""
        return ", ".join(f"{kind} {count}" for kind, count in sorted(self.counts.items()))


def refuse_non_finite(values: Array, names: Sequence[str]) -> None:
    """Raise `MessageError` where a value is NaN or infinite."""
    finite = np.isfinite(values)
    if not finite.all():
        i = int(np.argmin(finite))
        raise MessageError("finite", f"its {names[i]} is {values[i]}: every value must be finite")

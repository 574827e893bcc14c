"""What happens at the border when a message cannot be used: one sentence, counted, never a crash."""

from collections import Counter
from collections.abc import Callable


class BorderError(ValueError):
    """A message is refused; `kind` is one word to count by, the message one sentence."""

    def __init__(self, kind: str, sentence: str) -> None:
        super().__init__(sentence)
        self.kind = kind


class Refusals:
    """Counts refused messages by kind and reports the first of each kind on each topic."""

    def __init__(self, warn: Callable[[str], object]) -> None:
        self._warn = warn
        self._reported: set[tuple[str, str]] = set()
        self.counts: Counter[str] = Counter()
        self.last = ""

    def add(self, topic: str, error: BorderError) -> None:
        """Count one refused message."""
        self.counts[error.kind] += 1
        self.last = f"{topic}: {error}"
        if (topic, error.kind) not in self._reported:
            self._reported.add((topic, error.kind))
            self._warn(f"refused a message on {topic}: {error} (further ones are only counted)")

    def summary(self) -> str:
        """The counts as text, empty when nothing was refused."""
        return ", ".join(f"{kind} {count}" for kind, count in sorted(self.counts.items()))

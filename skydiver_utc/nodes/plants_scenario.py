"""Which of the scenarios on `scenario` is the plant's: anybody may publish one there."""

from collections import deque

from skydiver_utc.nodes.border import BorderError
from skydiver_utc.nodes.roll_call import Claim, checksum
from skydiver_utc.nodes.topics import PLANT

# The plant's scenario may come before the claim that names it, with those of others around it.
_HELD = 20


class PlantsScenario:
    """Hears scenarios and claims, in any order; a scenario counts when the plant's claim names it.

    The plant is the one that serves the flight, before a flight the one that spoke last. Until a plant has named
    its scenario, what comes is held.
    """

    def __init__(self) -> None:
        self.plant: Claim | None = None  # what the plant says of itself, once it has named its scenario
        self._held: deque[str] = deque(maxlen=_HELD)
        self._given = ""  # checksum of the scenario that was returned last

    def hear(self, text: str) -> str | None:
        """The scenario, if it is the plant's and new; `BorderError` if the plant names another one."""
        self._held.append(text)
        if self.plant is not None and checksum(text) != self.plant.scenario:
            raise BorderError("stranger", "it is not the scenario that the plant names")
        return self._new()

    def hear_claim(self, claim: Claim) -> str | None:
        """The plant's scenario, if by this claim one that has been heard is that, and new."""
        known = self.plant
        newcomer = known is not None and known.serving and not claim.serving and claim.id != known.id
        if claim.kind == PLANT and claim.scenario and not newcomer:
            self.plant = claim
        return self._new()

    def _new(self) -> str | None:
        if self.plant is None or self.plant.scenario == self._given:
            return None
        for text in self._held:
            if checksum(text) == self.plant.scenario:
                self._given = self.plant.scenario
                return text
        return None

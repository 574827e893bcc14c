"""One plant, one controller and one reference in a namespace: each says that it is there, the newcomer leaves."""

import hashlib
import json
import os
import platform
import time
import uuid
from collections.abc import Callable
from typing import Any, NamedTuple

from std_msgs.msg import String

from skydiver_utc.nodes.border import BorderError
from skydiver_utc.nodes.seniors_word import SeniorsWord


class Claim(NamedTuple):
    """Who is there: a kind of node, since when, and whether it serves a flight already.

    Of two the senior is the one that serves a flight, else the one that started first. A plant that is configured
    names the scenario that it flies by its checksum.
    """

    kind: str
    id: str
    since_ns: int
    serving: bool
    pid: int
    host: str
    scenario: str = ""

    def senior_to(self, other: "Claim") -> bool:
        """True where `other` has to leave."""
        mine, its = (not self.serving, self.since_ns, self.id), (not other.serving, other.since_ns, other.id)
        return mine < its


def read_claim(text: str) -> Claim:
    """The claim of a message; anything else raises `BorderError`."""
    try:
        fields = json.loads(text)
        claim = Claim(**fields)
    except (ValueError, TypeError, RecursionError) as error:
        raise BorderError("claim", f"it is no claim of a node ({error})") from error
    for name, kind in Claim.__annotations__.items():
        if type(getattr(claim, name)) is not kind:
            found = getattr(claim, name)
            raise BorderError("claim", f"its {name} is {found!r}: it must be of type {kind.__name__}")
    if not 0 <= claim.since_ns < 2**63:
        raise BorderError("claim", f"its since_ns is {claim.since_ns}: it must be a time since 1970")
    return claim


def checksum(scenario: str) -> str:
    """What a claim names a scenario by."""
    return hashlib.sha256(scenario.encode()).hexdigest()


class RollCall:
    """Sends the own claim and hears those of others; `leave` is told the one sentence why this node must go.

    It goes for a senior only where `another_is_there`, a node of its kind beside it in the graph.
    """

    def __init__(
        self,
        kind: str,
        publish: Callable[[Any], None],
        another_is_there: Callable[[], bool],
        leave: Callable[[str], None],
    ) -> None:
        self.others = 0  # newcomers told to leave
        self.claim = Claim(kind, uuid.uuid4().hex, time.time_ns(), False, os.getpid(), platform.node())
        self._publish = publish
        self._another_is_there = another_is_there
        self._senior = SeniorsWord(leave)
        self._tell()

    def serve(self) -> None:
        """From now on this node is part of a flight; nobody who comes later takes its place."""
        if not self.claim.serving:
            self.claim = self.claim._replace(serving=True)
            self._tell()

    def fly(self, scenario: str) -> None:
        """From now on this node, a plant, flies the scenario of this text."""
        self.claim = self.claim._replace(scenario=checksum(scenario))
        self._tell()

    def hear(self, other: Claim) -> None:
        """Leave if a senior node of the same kind is there; `BorderError` for a claim without a node."""
        if other.kind != self.claim.kind or other.id == self.claim.id:
            return
        if not other.senior_to(self.claim):
            self.others += 1
            return
        since = time.strftime("%H:%M:%S", time.gmtime(other.since_ns / 1e9))
        told = (
            f"another {other.kind} is here already (process {other.pid} on {other.host}, since {since} UTC)"
        )
        remedy = "end that one first, or give this one another namespace or ROS domain"
        self._senior.heed(told, remedy, self._another_is_there, "claim")

    def look_again(self) -> None:
        """Leave for a senior whose claim came before the graph showed it."""
        self._senior.look_again()

    def _tell(self) -> None:
        self._publish(String(data=json.dumps(self.claim._asdict())))

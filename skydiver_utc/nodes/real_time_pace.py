"""The pace of a real-time flight: step k at t_0 + k dt of the steady clock, whatever commands come.

A timer only wakes the node up; the deadlines are absolute, so the rate does not drift, and a plant that was held up
catches up with the clock. Timer and deadlines must read one clock: two steady clocks of a machine drift apart.
"""

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.nodes.command_accounts import CommandAccounts, NeutralRamp
from skydiver_utc.parameters import Scenario

Vector = NDArray[np.float64]
Answer = tuple[int, Vector]  # the step of the state that a command answers, and the command (4,)


class RealTimePace:
    """Steps the plant through `step(command)` when it is due, with the command in force then."""

    def __init__(
        self,
        scenario: Scenario,
        initial: Vector,
        neutral_after_s: float,
        neutral_rate_rad_s: float,
        step: Callable[[Vector], bool],
        now_ns: Callable[[], int],
    ) -> None:
        control = initial * (1.0, 0.0, 0.0, 0.0)
        ramp = NeutralRamp(
            round(neutral_after_s / scenario.dt_s), neutral_rate_rad_s * scenario.dt_s, control
        )
        self.accounts = CommandAccounts(scenario.steps, initial, ramp)
        self._dt_s = scenario.dt_s
        self._dt_ns = scenario.dt_ns
        self._step = step
        self._now_ns = now_ns
        self.late_steps = 0  # later than the time of the step that follows
        self._began_ns = 0
        self._lateness_ns = np.zeros(scenario.steps, dtype=np.int64)

    @property
    def begun(self) -> bool:
        """True from the first command on."""
        return self._began_ns > 0

    def tick(self, answers: Iterable[Answer], may_begin: Callable[[], bool] = lambda: True) -> None:
        """Take in the commands that have come, then step as often as is due.

        `may_begin` is asked once the first command is there: time begins when it says so.
        """
        for answered, command in answers:
            self.accounts.receive(answered, command)
        if not self.begun:
            if self.accounts.newest < 0 or not may_begin():
                return
            self._began_ns = self._now_ns()
            self._command = self.accounts.choose()
        while (late_ns := self._elapsed_ns() - self.accounts.steps * self._dt_ns) >= 0:
            self._lateness_ns[self.accounts.steps - 1] = late_ns
            self.late_steps += late_ns > self._dt_ns
            if not self._step(self._command):
                return
            self._command = self.accounts.choose()

    def due_step(self) -> int:
        """The step whose time it is."""
        return self._elapsed_ns() // self._dt_ns

    def _elapsed_ns(self) -> int:
        return self._now_ns() - self._began_ns

    def told(self) -> dict[str, object]:
        """The account of the commands, and how well the steps kept the time."""
        late_ns = self._lateness_ns[: max(1, self.accounts.steps)]
        elapsed_s = self._elapsed_ns() * 1e-9 if self.begun else 0.0
        return {
            **self.accounts.told(),
            "late_steps": self.late_steps,
            "lateness_ms_median": float(np.median(late_ns)) * 1e-6,
            "lateness_ms_p99": float(np.percentile(late_ns, 99)) * 1e-6,
            "lateness_ms_max": float(late_ns.max()) * 1e-6,
            "rate_Hz": self.accounts.steps / elapsed_s if elapsed_s else 0.0,
        }

    def sentence(self) -> str:
        """The account in words, empty where every step was on time."""
        a = self.accounts
        held = a.steps - a.on_time
        if not held:
            return ""
        text = (
            f"{held} of {a.steps} steps held an older command ({a.late} late, {a.stale} stale, {a.lost} lost)"
        )
        silence = f", at most {a.longest_silence * self._dt_s:.3f} s on end"
        neutral = f", {a.neutral_steps * self._dt_s:.3f} s in the neutral posture" if a.neutral_steps else ""
        return text + silence + neutral

    def silence_sentence(self) -> str:
        """Why the flight ended without a controller, empty where commands came to the end."""
        a = self.accounts
        if not a.in_neutral:
            return ""
        return (
            f"no command answered a state after step {a.newest} for {a.silence * self._dt_s:.3f} s to the end:"
            " the skydiver fell on in the neutral posture"
        )

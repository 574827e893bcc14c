# SPDX-License-Identifier: Apache-2.0
"""The plant's steps in real time: which command is in force at each step, and an account of all.

Step k is due at t_0 + k dt of the steady clock, whatever commands come. At t_k the plant takes the newest command
that it has. The best that can be there answers state k-1: the step is on time. Otherwise the command of an older
state is held, and that of state k-1 is late (it comes after t_k and is used from then on), stale (it comes after a
newer one and is not used) or lost (it never comes), so that

    on_time + late + stale + lost = steps

Step 0 is on time: the run begins with the first command, and step 1 has that one, too.
"""

from array import array
from collections.abc import Callable

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.loop.outcome import Outcome


class CommandAccount:
    """Takes in commands by the step of the state that they answer; `choose` at each step, in order.

    When no new one comes the last command is held for `after_steps`; then the command goes in a straight line of
    `ramp_steps` to `neutral` (m,).
    """

    def __init__(self, steps: int, neutral: Array, after_steps: int, ramp_steps: int) -> None:
        self._answered = bytearray(steps)
        self._neutral, self._after_steps, self._ramp_steps = neutral, after_steps, ramp_steps
        self._newest_command = neutral.copy()
        self.newest = -1  # the step of the newest state that was answered
        self.steps = self.on_time = self.late = self.stale = self.repeated = 0
        self.neutral_steps = self.longest_silence = 0

    @property
    def lost(self) -> int:
        """Steps whose own command has not come."""
        return self.steps - self.on_time - self.late - self.stale

    @property
    def silence(self) -> int:
        """For how many steps, up to the last one, no new command was there; 0 when it was on time."""
        return max(0, self.steps - 2 - self.newest)

    @property
    def in_neutral(self) -> bool:
        """True while commands have stopped for so long that the command in force goes to neutral."""
        return self.silence > self._after_steps

    def receive(self, answers: int, command: Array) -> None:
        """A command (m,) that answers a state published already."""
        if self._answered[answers]:
            self.repeated += 1
            return
        self._answered[answers] = 1
        if answers < self.newest:
            self.stale += 1
            return
        if self.steps >= answers + 2:
            self.late += 1
        self.newest = answers
        self._newest_command = command.copy()

    def choose(self) -> Array:
        """The command (m,) in force over the next step."""
        self.on_time += self.newest >= self.steps - 1  # also at step 0, before any command
        self.steps += 1
        self.longest_silence = max(self.longest_silence, self.silence)
        if not self.in_neutral:
            return self._newest_command
        self.neutral_steps += 1
        share = min(1.0, (self.silence - self._after_steps) / max(1, self._ramp_steps))
        return self._newest_command + share * (self._neutral - self._newest_command)

    def as_dict(self) -> dict[str, int]:
        """The account by name."""
        return {
            "steps": self.steps,
            "on_time": self.on_time,
            "late": self.late,
            "stale": self.stale,
            "lost": self.lost,
            "repeated": self.repeated,
            "neutral_steps": self.neutral_steps,
            "longest_silence_steps": self.longest_silence,
        }


class RealTimePace:
    """Calls `step(command)` as often as is due by `now_ns`; `step` returns False where the run is over.

    The deadlines are absolute: the rate does not drift, and a plant that was held up catches up with the clock.
    """

    def __init__(
        self,
        account: CommandAccount,
        dt_ns: int,
        step: Callable[[Array], bool],
        now_ns: Callable[[], int],
    ) -> None:
        self.account = account
        self.late_steps = 0  # later than the time of the step that follows
        self._dt_ns, self._step, self._now_ns = dt_ns, step, now_ns
        self._began_ns = 0
        self._lateness_ns = array("q")

    @property
    def begun(self) -> bool:
        """True from the first command on."""
        return self._began_ns > 0

    def tick(self) -> None:
        """Begin when the first command is there; then step as often as is due."""
        if not self.begun:
            if self.account.newest < 0:
                return
            self._began_ns = self._now_ns()
            self._command = self.account.choose()
        while (late_ns := self._elapsed_ns() - self.account.steps * self._dt_ns) >= 0:
            self._lateness_ns.append(late_ns)
            self.late_steps += late_ns > self._dt_ns
            if not self._step(self._command):
                return
            self._command = self.account.choose()

    def _elapsed_ns(self) -> int:
        return self._now_ns() - self._began_ns

    def as_dict(self) -> dict[str, object]:
        """The account of the commands, and how well the steps kept the time."""
        late_ms = np.array(self._lateness_ns or [0], dtype=np.int64) * 1e-6
        elapsed_s = max(1, self._elapsed_ns()) * 1e-9
        return {
            **self.account.as_dict(),
            "late_steps": self.late_steps,
            "lateness_ms_median": float(np.median(late_ms)),
            "lateness_ms_p99": float(np.percentile(late_ms, 99)),
            "lateness_ms_max": float(late_ms.max()),
            "rate_Hz": self.account.steps / elapsed_s,
        }

    def sentence(self) -> str:
        """The account in words, empty where every step was on time."""
        a, dt_s = self.account, self._dt_ns * 1e-9
        if a.on_time == a.steps:
            return ""
        neutral = f", {a.neutral_steps * dt_s:.3f} s on the way to neutral" if a.neutral_steps else ""
        return (
            f"{a.steps - a.on_time} of {a.steps} steps held an older command ({a.late} late, {a.stale} stale,"
            f" {a.lost} lost), at most {a.longest_silence * dt_s:.3f} s on end{neutral}"
        )

    def ending(self, outcome: Outcome, reason: str) -> tuple[Outcome, str]:
        """Outcome and reason with the account; a run whose commands stopped has no command, though it went on."""
        account, sentence = self.account, self.sentence()
        if outcome is Outcome.COMPLETED and account.in_neutral:
            silent_s = account.silence * self._dt_ns * 1e-9
            reason = (
                f"no command answered a state after step {account.newest} for {silent_s:.3f} s to the end"
            )
            return Outcome.NO_COMMAND, reason
        return outcome, f"{reason}; {sentence}" if sentence else reason

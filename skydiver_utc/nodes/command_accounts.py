"""Which command is in force at each step of a real-time flight, and an account of every step. No rclpy here.

At t_k the plant takes the newest command that it has. The best that can be there answers state k-1: the step is on
time. Otherwise the command of an older state is held, and that of state k-1 is late (it comes after t_k and is
used from then on), stale (it comes after a newer one and is not used) or lost (it never comes), so that

    on_time + late + stale + lost = steps

Step 0 is on time: the flight begins when the first command is there, and step 1 has that one, too.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class NeutralRamp:
    """Where a plant goes that hears no commands: alpha to 0 at `rate`, the rest as `control` (4,) says at once."""

    after_steps: int  # silence that is bridged by the last command
    rate: float  # rad of alpha a step
    control: Vector

    def step(self, command: Vector) -> Vector:
        """The command (4,) one step after this one."""
        following = self.control.copy()
        following[3] = command[3] - np.clip(command[3], -self.rate, self.rate)
        return following


class CommandAccounts:
    """Takes in commands by the step of the state that they answer; `choose` at each step, in order."""

    def __init__(self, steps: int, initial: Vector, neutral: NeutralRamp) -> None:
        self._answered = bytearray(steps)
        self._neutral = neutral
        self._newest_command = initial.copy()
        self._in_force = initial.copy()
        self.newest = -1
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
        """True while commands have stopped for so long that the plant goes to the neutral posture."""
        return self.silence > self._neutral.after_steps

    def receive(self, answers: int, command: Vector) -> None:
        """A command (4,) that answers a state published already."""
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

    def choose(self) -> Vector:
        """The command (4,) in force over the next step."""
        k = self.steps
        self.steps += 1
        if k == 0 or self.newest >= k - 1:
            self.on_time += 1
        self.longest_silence = max(self.longest_silence, self.silence)
        if self.in_neutral:
            self.neutral_steps += 1
            self._in_force = self._neutral.step(self._in_force)
        else:
            self._in_force = self._newest_command
        return self._in_force

    def told(self) -> dict[str, int]:
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

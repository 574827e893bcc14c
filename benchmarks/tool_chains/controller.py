# SPDX-License-Identifier: Apache-2.0
"""A tool chain behind the protocol of the package's controllers."""

import numpy as np

from skydiver_utc.controllers.protocol import Decision, Status
from tool_chains.model import reduced
from tool_chains.program import Array, Program, Solve


class ToolChainController:
    """Keeps a control sequence and has it solved anew at each decision, as `GaussNewtonController` does."""

    telemetry_names: tuple[str, ...] = ("iterations",)

    def __init__(self, program: Program, solve: Solve, initial: Array) -> None:
        self._program, self._solve, self._initial = program, solve, initial
        self.preview_steps = program.horizon.preview_steps
        self.reset()

    def reset(self) -> None:
        """Start again from the initial control."""
        self.resume(self._initial)

    def resume(self, control: Array) -> None:
        """Start from this control, the one applied last, held over the horizon."""
        self._applied = control.copy()
        self._sequence = np.tile(control, (self._program.horizon.blocks, 1))

    def decide(self, state: Array, preview: Array) -> Decision:
        """Solve from the sequence at hand and take the first control; without a solution keep the control."""
        program, horizon = self._program, self._program.horizon
        reference = horizon.reference(preview).ravel()
        solution = self._solve(reduced(state), self._applied, reference, self._sequence)
        iterations = np.array([float(solution.iterations)])
        if not solution.found:
            self.resume(self._applied)
            return Decision(self._applied.copy(), iterations, Status.KEPT_PREVIOUS)
        sequence = np.clip(solution.sequence, program.minimum, program.maximum)
        self._applied = horizon.first_period(sequence, self._applied)
        self._sequence = horizon.one_period_on(sequence)
        return Decision(self._applied.copy(), iterations, Status.SOLVED)

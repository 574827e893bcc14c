# SPDX-License-Identifier: Apache-2.0
"""The end of a run in one word and one sentence."""

from enum import Enum


class Outcome(str, Enum):
    """The end of a run."""

    COMPLETED = "completed"
    ROLLED_OVER = "rolled_over"
    DIVERGED = "diverged"
    NO_COMMAND = "no_command"
    ABORTED = "aborted"


REACHED_THE_END = (Outcome.COMPLETED, Outcome.ROLLED_OVER)

# SPDX-License-Identifier: Apache-2.0
"""The error of this room."""


class AnalysisError(Exception):
    """A recording cannot be analysed; the text is one sentence that names the fault and the remedy."""

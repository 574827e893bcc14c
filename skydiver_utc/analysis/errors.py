"""The one error of this package."""


class AnalysisError(Exception):
    """A recording cannot be analysed; the text is one sentence that names the thing and says what to do."""

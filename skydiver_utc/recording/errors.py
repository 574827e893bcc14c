"""The one error of this package."""


class RecordingError(Exception):
    """A bag cannot be written or read; the text is one sentence that names the thing and says what to do."""

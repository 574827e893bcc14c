"""The one error of this package."""


class VerbError(Exception):
    """A verb cannot do its job; the text is one sentence, `exit_code` that of the process."""

    def __init__(self, sentence: str, exit_code: int = 2) -> None:
        super().__init__(sentence)
        self.exit_code = exit_code

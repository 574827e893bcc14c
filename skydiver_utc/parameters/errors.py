# SPDX-License-Identifier: Apache-2.0
"""The errors of a wrong setting."""


class ParameterError(ValueError):
    """A parameter, file or name is wrong; the message is one sentence that says what to do."""


class MissingModuleError(ParameterError):
    """The module of a `module:Class` is not where Python looks for it; `module` is its name."""

    def __init__(self, module: str, field: str = "") -> None:
        super().__init__(
            (f"parameter {field}: " if field else "")
            + f"there is no module {module}: put {module}.py into the current folder, beside the scenario file that is"
            " given, or on the PYTHONPATH"
        )
        self.module = module

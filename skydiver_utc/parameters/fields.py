# SPDX-License-Identifier: Apache-2.0
"""The unit, description and bounds of a setting."""

import re
from functools import cache
from typing import Any, get_origin

from pydantic import BaseModel, ConfigDict, Field, model_validator
from typing_extensions import Self

# All of Unicode's but tab and newline, and those that turn the direction of a text.
_CONTROL = re.compile("[\\x00-\\x08\\x0b-\\x1f\\x7f-\\x9f\\u202a-\\u202e\\u2066-\\u2069]")


class Parameters(BaseModel):
    """Base of all settings: immutable, unknown names refused, every number finite, no text for a number.

    Texts have no control characters, which a terminal would obey.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True, strict=True)

    @model_validator(mode="before")
    @classmethod
    def _rows_as_tuples(cls, content: Any) -> Any:
        """YAML's lists as the tuples that frozen settings hold, but for a field that is a list."""
        if not isinstance(content, dict):
            return content
        lists, blocks = _lists_and_blocks(cls)
        found = {}
        for name, value in content.items():
            if name in blocks and isinstance(value, dict):
                found[name] = value  # its own class does the same
                continue
            try:
                rows = _checked(value)
            except _ControlCharacterError as error:
                raise ValueError(f"{name} holds a control character: take it out") from error
            found[name] = value if name in lists else rows
        return found

    def __hash__(self) -> int:
        return hash(self.model_dump_json())

    def replace(self, **changes: Any) -> Self:
        """A copy with other values, validated again; raises `pydantic.ValidationError`."""
        return type(self).model_validate({**dict(self), **changes})

    def as_dict(self) -> dict[str, Any]:
        """Plain data: blocks as dicts, rows as lists."""
        return self.model_dump(mode="json")


class SlotSettings(Parameters):
    """Base of the settings of a plant, reference, controller, estimator or disturbance."""

    kind: str


def quantity(
    unit: str,
    description: str,
    *,
    gt: float | None = None,
    ge: float | None = None,
    lt: float | None = None,
    le: float | None = None,
) -> Any:
    """Annotation of a number, or of a row of them: unit ("1" where there is none), meaning and bounds."""
    return Field(description=description, json_schema_extra={"unit": unit}, gt=gt, ge=ge, lt=lt, le=le)


def text(description: str) -> Any:
    """Annotation of a text, a truth value or a table."""
    return Field(description=description)


class _ControlCharacterError(Exception):
    pass


def _checked(value: Any) -> Any:
    """Plain data with tuples in the place of lists; names of fields are texts, too."""
    if isinstance(value, str):
        if _CONTROL.search(value):
            raise _ControlCharacterError
    elif isinstance(value, dict):
        return {_checked(key): _checked(item) for key, item in value.items()}
    elif isinstance(value, list | tuple):
        rows = tuple(map(_checked, value))
        return rows if isinstance(value, list) else value
    return value


@cache
def _lists_and_blocks(settings: type[BaseModel]) -> tuple[frozenset[str], frozenset[str]]:
    """The fields that are lists, and those that are settings of a class of their own."""
    types = {name: field.annotation for name, field in settings.model_fields.items()}
    return (
        frozenset(name for name, kind in types.items() if get_origin(kind) is list),
        frozenset(
            name
            for name, kind in types.items()
            if get_origin(kind) is None and isinstance(kind, type) and issubclass(kind, Parameters)
        ),
    )

# SPDX-License-Identifier: Apache-2.0
"""The unit, description and bounds of a setting."""

from functools import cache
from typing import Any, get_origin

from pydantic import BaseModel, ConfigDict, Field, model_validator
from typing_extensions import Self


class Parameters(BaseModel):
    """Base of all settings: immutable, unknown names refused, every number finite, no text for a number."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True, strict=True)

    @model_validator(mode="before")
    @classmethod
    def _rows_as_tuples(cls, content: Any) -> Any:
        """YAML's lists as the tuples that frozen settings hold, but for a field that is a list."""
        if not isinstance(content, dict):
            return content
        kept = _lists_and_blocks(cls)
        return {name: value if name in kept else _tuples(value) for name, value in content.items()}

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


@cache
def _lists_and_blocks(settings: type[BaseModel]) -> frozenset[str]:
    """The fields that are lists, or settings of a class of their own."""
    kinds = {name: field.annotation for name, field in settings.model_fields.items()}
    lists = {name for name, kind in kinds.items() if list in (kind, get_origin(kind))}
    # On Python 3.10 tuple[float, ...] counts as a class.
    classes = {name: kind for name, kind in kinds.items() if get_origin(kind) is None}
    return frozenset(lists).union(
        name for name, kind in classes.items() if isinstance(kind, type) and issubclass(kind, Parameters)
    )


def _tuples(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _tuples(item) for name, item in value.items()}
    return tuple(map(_tuples, value)) if isinstance(value, list) else value

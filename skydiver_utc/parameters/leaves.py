# SPDX-License-Identifier: Apache-2.0
"""The numbers, switches and choices of settings by dotted name, for ROS parameters and tables."""

from collections.abc import Iterator, Mapping
from types import NoneType
from typing import Any, Literal, NamedTuple, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo


class Leaf(NamedTuple):
    """One number, switch, choice or row of numbers."""

    name: str
    value: float | int | bool | str | tuple[float, ...]
    minimum: float | None
    maximum: float | None
    choices: tuple[str, ...]
    unit: str
    description: str


def leaves(settings: BaseModel, prefix: str = "") -> list[Leaf]:
    """Scalars and rows of numbers by dotted name, disturbances by their number, without texts, tables and None."""
    return [
        leaf
        for name, field in type(settings).model_fields.items()
        if name != "kind"
        for leaf in _leaves_of(prefix + name, getattr(settings, name), field)
    ]


def _leaves_of(name: str, value: Any, field: FieldInfo) -> Iterator[Leaf]:
    choices = _choices(field.annotation)
    if isinstance(value, BaseModel):
        yield from leaves(value, f"{name}.")
    elif isinstance(value, Mapping) or _is_row(value, BaseModel):
        for key, item in value.items() if isinstance(value, Mapping) else enumerate(value):
            yield from _leaves_of(f"{name}.{key}", item, field)
    elif (
        isinstance(value, int | float) or (isinstance(value, str) and choices) or _is_row(value, int | float)
    ):
        yield _leaf(name, value, field, choices)


def _is_row(value: Any, kind: Any) -> bool:
    return isinstance(value, tuple) and value != () and all(isinstance(item, kind) for item in value)


def _choices(annotation: Any) -> tuple[str, ...]:
    """The texts that a field may be, empty where any text is valid."""
    if get_origin(annotation) is Literal:
        return get_args(annotation)
    parts = [part for part in get_args(annotation) if part is not NoneType]
    return _choices(parts[0]) if len(parts) == 1 and get_origin(annotation) is not tuple else ()


def _leaf(name: str, value: Any, field: FieldInfo, choices: tuple[str, ...]) -> Leaf:
    # The description of an optional number, `Annotated[float, ...] | None`, is at its number.
    inner = (
        part for item in get_args(field.annotation) for part in get_args(item) if isinstance(part, FieldInfo)
    )
    field = field if field.description else next(inner, field)
    extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
    minimum, maximum = _bound(field, "ge", "gt"), _bound(field, "le", "lt")
    return Leaf(name, value, minimum, maximum, choices, str(extra.get("unit", "")), field.description or "")


def _bound(field: FieldInfo, *names: str) -> float | None:
    found = (getattr(item, name) for item in field.metadata for name in names if hasattr(item, name))
    return next(map(float, found), None)

# SPDX-License-Identifier: Apache-2.0
"""The numbers, switches and choices of settings by dotted name, for ROS parameters and tables."""

from collections.abc import Iterator, Mapping
from types import NoneType
from typing import Any, Literal, NamedTuple, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel
from pydantic.fields import FieldInfo

Kind = Literal["float", "int", "bool", "str", "floats"]


class Leaf(NamedTuple):
    """One number, switch, choice or row of numbers."""

    name: str
    value: float | int | bool | str | tuple[float, ...]
    kind: Kind
    minimum: float | None
    maximum: float | None
    choices: tuple[str, ...]
    unit: str
    description: str


def leaves(settings: BaseModel, prefix: str = "") -> list[Leaf]:
    """Scalars and rows of numbers by dotted name, disturbances by their number, without texts, tables and None."""
    return list(_leaves_of(settings, prefix))


def _leaves_of(settings: BaseModel, prefix: str) -> Iterator[Leaf]:
    for name, field in type(settings).model_fields.items():
        value = getattr(settings, name)
        if isinstance(value, BaseModel):
            yield from _leaves_of(value, f"{prefix}{name}.")
        elif isinstance(value, Mapping):
            for key, item in value.items():
                if isinstance(item, BaseModel):
                    yield from _leaves_of(item, f"{prefix}{name}.{key}.")
                elif kind := _kind(item, ()):
                    yield _leaf(f"{prefix}{name}.{key}", item, kind, field, ())
        elif name == "disturbances":
            for i, item in enumerate(value):
                yield from _leaves_of(item, f"{prefix}{name}.{i}.")
        else:
            choices = _choices(field.annotation)
            if name != "kind" and (kind := _kind(value, choices)):
                yield _leaf(prefix + name, value, kind, field, choices)


def _kind(value: Any, choices: tuple[str, ...]) -> Kind | None:
    match value:
        case bool():
            return "bool"
        case int():
            return "int"
        case float():
            return "float"
        case str() if choices:
            return "str"
        case tuple() if value and all(isinstance(item, int | float) for item in value):
            return "floats"
    return None


def _choices(annotation: Any) -> tuple[str, ...]:
    """The texts that a field may be, empty where any text is valid."""
    if get_origin(annotation) is Literal:
        return get_args(annotation)
    parts = [part for part in get_args(annotation) if part is not NoneType]
    return _choices(parts[0]) if len(parts) == 1 and get_origin(annotation) is not tuple else ()


def _leaf(name: str, value: Any, kind: Kind, field: FieldInfo, choices: tuple[str, ...]) -> Leaf:
    # The description of an optional number, `Annotated[float, ...] | None`, is at its number.
    inner = (
        part for item in get_args(field.annotation) for part in get_args(item) if isinstance(part, FieldInfo)
    )
    field = field if field.description else next(inner, field)
    extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
    bounds: dict[str, float] = {}
    for item in field.metadata:
        match item:
            case Ge(ge=bound) | Gt(gt=bound):
                bounds["minimum"] = float(bound)  # type: ignore[arg-type]
            case Le(le=bound) | Lt(lt=bound):
                bounds["maximum"] = float(bound)  # type: ignore[arg-type]
    return Leaf(
        name=name,
        value=value,
        kind=kind,
        minimum=bounds.get("minimum"),
        maximum=bounds.get("maximum"),
        choices=choices,
        unit=str(extra.get("unit", "")),
        description=field.description or "",
    )

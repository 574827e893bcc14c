"""A scenario's scalar parameters by dotted name, for ROS parameters and overrides."""

from collections.abc import Iterator
from types import NoneType, UnionType
from typing import Any, Literal, NamedTuple, Union, get_args, get_origin

import msgspec

from skydiver_utc.parameters.scenario import Scenario

Kind = Literal["float", "int", "bool", "str", "floats"]


class Leaf(NamedTuple):
    """One scalar (or one list of numbers) of a scenario."""

    name: str
    value: float | int | bool | str | tuple[float, ...]
    kind: Kind
    minimum: float | None
    maximum: float | None
    choices: tuple[str, ...]
    unit: str
    description: str


def leaves(scenario: Scenario) -> list[Leaf]:
    """Scalar parameters of the scenario by dotted name; tables and names are left out."""
    return list(_leaves_of(scenario, ""))


def _leaves_of(parameters: Any, prefix: str) -> Iterator[Leaf]:
    for field in msgspec.structs.fields(parameters):
        value = getattr(parameters, field.name)
        name = prefix + field.name
        if isinstance(value, msgspec.Struct):
            yield from _leaves_of(value, name + ".")
        elif _is_scalar(value) and name not in ("name", "title", "description"):
            yield _leaf(name, value, field.type)


def _is_scalar(value: Any) -> bool:
    """True for one number, truth value or text, and for a row of numbers; not for tables and what is not set."""
    if isinstance(value, tuple):
        return all(isinstance(item, int | float) for item in value)
    return isinstance(value, bool | int | float | str)


def _leaf(name: str, value: Any, annotation: Any) -> Leaf:
    if get_origin(annotation) in (Union, UnionType):
        annotation = next(one for one in get_args(annotation) if one is not NoneType)
    meta = next((m for m in getattr(annotation, "__metadata__", ()) if isinstance(m, msgspec.Meta)), None)
    base = getattr(annotation, "__origin__", annotation) if meta else annotation
    kind: Kind
    match value:
        case bool():
            kind = "bool"
        case int():
            kind = "int"
        case float():
            kind = "float"
        case str():
            kind = "str"
        case _:
            kind = "floats"
    return Leaf(
        name=name,
        value=value,
        kind=kind,
        minimum=_bound(meta, "ge", "gt"),
        maximum=_bound(meta, "le", "lt"),
        choices=get_args(base) if get_origin(base) is Literal else (),
        unit=(meta.extra or {}).get("unit", "") if meta else "",
        description=(meta.description or "") if meta else "",
    )


def _bound(meta: msgspec.Meta | None, *names: str) -> float | None:
    bounds = [getattr(meta, n) for n in names if meta is not None and getattr(meta, n) is not None]
    return float(bounds[0]) if bounds else None

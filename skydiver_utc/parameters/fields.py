"""What every parameter field carries: a unit, a description and bounds."""

from typing import Any

import msgspec


class Parameters(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Base of all parameter sets: immutable, unknown keys refused."""


def quantity(
    unit: str,
    description: str,
    *,
    gt: float | None = None,
    ge: float | None = None,
    lt: float | None = None,
    le: float | None = None,
) -> msgspec.Meta:
    """Annotation of one number: its unit ("1" where it has none), meaning and bounds."""
    bounds: dict[str, Any] = {"gt": gt, "ge": ge, "lt": lt, "le": le}
    return msgspec.Meta(description=description, extra={"unit": unit}, **bounds)


def text(description: str) -> msgspec.Meta:
    """Annotation of one text field."""
    return msgspec.Meta(description=description, extra={"unit": ""})

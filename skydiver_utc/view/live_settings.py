# SPDX-License-Identifier: Apache-2.0
"""The settings that a page can change: each number, switch and choice of reference and controller, with a range."""

import re
from collections.abc import Iterator
from typing import NamedTuple

from skydiver_utc.parameters import Leaf, Scenario, leaves

# A slider reaches so many times the scenario's value, and down to a share of it where the sign may not change.
_FACTOR, _SHARE = 5.0, 0.01
# A setting that is zero has a slider over its bounds where these are no further apart.
_WIDEST = 1000.0
_STEPS = 200


class Range(NamedTuple):
    """Ends and step of a slider."""

    minimum: float
    maximum: float
    step: float


def settings_to_change(scenario: Scenario) -> Iterator[Leaf]:
    """The settings of the reference and the controller; a row of numbers as one each, `name.0` and so on."""
    for leaf in leaves(scenario):
        if leaf.name.startswith(("reference.", "controller.")):
            if isinstance(leaf.value, tuple):
                for i, value in enumerate(leaf.value):
                    kind = "int" if isinstance(value, int) else "float"
                    yield leaf._replace(name=f"{leaf.name}.{i}", value=value, kind=kind)  # type: ignore[arg-type]
            else:
                yield leaf


def slider_range(leaf: Leaf) -> Range | None:
    """The range of a number's slider, around its value and inside its bounds; None where it needs a field to type in.

    A value that may be negative by its bounds can change its sign; any other stays above a hundredth of itself.
    """
    value = float(leaf.value)  # type: ignore[arg-type]
    low = float("-inf") if leaf.minimum is None else leaf.minimum
    high = float("inf") if leaf.maximum is None else leaf.maximum
    if value == 0.0:
        if high - low > _WIDEST:
            return None
    elif value < 0.0 or (leaf.minimum is not None and leaf.minimum < 0.0):
        low, high = max(low, -_FACTOR * abs(value)), min(high, _FACTOR * abs(value))
    else:
        low, high = max(low, _SHARE * value), min(high, _FACTOR * value)
    if leaf.kind == "int":
        return Range(int(max(low, min(value, 1.0))), int(high), 1)
    return Range(low, high, (high - low) / _STEPS)


def label(leaf: Leaf) -> str:
    """Name without the slot, and unit."""
    name, unit = leaf.name.split(".", 1)[-1], "" if leaf.unit == "1" else leaf.unit
    name = re.sub(f"_{re.escape(unit.replace('/', '_'))}$", "", name, flags=re.IGNORECASE)
    return name.replace("_", " ") + (f" [{unit}]" if unit else "")

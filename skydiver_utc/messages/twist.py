# SPDX-License-Identifier: Apache-2.0
"""Values in the components of a geometry_msgs/Twist, named `linear.x` to `angular.z`."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.messages.errors import refuse_non_finite

Vector = NDArray[np.float64]
TWIST_COMPONENTS = tuple(f"{part}.{axis}" for part in ("linear", "angular") for axis in "xyz")


def fill_twist(twist: Any, components: Sequence[str], values: Vector) -> Any:
    """Write values (n,) into these components, one each; returns the twist."""
    for component, value in zip(components, values.tolist(), strict=True):
        part, _, axis = component.partition(".")
        setattr(getattr(twist, part), axis, value)
    return twist


def read_twist(twist: Any, components: Sequence[str]) -> Vector:
    """The values (n,) of these components."""
    parts = (component.partition(".") for component in components)
    values = np.array([getattr(getattr(twist, part), axis) for part, _, axis in parts], dtype=np.float64)
    refuse_non_finite(values, components)
    return values

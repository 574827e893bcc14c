# SPDX-License-Identifier: Apache-2.0
"""A pose (7,), position [m] and quaternion x y z w, in the fields of a message."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def fill_pose(position: Any, quaternion: Any, pose: NDArray[np.float64]) -> None:
    """Write a pose (7,) into a Point or Vector3 and a Quaternion."""
    position.x, position.y, position.z, quaternion.x, quaternion.y, quaternion.z, quaternion.w = pose.tolist()

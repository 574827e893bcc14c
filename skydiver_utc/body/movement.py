# SPDX-License-Identifier: Apache-2.0
"""The joint angles of a posture and its movement pattern over the pattern angle alpha."""

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.arrays import Array
from skydiver_utc.body.posture import pattern_direction, posture_angles, refuse_beyond
from skydiver_utc.body.segments import JOINTS
from skydiver_utc.parameters import MovementPattern, ParameterError, Posture, PosturePath, SkydiverSettings

# Two postures that differ by less are the same: files hold degrees with six decimals.
_SAME_POSTURE_RAD = 1e-6


class Movement(NamedTuple):
    """Joint angles (..., 15, 3) [rad] at pattern angles (...) [rad], and their derivative, in the order of `JOINTS`."""

    angles: Callable[[Any], Array]
    slope: Callable[[Any], Array]


def movement(posture: Posture, pattern: MovementPattern | PosturePath, ratio: float = 1.0) -> Movement:
    """The body's motion over alpha: along a direction from the posture, or through the postures of a path.

    A path is of piecewise cubics: angles stay between their two neighbours, slopes are continuous. `ratio` multiplies
    the distance of all joint angles from those of the posture.
    """
    neutral = posture_angles(posture)
    if isinstance(pattern, MovementPattern):
        direction = ratio * pattern_direction(pattern)
        return Movement(
            partial(_along, neutral, direction), partial(_along, direction, np.zeros_like(direction))
        )
    from scipy.interpolate import PchipInterpolator

    rows = np.array([posture_angles(keyframe.posture) for keyframe in pattern.keyframes])
    rows += (ratio - 1.0) * (rows - neutral)
    path = PchipInterpolator([keyframe.alpha for keyframe in pattern.keyframes], rows)
    return Movement(path, path.derivative())


def _along(neutral: Array, direction: Array, alpha: Any) -> Array:
    """neutral + alpha * direction."""
    return neutral + np.multiply.outer(alpha, direction)


def check_movement(settings: SkydiverSettings, moves: Movement) -> None:
    """Refuse a movement that the body cannot take between the smallest and the largest alpha.

    Raises `ParameterError` for joint angles beyond their ranges (in between they are between those that are
    checked), a path that does not cover the range of alpha, and one that does not start in the posture.
    """
    limits, posture, pattern = settings.subject.joint_limits, settings.posture, settings.pattern
    lowest, largest = settings.limits.alpha
    refuse_beyond(limits, posture_angles(posture), f"posture {posture.name}")
    if isinstance(pattern, MovementPattern):
        for alpha in (lowest, largest):
            what = f"posture {posture.name} with pattern {pattern.name} at alpha = {alpha:g}"
            refuse_beyond(limits, moves.angles(alpha), what)
        return
    first, last = pattern.keyframes[0].alpha, pattern.keyframes[-1].alpha
    if lowest < first or largest > last:
        raise ParameterError(
            f"pattern {pattern.name} goes from alpha = {first:g} to {last:g}, plant.limits.alpha from"
            f" {lowest:g} to {largest:g}: keep the limits within the path"
        )
    for keyframe in pattern.keyframes:
        what = f"posture {keyframe.posture.name} of pattern {pattern.name}"
        refuse_beyond(limits, posture_angles(keyframe.posture), what)
    start = settings.initial.alpha
    apart = np.abs(moves.angles(start) - posture_angles(posture))
    if apart.max() > _SAME_POSTURE_RAD:
        row, _ = divmod(int(apart.argmax()), apart.shape[1])
        raise ParameterError(
            f"pattern {pattern.name} is not in posture {posture.name} at initial.alpha = {start:g},"
            f" {JOINTS[row]} is {np.rad2deg(apart.max()):.1f} deg off: change posture or initial.alpha"
        )


class Keyframes(NamedTuple):
    """Rows that were kept, rising, and the largest error [rad] of the path at those that were not."""

    kept: NDArray[np.intp]
    error: float


def thin(time_s: Array, angles: Array, tolerance: float) -> Keyframes:
    """Rows of postures (n, 45) [rad] whose piecewise cubics, a path's, meet all others to a tolerance [rad].

    From the first and the last on, each stretch that misses the tolerance is given its worst row, until none does.
    """
    from scipy.interpolate import PchipInterpolator

    kept = np.array([0, len(time_s) - 1])
    while True:
        path = PchipInterpolator(time_s[kept], angles[kept])
        errors = np.abs(path(time_s) - angles).max(axis=1)
        errors[kept] = 0.0
        stretches = [(left + 1, right) for left, right in pairwise(kept) if right > left + 1]
        worst = [left + int(errors[left:right].argmax()) for left, right in stretches]
        missing = [row for row in worst if errors[row] > tolerance]
        if not missing:
            return Keyframes(kept, float(errors.max()))
        kept = np.union1d(kept, missing)

# SPDX-License-Identifier: Apache-2.0
"""Metrics that only a skydiver has: rotations by an angle, and which side faces the earth."""

import math
from typing import Any

import numpy as np

from skydiver_utc.analysis.numbers import (
    finite,
    first_step_from,
    largest,
    recorded,
    root_mean_square,
    settled,
    time_of,
)
from skydiver_utc.arrays import Array
from skydiver_utc.loop.run import Run
from skydiver_utc.plants.skydiver.skydiver import SkydiverPlant
from skydiver_utc.references.profiles import Rotation
from skydiver_utc.rotations import dorsal_axis_height, world_up

# Height of the dorsal axis from which on a body faces the earth with one side: 45 deg from the vertical.
_FACING = math.sqrt(0.5)


def skydiver_metrics(run: Run) -> dict[str, Any]:
    """Metrics of a skydiver's run, none of any other plant's; docs/report.md lists them.

    Those of a rotation are None for other references and for a run that ends before the rotation; the angles also for a
    recording that lacks the beginning, the RMSE for one that lacks some of the rotation.
    """
    if not isinstance(run.plant, SkydiverPlant):
        return {}
    facing, since_s = _facing(run)
    height = dorsal_axis_height(run.states)
    return {
        "peak_yaw_rate_deg_s": finite(math.degrees(largest(run.output("yaw_rate")[settled(run)]))),
        **_of_rotation(run),
        "facing": facing,
        "facing_since_s": since_s,
        "min_dorsal_axis": finite(float(np.min(height[recorded(run)], initial=math.inf))),
    }


def angle_turned_deg(run: Run) -> Array:
    """Angle (K+1,) [deg] turned since the start about the vertical (a yaw rate's reference) or in pitch.

    A heading is that of the body's long axis. A pitch is that of the world's up direction in the body's plane
    of symmetry, so that it passes head down without a jump.
    """
    if run.tracked_names == ("yaw_rate",):
        x, y, z, w = np.moveaxis(run.states[:, 3:7], -1, 0)
        angle = np.arctan2(2 * (x * y + z * w), 1 - 2 * (y * y + z * z))
    else:
        up = world_up(run.states)
        angle = np.arctan2(-up[:, 0], up[:, 2])
    turned: Array = np.rad2deg(np.unwrap(angle))
    turned -= turned[0]
    return turned


def _facing(run: Run) -> tuple[str, float | None]:
    height = dorsal_axis_height(run.states)
    belly, back = height > _FACING, height < -_FACING
    for side, name in ((belly, "belly to earth"), (back, "back to earth")):
        if side[-1]:
            others = np.flatnonzero(~side)
            first = int(others[-1]) + 1 if len(others) else 0
            return name, time_of(run, first)
    return "neither", None


def _of_rotation(run: Run) -> dict[str, float | None]:
    reference = run.scenario.reference
    values: dict[str, float | None]
    values = dict.fromkeys(("rmse_rotating_deg_s", "angle_error_deg", "overshoot_deg"))
    if run.error is None or not isinstance(reference, Rotation):
        return values
    error = np.rad2deg(run.error[:, 0])
    start = first_step_from(reference.start_s, run.scenario) - run.first_step
    end = first_step_from(reference.start_s + reference.duration_s, run.scenario) - run.first_step
    if end >= len(error):
        return values
    if start >= 0:
        values["rmse_rotating_deg_s"] = finite(root_mean_square(error[start : end + 1]))
    if run.first_step == 0:
        turned, wanted = angle_turned_deg(run), reference.angle_deg
        beyond = float(np.max(np.sign(wanted) * (turned - wanted)))
        values["angle_error_deg"] = finite(float(turned[-1] - wanted))
        values["overshoot_deg"] = finite(max(beyond, 0.0))
    return values

# SPDX-License-Identifier: Apache-2.0
"""Measured postures: read as whole bodies, thinned to a path, and the settings that fly it."""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import click
import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.body.movement import Keyframes, movement
from skydiver_utc.body.posture import joint_angle_names, joint_ranges, joint_rows, posture_angles
from skydiver_utc.body.segments import JOINTS
from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.settings import load_skydiver, parse_setting
from skydiver_utc.loop.build import build_plant
from skydiver_utc.parameters import ParameterError, Scenario, SkydiverSettings, load_scenario
from skydiver_utc.parameters.body import Keyframe, Posture, PosturePath
from skydiver_utc.plants.skydiver.model import build_model
from skydiver_utc.plants.skydiver.table_error import TableError, table_error
from skydiver_utc.plants.skydiver.trim import DECIMALS
from skydiver_utc.recording.joint_angles import read_joint_angles

# The range of alpha that the motion is laid over [rad].
ALPHA = (0.0, 2.0)
# How long the first and the last posture are held [s].
_BEFORE_S, _AFTER_S = 1.0, 5.0
# Angles that stay within this, less than any measurement resolves, are those of a body at rest.
_MOTIONLESS_RAD = np.deg2rad(0.1)
# Nodes of the plant's table over alpha: at least as dense as the postures, doubled until it is exact enough.
_NODES = (257, 1025)
# Angles beyond the joint limits by less are clipped. Errors of measured gait of up to 5 deg are reasonable: McGinley et
# al., Gait & Posture 29 (2009) 360.
_CLIPPED_DEG = 5.0
# Postures nearer in time are a fault of the file [s].
_SHORTEST_S = 1e-6
_MEND = "cut it into shorter files, or allow a larger --tolerance"


def whole_postures(source: Path, posture: Posture) -> tuple[Array, Array]:
    """Times (n,), all 45 joint angles (n, 45) [rad], where not recorded the posture's; a motionless one is refused."""
    names = joint_angle_names()
    recorded = read_joint_angles(source, names)
    if np.ptp(recorded.values, axis=0).max() < _MOTIONLESS_RAD:
        raise CommandError(f"the postures in {source} do not move: give the recording of a maneuver")
    if recorded.note:
        click.echo(recorded.note, err=True)
    angles = np.tile(posture_angles(posture).ravel(), (len(recorded.time_s), 1))
    angles[:, [names.index(name) for name in recorded.names]] = recorded.values
    return recorded.time_s, angles


def measured(source: Path, plant: SkydiverSettings) -> tuple[Array, Array]:
    """Times (n,) and whole postures (n, 45) [rad]; two of almost one time are refused."""
    time_s, angles = whole_postures(source, plant.posture)
    for before, after in pairwise(time_s.tolist()):
        if after - before < _SHORTEST_S:
            raise CommandError(
                f"two postures in {source}, at {after:g} s, are {after - before:.2g} s apart: leave at least"
                f" {_SHORTEST_S:g} s between them"
            )
    return time_s, angles


def clipped(source: Path, plant: SkydiverSettings, time_s: Array, angles: Array) -> tuple[Array, str]:
    """The angles (n, 45) [rad] clipped to the joint limits, and in words which; one far beyond is refused."""
    limits, names = plant.subject.joint_limits, joint_angle_names()
    lower, upper = (bound.ravel() for bound in joint_ranges(limits))
    clipped = np.clip(angles, lower, upper)
    beyond = np.rad2deg(np.abs(angles - clipped))
    row, column = divmod(int(beyond.argmax()), len(names))
    if beyond[row, column] > _CLIPPED_DEG:
        angle, low, high = (float(np.rad2deg(x)) for x in (angles[row, column], lower[column], upper[column]))
        raise CommandError(
            f"{source} at {time_s[row]:g} s: {names[column]} of {angle:.1f} deg is beyond the joint limits"
            f" {limits.name}, {low:.1f} to {high:.1f} deg, by more than the {_CLIPPED_DEG:g} deg that are clipped:"
            " correct the file, or give limits of this person with --set plant.subject.joint_limits=FILE.yaml"
        )
    most = beyond.max(axis=0)
    which = [f"{names[j]} by {most[j]:.2g}" for j in most.argsort()[::-1] if most[j] > 10.0**-DECIMALS]
    within = f"up to {_CLIPPED_DEG:g} deg beyond the joint limits {limits.name} are clipped"
    return clipped, f"{within}: {', '.join(which)} deg" if which else f"{within}: none is beyond"


def timing(source: Path, scenario: str, settings: Sequence[str], duration_s: float) -> dict[str, object]:
    """Overrides that let alpha go through its range in the measured time; what no flight can follow is refused."""
    found: dict[str, object] = {"duration_s": _BEFORE_S + duration_s + _AFTER_S}
    rate = (ALPHA[1] - ALPHA[0]) / duration_s
    if rate > load_skydiver(scenario, settings).plant.limits.alpha_rate:
        found["plant.limits.alpha_rate"] = rate
    try:
        load_scenario(scenario, dict(map(parse_setting, settings)) | found)
    except ParameterError as error:
        raise CommandError(f"{source} lasts {duration_s:g} s, which cannot be flown: {error}") from error
    return found


def path(name: str, source_line: str, time_s: Array, angles: Array, keyframes: Keyframes) -> PosturePath:
    """The path through the postures that are kept, alpha going with time."""
    alphas = np.interp(time_s[keyframes.kept], time_s[[0, -1]], ALPHA)
    postures = [
        Posture(
            name=f"{name}_{time_s[row]:g}s",
            joint_angles_deg=joint_rows(np.rad2deg(angles[row].reshape(len(JOINTS), -1)).round(DECIMALS)),
        )
        for row in keyframes.kept
    ]
    return PosturePath(
        name=name,
        description=f"Motion of {time_s[-1] - time_s[0]:g} s; alpha goes with time",
        source=source_line,
        keyframes=tuple(
            Keyframe(alpha=float(alpha), posture=posture)
            for alpha, posture in zip(alphas, postures, strict=True)
        ),
    )


def exact_enough(
    source: Path, path: PosturePath, scenario_with: Callable[[int], Scenario]
) -> tuple[Scenario, TableError]:
    """The scenario with so many nodes that the plant's table is exact enough for the path, and the table's error."""
    closest = float(np.diff([keyframe.alpha for keyframe in path.keyframes]).min())
    nodes, most = _NODES
    needed = (ALPHA[1] - ALPHA[0]) / closest + 1.0
    if needed > most + 1e-6:
        raise CommandError(
            f"{source} moves too fast for its length, some postures that it needs are less than 1/{most - 1} of it"
            f" apart: {_MEND}"
        )
    nodes = max(nodes, math.ceil(needed - 1e-6))
    while True:
        scenario = scenario_with(nodes)
        plant = scenario.plant
        moves = movement(plant.posture, plant.pattern)
        error = table_error(plant, build_model(plant, scenario.dt_s, moves), moves)
        if not error.too_large:
            build_plant(scenario)  # refuses what the run would refuse
            return scenario, error
        if nodes == most:
            raise CommandError(
                f"{source} moves too fast for its length, with {most} nodes the plant's table is still off by"
                f" {error}: {_MEND}"
            )
        nodes = min(2 * nodes - 1, most)


def flight(name: str, path: PosturePath, duration_s: float) -> dict[str, object]:
    """Overrides that fly the path open loop from its first posture."""
    first, last = ALPHA
    points = [[_BEFORE_S, first], [_BEFORE_S + duration_s, last]]
    return {
        "name": name,
        "title": f"Measured motion {name}",
        "description": path.source,
        "plant.pattern": path.as_dict(),
        "plant.posture": path.keyframes[0].posture.as_dict(),
        "plant.limits.alpha": list(ALPHA),
        "plant.initial.alpha": first,
        "plant.initial.bank_deg": 0.0,
        "controller": {"kind": "open_loop"},
        "reference": {"kind": "points", "output": "alpha", "points": points},
    }

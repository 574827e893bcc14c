# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc pattern import``: measured postures as a path that can be flown."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.body.keyframes import Keyframes, thin
from skydiver_utc.body.movement import movement
from skydiver_utc.body.posture import joint_angle_names, joint_ranges, joint_rows
from skydiver_utc.body.segments import JOINTS
from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.motion_command import ALPHA, command, scenario_of, settings_of, timing
from skydiver_utc.cli.outputs import name_of, write
from skydiver_utc.cli.pattern_extract import whole_postures
from skydiver_utc.cli.settings import load_skydiver
from skydiver_utc.loop.registry import build_plant
from skydiver_utc.parameters import (
    Keyframe,
    ParameterError,
    Posture,
    PosturePath,
    Scenario,
    SkydiverSettings,
)
from skydiver_utc.plants.skydiver.model import build_model
from skydiver_utc.plants.skydiver.table_error import TableError, table_error
from skydiver_utc.plants.skydiver.trim import DECIMALS
from skydiver_utc.recording.joint_angles import read_joint_angles

Array = NDArray[np.float64]

# Nodes of the plant's table over alpha: at least as dense as the postures, doubled until it is exact enough.
_NODES = (257, 1025)
# Angles beyond the joint limits by less are clipped. Errors of measured gait of up to 5 deg are reasonable: McGinley et
# al., Gait & Posture 29 (2009) 360.
_CLIPPED_DEG = 5.0
# Postures nearer in time are a fault of the file [s].
_SHORTEST_S = 1e-6
_MEND = "cut it into shorter files, or allow a larger --tolerance"


def import_motion(
    source: Path,
    out: Path,
    tolerance: float,
    scenario: str,
    settings: Sequence[str],
    force: bool,
) -> None:
    """Write a path through measured postures and its first posture; print the command that flies it."""
    name = name_of(out, "", force)
    start = out.with_name(f"{name}_start.yaml")
    name_of(start, "", force)
    if not 0.0 < tolerance < math.inf:
        raise CommandError(f"--tolerance {tolerance:g} cannot be used: give degrees above zero, as in 0.5")
    plant = load_skydiver(scenario, settings).plant
    time_s, angles = _measured(source, plant)
    angles, clipped = _clipped(source, plant, time_s, angles)
    duration_s = float(time_s[-1]) - float(time_s[0])
    in_time = _in_time(source, plant, scenario, settings, duration_s)
    keyframes = thin(time_s, angles, float(np.deg2rad(tolerance)))
    kept = _kept(keyframes, len(time_s))
    source_line = (
        f"{source.name} from {time_s[0]:g} to {time_s[-1]:g} s, by skydiver-utc pattern import: {kept}; {clipped};"
        f" angles that it lacks are those of posture {plant.posture.name}"
    )
    path = _path(name, source_line, time_s, angles, keyframes)
    first = Posture(
        name=start.stem,
        description="First posture of a motion",
        source=source_line,
        joint_angles_deg=path.keyframes[0].posture.joint_angles_deg,
    )

    def settings_with(nodes: int) -> list[str]:
        return [*settings, *settings_of(out, start, duration_s, nodes), *in_time]

    table = _table(source, path, lambda nodes: scenario_of(scenario, settings_with(nodes), path, first))
    write(path, out)
    write(first, start)
    print(f"{clipped}\n{kept}\nbetween the plant's {table.nodes} nodes its table is off by {table.error}")
    print(f"{out} holds the path, {start} its first posture; to fly it:\n")
    print(command(scenario, settings_with(table.nodes)))


def _measured(source: Path, plant: SkydiverSettings) -> tuple[Array, Array]:
    """Times (n,) and whole postures (n, 45) [rad]."""
    recorded = read_joint_angles(source, joint_angle_names())
    time_s, angles = recorded.time_s, whole_postures(source, recorded, plant.posture)
    for before, after in zip(time_s.tolist(), time_s[1:].tolist(), strict=False):
        if after - before < _SHORTEST_S:
            raise CommandError(
                f"two postures in {source}, at {after:g} s, are {after - before:.2g} s apart: leave at least"
                f" {_SHORTEST_S:g} s between them"
            )
    return time_s, angles


def _clipped(source: Path, plant: SkydiverSettings, time_s: Array, angles: Array) -> tuple[Array, str]:
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


def _in_time(
    source: Path, plant: SkydiverSettings, scenario: str, settings: Sequence[str], duration_s: float
) -> list[str]:
    """Settings for a motion of a duration; one that no flight can follow is refused."""
    needed = timing(plant, duration_s)
    try:
        load_skydiver(scenario, [*settings, *needed])
    except ParameterError as error:
        raise CommandError(f"{source} lasts {duration_s:g} s, which cannot be flown: {error}") from error
    return needed


def _kept(keyframes: Keyframes, count: int) -> str:
    return (
        f"kept {len(keyframes.kept)} of {count} postures, the path is within"
        f" {np.rad2deg(keyframes.error):.2g} deg of all others"
    )


def _path(name: str, source_line: str, time_s: Array, angles: Array, keyframes: Keyframes) -> PosturePath:
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


class _Table(NamedTuple):
    nodes: int
    error: TableError


def _table(source: Path, path: PosturePath, scenario_with: Callable[[int], Scenario]) -> _Table:
    """The number of nodes with which the plant's table is exact enough for the path."""
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
            return _Table(nodes, error)
        if nodes == most:
            raise CommandError(
                f"{source} moves too fast for its length, with {most} nodes the plant's table is still off by"
                f" {error}: {_MEND}"
            )
        nodes = min(2 * nodes - 1, most)

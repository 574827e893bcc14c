"""``skydiver-utc pattern import``: measured postures as a path that can be flown."""

import math
import shlex
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.body.keyframes import Keyframes, thin
from skydiver_utc.body.posture import joint_angle_names, joint_rows, refuse_beyond
from skydiver_utc.body.segments import JOINTS
from skydiver_utc.parameters import Keyframe, Posture, PosturePath, Scenario
from skydiver_utc.recording.joint_angles import read_joint_angles
from skydiver_utc.verbs.errors import VerbError
from skydiver_utc.verbs.parameter_file import DECIMALS, name_of, write
from skydiver_utc.verbs.pattern_extract import whole_postures
from skydiver_utc.verbs.settings import load

Array = NDArray[np.float64]

# The range of alpha that the motion is laid over [rad].
_ALPHA = (0.0, 2.0)
# Nodes of the plant's table over alpha: at least as dense as the postures.
_NODES = (257, 1025)
# What the flight holds the first and the last posture for [s].
_BEFORE_S, _AFTER_S = 1.0, 5.0


def import_motion(
    source: Path,
    out: Path,
    posture_name: str | None,
    tolerance_deg: float,
    scenario_name: str,
    settings: Sequence[str],
) -> None:
    """Write a path through measured postures and its first posture; tell what was kept and how to fly it."""
    name = name_of(out, "")
    chosen = [] if posture_name is None else [f"posture={posture_name}"]
    scenario = load(scenario_name, [*chosen, *settings])
    recorded = read_joint_angles(source, joint_angle_names())
    time_s, angles = recorded.time_s, whole_postures(recorded, scenario.posture)
    shape = (len(JOINTS), -1)
    for moment, row in zip(time_s, angles, strict=True):
        refuse_beyond(scenario.subject.joint_limits, row.reshape(shape), f"{source} at {moment:g} s")
    keyframes = thin(time_s, angles, float(np.deg2rad(tolerance_deg)))
    alphas = np.interp(time_s[keyframes.kept], time_s[[0, -1]], _ALPHA)
    nodes = _nodes(source, alphas)
    postures = [
        Posture(
            name=f"{name}_{time_s[row]:g}s",
            joint_angles_deg=joint_rows(np.rad2deg(angles[row].reshape(shape)).round(DECIMALS)),
        )
        for row in keyframes.kept
    ]
    told = _told(keyframes, len(time_s))
    source_line = (
        f"{source.name} from {time_s[0]:g} to {time_s[-1]:g} s, by skydiver-utc pattern import: {told}; angles that"
        f" it lacks are those of posture {scenario.posture.name}"
    )
    path = PosturePath(
        name=name,
        description=f"Motion of {time_s[-1] - time_s[0]:g} s; alpha goes with time",
        source=source_line,
        keyframes=tuple(map(Keyframe, map(float, alphas), postures)),
    )
    start = out.with_name(f"{name}_start.yaml")
    write(path, out)
    write(
        Posture(
            name=start.stem,
            description="First posture of a motion",
            source=source_line,
            joint_angles_deg=postures[0].joint_angles_deg,
        ),
        start,
    )
    print(f"{told}\n{out} holds the path, {start} its first posture; to fly it:\n")
    print(_command(scenario, scenario_name, settings, out, start, float(time_s[-1] - time_s[0]), nodes))


def _told(keyframes: Keyframes, count: int) -> str:
    return (
        f"kept {len(keyframes.kept)} of {count} postures, the path is within"
        f" {np.rad2deg(keyframes.error):.2g} deg of all others"
    )


def _nodes(source: Path, alphas: Array) -> int:
    """How many nodes the plant's table needs for postures at these pattern angles."""
    closest = float(np.diff(alphas).min())
    needed = math.ceil(round((_ALPHA[1] - _ALPHA[0]) / closest, 6)) + 1
    least, most = _NODES
    if needed > most:
        raise VerbError(
            f"{source} moves too fast for its length, some postures that it needs are less than 1/{most - 1} of it"
            " apart: cut it into shorter files, or allow a larger --tolerance"
        )
    return max(least, needed)


def _command(
    scenario: Scenario,
    scenario_name: str,
    settings: Sequence[str],
    out: Path,
    start: Path,
    duration_s: float,
    nodes: int,
) -> str:
    """The command that flies the path in the time that it was measured in."""
    rate = (_ALPHA[1] - _ALPHA[0]) / duration_s
    first, last = _ALPHA
    needed = [
        f"name={out.stem}",
        f"title=Measured motion {out.stem}",
        f"pattern={out}",
        f"posture={start}",
        f"plant.limits.alpha=[{first:g}, {last:g}]",
        f"plant.pattern_nodes={nodes}",
        f"initial.alpha={first:g}",
        "initial.bank_deg=0",
        f"duration_s={_BEFORE_S + duration_s + _AFTER_S:g}",
        "controller={kind: open_loop}",
        f"reference={{kind: posture, points: [[{_BEFORE_S:g}, {first:g}],"
        f" [{_BEFORE_S + duration_s:g}, {last:g}]]}}",
    ]
    if rate > scenario.plant.limits.alpha_rate:
        needed.append(f"plant.limits.alpha_rate={rate:g}")
    chosen = [part for setting in (*settings, *needed) for part in ("--set", setting)]
    return shlex.join(["skydiver-utc", "simulate", scenario_name, *chosen])

# SPDX-License-Identifier: Apache-2.0
"""Motion files of OpenSim (.mot, .sto): its joint coordinates as joint angles of this body.

The coordinates are those of gait2392, of the full-body model of Hamner and of Rajagopal, which share axes (x forwards,
y up, z to the right), zero pose and order of rotations with one another and, but for the forearm, with this body.
"""

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.errors import RecordingError
from skydiver_utc.recording.number_table import numbers, refuse_twice, text_of

ENDINGS = (".mot", ".sto")


class _Part(NamedTuple):
    """A joint angle as a share of a coordinate, beyond an angle at which that is zero [deg]."""

    angle: str
    share: float
    zero_deg: float = 0.0


# Without side: the coordinates end in _r or _l, the angles begin with right_ or left_.
_OF_A_SIDE = {
    "hip_flexion": _Part("hip_flexion", 1.0),
    "hip_adduction": _Part("hip_abduction", -1.0),
    "hip_rotation": _Part("hip_rotation", 1.0),
    "knee_angle": _Part("knee_flexion", 1.0),
    "ankle_angle": _Part("ankle_flexion", 1.0),
    "subtalar_angle": _Part("ankle_abduction", -1.0),
    "arm_flex": _Part("shoulder_flexion", 1.0),
    "arm_add": _Part("shoulder_abduction", -1.0),
    "arm_rot": _Part("shoulder_rotation", 1.0),
    "elbow_flex": _Part("elbow_flexion", 1.0),
    "pro_sup": _Part("elbow_rotation", 1.0, 90.0),  # zero: the palm forwards, here to the thigh
    "wrist_flex": _Part("wrist_abduction", -1.0),
    "wrist_dev": _Part("wrist_flexion", -1.0),
}
# OpenSim's trunk bends in one joint, this one in two.
_OF_THE_TRUNK = {
    "lumbar_extension": ("flexion", -0.5),
    "lumbar_bending": ("abduction", -0.5),
    "lumbar_rotation": ("rotation", 0.5),
}
PARTS = {
    **{
        f"{name}_{side[0]}": (part._replace(angle=f"{side}_{part.angle}"),)
        for name, part in _OF_A_SIDE.items()
        for side in ("right", "left")
    },
    **{
        name: tuple(_Part(f"{joint}_{angle}", share) for joint in ("lumbar", "thorax"))
        for name, (angle, share) in _OF_THE_TRUNK.items()
    },
}
_UNITS = {"yes": 1.0, "no": np.rad2deg(1.0)}


def read_opensim(path: Path) -> tuple[Array, tuple[str, ...], Array, str]:
    """Times (n,), names of m joint angles, their values (n, m) [rad], and in words what was left out.

    A knee bends by up to 135 deg one way and by 10 the other: its largest angle tells the model's sign.
    """
    lines = text_of(path).splitlines()
    end = next((i for i, line in enumerate(lines) if line.strip().lower() == "endheader"), None)
    units = re.findall(
        r"^\s*inDegrees\s*=\s*(yes|no)\s*$", "\n".join(lines[:end]), re.MULTILINE | re.IGNORECASE
    )
    if end is None or len(units) != 1:
        raise RecordingError(
            f"{path} has no header with the unit of its angles: write inDegrees=yes or inDegrees=no, then endheader,"
            " above the names of the columns"
        )
    table = [(i, line.split()) for i, line in enumerate(lines[end + 1 :], end + 2) if line.strip()]
    line, header = table[0] if table else (end + 1, [""])
    names = [_coordinate(name) for name in header]
    columns = [i for i, name in enumerate(names) if name in PARTS]
    if names[0] != "time" or not columns:
        raise RecordingError(
            f"{path} line {line}: the columns must be time and coordinates of gait2392 or Rajagopal, as in"
            " hip_flexion_r; write the result of OpenSim's inverse kinematics"
        )
    refuse_twice(path, line, [names[0], *(names[i] for i in columns)])
    values = numbers(path, header, [0, *columns], table[1:], _UNITS[units[0].lower()])
    notes = []
    knees = [j for j, i in enumerate(columns, 1) if names[i].startswith("knee_angle_")]
    if knees and values[:, knees].max() < -values[:, knees].min():
        values[:, knees] = -values[:, knees]
        notes.append(f"a bent knee has a negative angle in {path.name}, as in gait2392")
    if others := [name for i, name in enumerate(header) if i and i not in columns]:
        notes.append(f"left out of {path.name}: {', '.join(others)}")
    found = [
        (part.angle, part.share * (values[:, j] - part.zero_deg))
        for j, i in enumerate(columns, 1)
        for part in PARTS[names[i]]
    ]
    angles = np.deg2rad(np.array([angle for _, angle in found]).T)
    return values[:, 0], tuple(name for name, _ in found), angles, "; ".join(notes)


def _coordinate(column: str) -> str:
    """The coordinate of a column; OpenSim 4 names it by a path, as in /jointset/hip_r/hip_flexion_r/value."""
    *path, last = column.split("/")
    return path[-1] if path and last == "value" else column
